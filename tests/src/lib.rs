//! Whole-system tests of mimu.
//!
//! | where                  | what                                                              |
//! |------------------------|-------------------------------------------------------------------|
//! | [`simulation`]         | inertial units with known truth, by physics that share nothing with `mimu` |
//! | `tests/agreement.rs`   | least squares against Kalman filter, forward against inverse model |
//! | `tests/coverage.rs`    | do the 95 % intervals contain the truth in 95 % of the cases?     |
//! | `tests/real_*.rs`      | real recordings by other people against their published results   |
//! | `demo.sh`, `demo/`     | what `make demo` runs, and the small recording that it falls back on |

pub mod recordings;
pub mod simulation;
