//! The calibrations of many units: what they have in common, and which do not belong.
//!
//! | in order of use | what |
//! |---|---|
//! | [`tree`] | finds and reads the calibration files of a tree |
//! | [`labels`] | unit, operator, fixture, date and batch of a file, from folder names or a table |
//! | [`measured`] | the parameters of a calibration in units that a fleet has in common |
//! | [`population`] | mean and covariance with the uncertainty of the fits removed, and how improbable each unit is |
//! | [`repeats`] | several measurements of a unit |
//! | `remeasured` | units that are measured on many days and change |
//! | [`levels`] | batches, fixtures, operators that differ from the others |
//! | [`drift`] | control charts (EWMA) by date |
//! | [`capability`] | Cp and Cpk against the limits of a part |
//! | `triad`, `charts` | these of one triad, of all labels |
//! | `judge` | the judgement |
//! | [`prior`] | the population as a prior of a further unit |
//! | [`fleet`](mod@fleet) | puts it together |
//! | [`result`] | the result, as JSON has it |
//!
//! Scale factors are relative to the median of the fleet, biases are divided by the scale factor (rad/s, m/s²), angles are in rad.

pub mod capability;
mod charts;
pub mod drift;
pub mod fleet;
mod judge;
pub mod labels;
pub mod levels;
pub mod measured;
pub mod population;
pub mod prior;
mod remeasured;
pub mod repeats;
pub mod result;
mod robust;
pub mod tree;
mod triad;

pub use fleet::{fleet, fleet_and_prior};
pub use result::Fleet;
