//! Views of a wizard session: lines of text, JSON lines, or a full screen.

pub(crate) mod answers;
pub(crate) mod lines;
pub(crate) mod picture;
pub(crate) mod screen;
