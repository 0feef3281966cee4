//! Equipment that moves a unit.
//!
//! | module | what it is |
//! |---|---|
//! | [`step`] | a requested dwell: which direction points up, the rate, and the duration |
//! | [`drive`] | moves the unit: a person, or a table with text commands |

pub mod drive;
pub mod step;
