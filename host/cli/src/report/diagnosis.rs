//! What `mimu diagnose` says.

mod page;
mod text;

pub use page::{Made, diagnosis_page};
pub use text::{diagnosis_text, not_in_plan_text};
