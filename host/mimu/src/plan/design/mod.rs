//! D-optimal design of calibration experiments: which attitudes and rates, how many, for how long.
//!
//! | module                        | what                                                                     |
//! |-------------------------------|--------------------------------------------------------------------------|
//! | [`model`], [`reach`]          | regressors of a calibration model; settings that a table or a hand reaches |
//! | [`information`]               | rows of regressors, determinant and inverse of `F'F`                     |
//! | [`exchange`], [`refinement`]  | exact designs of n dwells: on candidates, then between them              |
//! | [`continuous`]                | the optimum that no n dwells can beat, with a proof of how near it is    |
//! | [`judgement`], [`lack_of_fit`] | what a set of settings determines, how well, and what it would notice   |
//! | [`population`]                | what the population of a unit's kind says beside the dwells               |
//! | [`fewest`]                    | half-widths that a design predicts, and the fewest dwells that suffice   |
//! | [`next_pose`]                 | what one more dwell adds to those that a unit has had                    |
//! | `aim`                         | poses as a person takes them, near those of the plan                     |
//! | [`tour`], [`budget`]          | order and time of a sequence; best use of a limited time                 |
//! | [`schemes`]                   | published schemes                                                        |
//! | [`problem`]                   | a model, what it can be measured with, and the best designs of it        |
//!
//! The criterion is fang (22), `det(F'F/n)`, of the parameters of all three sensors together. The gyro by hand is
//! not treated here: its known inputs are the turns between dwells, not the dwells.
//!
//! ```
//! use mimu::plan::design::{Problem, model::{Model, Terms}, reach::Fixture, schemes::Scheme};
//! use mimu::quantity::Sensor;
//! use mimu_recording::Reference;
//!
//! let model = Model::accel(Reference::Table, &Terms::default());
//! let problem = Problem::accel(model, Fixture::ThreeAxis)?;
//! let six = problem.best(6, 1)?;
//! let ours = problem.judge(&six, 1e-3);
//! let fang = problem.judge(&Scheme::FangNine.settings(Sensor::Accel)?, 1e-3);
//! assert!((ours.d_efficiency - 1.0).abs() < 1e-6 && fang.d_efficiency < 0.95);
//! # Ok::<(), mimu_recording::error::Error>(())
//! ```

mod aim;
pub mod budget;
pub mod continuous;
pub mod exchange;
pub mod fewest;
pub mod information;
pub mod judgement;
pub mod lack_of_fit;
pub mod model;
pub mod next_pose;
pub mod population;
pub mod problem;
pub mod reach;
pub mod refinement;
pub mod schemes;
pub mod tour;

pub use problem::Problem;
