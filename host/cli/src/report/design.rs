//! A design as text.

mod next;
mod prior;
mod text;

pub use next::next_text;
pub use text::{comparison_text, design_text};
