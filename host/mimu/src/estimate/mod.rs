//! Estimators: from dwell means and rotations to a calibrated triad with its covariance.
//!
//! | module            | reference | what it is                                               |
//! |-------------------|-----------|----------------------------------------------------------|
//! | [`known_input`]   | table     | forward least squares, Kalman bank, xu's inverse form, six positions |
//! | [`gravity_size`]  | gravity   | accelerometer from the magnitude of gravity over many poses   |
//! | [`rotation`]      | gravity   | gyro from the turns between dwells                       |
//! | [`turn`]          | gravity   | one turn, and where a calibration carries gravity in it   |
//! | [`chains`]        | gravity   | dwells that turns connect one to the next                 |
//! | [`earth`]         | gravity   | what the turning Earth adds to it                         |
//! | [`least_squares`] | both      | the algebra under all of them                            |

pub mod chains;
pub mod earth;
pub mod gravity_size;
pub mod known_input;
pub mod least_squares;
pub mod rotation;
pub mod turn;

use nalgebra::Vector3;

use crate::triad::Triad;
use least_squares::Scatter;

/// One dwell as an estimator sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Index of the dwell it comes from.
    pub dwell: usize,
    /// Mean raw reading.
    pub raw: Vector3<f64>,
    /// Variance of `raw` by the noise within dwells, raw units squared.
    pub variance: Vector3<f64>,
    /// True input in SI; not a number where only the magnitude of gravity is known.
    pub input: Vector3<f64>,
}

/// What an estimator found for one triad.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimated {
    /// The calibration.
    pub triad: Triad,
    /// Scatter by axis where the axes are fitted one by one, by group otherwise.
    pub scatter: Vec<(String, Scatter)>,
    /// Condition number of the scaled design.
    pub condition: f64,
    /// What a person should know.
    pub notes: Vec<String>,
}

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// The experiment leaves parameters undetermined: their names, and what to add.
    Undetermined {
        /// Names of the parameters.
        parameters: String,
        /// What to add to the experiment.
        add: String,
    },
    /// The iteration did not converge or the result is singular: what was seen.
    NoSolution(String),
}

impl Failure {
    /// What is wrong, as a sentence fragment.
    pub fn problem(&self) -> String {
        match self {
            Self::Undetermined { parameters, .. } => {
                format!("the experiment leaves {parameters} undetermined")
            }
            Self::NoSolution(seen) => seen.clone(),
        }
    }

    /// As an error about `sensor`.
    pub fn into_error(self, sensor: crate::quantity::Sensor) -> mimu_recording::error::Error {
        let problem = self.problem();
        match self {
            Self::Undetermined { add, .. } => {
                mimu_recording::error::Error::undetermined(sensor, problem, add)
            }
            Self::NoSolution(_) => mimu_recording::error::Error::new(
                sensor,
                problem,
                "look at the recording: wrong columns, wrong reference, or motion within dwells",
            ),
        }
    }
}
