//! Whole-system tests of mimu.
//!
//! | where                  | what                                                              |
//! |------------------------|-------------------------------------------------------------------|
//! | [`mod@bench`]          | units with known truth on the virtual bench, read as a user's would be |
//! | [`blind`], [`by_hand`] | units with undeclared effects, on a table and by hand             |
//! | [`study`]            | what a diagnosis says, and tables of many cases                   |
//! | [`judged`]             | judgements of clean sessions and of sessions with an effect of known strength |
//! | [`sessions`]           | several sessions of one unit, and one that they predict           |
//! | [`fleet`] | units of one population, and the prior of it                  |
//! | [`slow_bias`]          | units by hand whose biases move with time or temperature, at once or with a lag |
//! | [`ramp`]               | units in a chamber whose temperature goes up and down            |
//! | [`coverage`]           | how often intervals contain the truth, from recording to fit      |
//! | [`earth`]              | the Earth's rate in the biases of gyros on a table                |
//! | [`recordings`]         | recordings by other people                                        |
//! | [`imu_tk`]             | the method of another program, to compare with                    |
//! | [`planted`]            | effects of the bench, planted in them                             |
//! | [`body`]                         | bodies of several triads by hand                                   |
//! | [`noise_in_use`], [`flight`] | noise in motion of units that are wrong in a known way, by rests and by a trajectory |
//! | [`niu`]                | niu's tables                                                      |
//! | [`page`]               | tables in documents, between markers                              |
//! | [`text_board`], [`stored_calibration`] | a board that writes text, in hands; its calibration file against its truth |
//! | `tests/all/`           | agreement of estimators, intervals, diagnosis, published results  |
//! | `frozen/`              | results of recordings of every kind, as they are: `tests/all/frozen.rs` compares them |
//! | `papers/`, `blind/`    | figures of `docs/papers`; units with undeclared effects        |
//! | `clumsy/`              | sessions of the wizard with a person who errs, on boards that err |
//! | `board/`, `counted/`, `no_panic/` | separate crates: the firmware's image on the emulated board, the cost of its loops, freedom from panics |
//! | `example.sh`, `example/` | the commands of `make example`, and the small recording that it uses if the public ones are absent |

pub mod bench;
pub mod blind;
pub mod body;
pub mod body_sessions;
pub mod by_hand;
pub mod coverage;
pub mod earth;
pub mod fleet;
pub mod flight;
pub mod imu_tk;
pub mod judged;
pub mod niu;
pub mod noise_in_use;
pub mod page;
pub mod planted;
pub mod ramp;
pub mod recordings;
pub mod sessions;
pub mod slow_bias;
pub mod spinner;
pub mod stored_calibration;
pub mod study;
pub mod text_board;
pub mod whole_turns;

/// Checks that `text` contains all these words.
#[track_caller]
pub fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is not in: {text}");
    }
}
