//! Whole-system tests of mimu.
//!
//! | where                  | what                                                              |
//! |------------------------|-------------------------------------------------------------------|
//! | [`mod@bench`]          | units with known truth on the virtual bench, read as a user's would be |
//! | [`blind`], [`by_hand`] | units with undeclared effects, on a table and in the hand         |
//! | [`joint`]              | several sessions of one unit together, and their file on another one |
//! | [`slow_bias`]          | units by hand whose biases move with time, with temperature, and behind it |
//! | [`coverage`]           | how often intervals hold the truth, over the whole path of a recording |
//! | [`recordings`]         | recordings by other people                                        |
//! | `tests/all/`           | agreement of estimators, intervals, diagnosis, published results  |
//! | `papers/`, `blind/`    | figures of `docs/papers.md`; units with undeclared effects        |
//! | `board/`, `counted/`, `no_panic/` | crates of their own: the firmware's image on the emulated board, what its loops cost, what cannot panic |
//! | `example.sh`, `example/` | what `make example` runs, and the small recording that it falls back on |

pub mod bench;
pub mod blind;
pub mod by_hand;
pub mod coverage;
pub mod joint;
pub mod recordings;
pub mod slow_bias;
