//! How a session of the wizard is shown: as lines of text, as JSON lines, or on a full screen.

pub(crate) mod answers;
pub(crate) mod lines;
pub(crate) mod picture;
pub(crate) mod screen;
