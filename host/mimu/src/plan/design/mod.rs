//! D-optimal design of calibration experiments: which attitudes and rates, how many, for how long.
//!
//! | module                        | what                                                                     |
//! |-------------------------------|--------------------------------------------------------------------------|
//! | [`model`], [`reach`]          | regressors of a calibration model; settings that a table or a hand reaches |
//! | [`information`]               | rows of regressors, determinant and inverse of `F'F`                     |
//! | [`exchange`], [`refinement`]  | exact designs of n dwells: on candidates, then between them              |
//! | [`judgement`]                 | what a set of settings determines, and how well                          |
//! | [`population`]                | what the population of a unit's kind says beside the dwells               |
//! | [`fewest`]                    | half-widths that a design predicts, and the fewest dwells that suffice   |
//! | [`next_pose`]                 | what one more dwell adds to those that a unit has had                    |
//! | `aim`                         | poses as a person takes them, near those of the plan                     |
//! | [`tour`], [`budget`]          | order and time of a sequence; best use of a limited time                 |
//! | [`problem`]                   | a model, what it can be measured with, and the best designs of it        |
//!
//! The criterion is fang (22), `det(F'F/n)`. The gyro by hand is
//! not treated here: its known inputs are the turns between dwells, not the dwells.
//!
//! ```
//! use mimu::plan::design::{Problem, reach::Fixture};
//! use mimu_recording::Reference;
//!
//! let problem = Problem::accel(Reference::Table, Fixture::ThreeAxis)?;
//! let six = problem.best(6, 1)?;
//! let ours = problem.judge(&six, 1e-3);
//! assert!((ours.d_efficiency - 1.0).abs() < 1e-6 && ours.undetermined().is_empty());
//! # Ok::<(), mimu_recording::error::Error>(())
//! ```

mod aim;
pub mod budget;
pub mod exchange;
pub mod fewest;
pub mod information;
pub mod judgement;
pub mod model;
pub mod next_pose;
pub mod population;
pub mod problem;
pub mod reach;
pub mod refinement;
pub mod tour;

pub use problem::Problem;
