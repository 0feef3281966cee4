//! Equipment that moves a unit and changes its temperature, and procedures with it.
//!
//! | module | what it is |
//! |---|---|
//! | [`step`] | a requested dwell: which direction points up, the rate, and the duration |
//! | [`drive`] | moves the unit and changes its temperature: a person, or a table and a chamber with text commands |
//! | [`carry_out`] | a procedure over temperature: moves chamber and table through a plan, and makes one recording of it |

pub mod carry_out;
pub mod drive;
pub mod step;
