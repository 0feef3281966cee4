//! The time of foreign rows: the unit of their stamps, and the regular time behind them.

mod calendar;
mod clock;
mod counting;
mod gap;
mod grid;
mod lateness;
mod polled;
mod regular;
mod stamp;
mod stamps;

pub use clock::TimeSummary;
pub use gap::Jitter;
pub use polled::Rounds;

pub(super) use calendar::parse as calendar_time;
pub(super) use clock::{Known, Times};
pub(super) use polled::LONGEST;
pub(super) use stamp::{Seen, Stamp, Unit};
pub(super) use stamps::Stamps;
