//! Equipment that turns and warms a unit, and what is carried out with it.
//!
//! | module | what it is |
//! |---|---|
//! | [`step`] | a dwell that is wanted: which way is up, how fast it turns, how long |
//! | [`drive`] | what turns and warms the unit: a person, or a table and a chamber that take text commands |
//! | [`carry_out`] | a procedure over temperature: chamber and table led through a plan, and one recording of it |

pub mod carry_out;
pub mod drive;
pub mod step;
