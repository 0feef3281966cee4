//! The time of foreign rows: the unit of their stamps, and the regular time behind them.

mod clock;
mod regular;
mod stamp;

pub use clock::TimeSummary;
pub use regular::Jitter;
pub use stamp::Decimal;

pub(super) use clock::{Clock, Stamps, Times};
pub(super) use stamp::Stamp;
