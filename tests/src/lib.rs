//! Whole-system tests of mimu.
//!
//! | where                  | what                                                              |
//! |------------------------|-------------------------------------------------------------------|
//! | [`mod@bench`]          | units with known truth on the virtual bench, read as a user's would be |
//! | [`coverage`]           | how often intervals hold the truth, over the whole path of a recording |
//! | [`device`]             | the firmware on the emulated board                                |
//! | [`recordings`]         | recordings by other people                                        |
//! | `tests/agreement.rs`   | least squares against Kalman filter, forward against inverse model |
//! | `tests/coverage.rs`    | do the 95 % intervals contain the truth in 95 % of the cases?     |
//! | `tests/real_*.rs`      | real recordings by other people against their published results   |
//! | `tests/device_*.rs`   | the firmware's release image on the emulated board                |
//! | `traces/`              | what the device sent of every kind of step, which `core` computes again |
//! | `budget/`, `counted/`  | what the firmware costs                                           |
//! | `demo.sh`, `demo/`     | what `make demo` runs, and the small recording that it falls back on |

pub mod bench;
pub mod blind;
pub mod coverage;
pub mod device;
pub mod recordings;
