//! A view of a wizard session: lines of text, JSON lines, and what the person types.

pub(crate) mod answers;
pub(crate) mod lines;
