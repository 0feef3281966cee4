//! A design as text.

mod budget;
mod comparison;
mod next;
mod prior;
mod text;

pub use comparison::comparison_text;
pub use next::next_text;
pub use text::design_text;

use crate::report::text::wrap;

/// Wrapped text next to a name.
fn wrapped(out: &mut String, name: &str, text: &str) {
    wrap(out, &format!("  {name:<22}"), text);
}
