//! The station's test on the virtual bench: units of known truth, healthy and with faults.

mod bench;
mod coverage;
mod faults;
mod line;
