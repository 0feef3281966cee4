//! What `mimu allan` says: JSON and the noise file for programs, a table for people.

mod file;
mod json;
mod text;

pub use file::allan_toml;
pub use json::allan_json;
pub use text::allan_text;
