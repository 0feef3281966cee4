//! Calibration of inertial units made of analog MEMS sensors.
//!
//! | in order of use | what                                                                          |
//! |-----------------|-------------------------------------------------------------------------------|
//! | [`quantity`]    | sensors, axes, units, and how numbers are written                            |
//! | [`blocks`], [`increment`] | one pass over the samples condenses them to 0.1 s blocks and 10 ms integrals |
//! | [`rails`], [`stillness`], [`dwell`] | which samples and which stretches can be averaged           |
//! | [`reading_step`] | the step that readings are multiples of                                       |
//! | [`noise`]       | how well a dwell mean is known                                                |
//! | [`prepared`]    | all of these for one recording                                                |
//! | [`estimate`]    | the estimators                                                                |
//! | [`triad`]       | calibration of one triad: both directions, covariances, physical quantities   |
//! | [`fit`], [`plausible`] | both triads, judged on what they have not seen; what cannot be right is refused |
//! | [`calibration`], [`verify`] | the file, and judging it by another recording                     |
//! | [`diagnose`]    | the effect behind a residual: found, added, proved on other data              |
//! | [`design`]      | experiments: which attitudes and rates, how many, for how long                |
//! | [`next_experiment`] | what to record next, where a diagnosis leaves something open              |
//! | [`allan`]       | noise from a recording at rest: Allan deviation and noise model                |
//! | [`noise_file`]  | its result for the other commands                                             |

pub mod allan;
pub mod blocks;
pub mod calibration;
pub mod design;
pub mod diagnose;
pub mod dwell;
pub mod estimate;
pub mod fit;
pub mod increment;
pub mod next_experiment;
pub mod noise;
pub mod noise_file;
pub mod plausible;
pub mod prepared;
pub mod quantity;
pub mod rails;
pub mod reading_step;
pub mod stillness;
pub mod triad;
pub mod verify;
