//! Estimators: from dwell means and rotations to a calibrated triad with its covariance. Residuals and derivatives are those of [`crate::observation`].
//!
//! | module            | reference | what it is                                               |
//! |-------------------|-----------|----------------------------------------------------------|
//! | [`known_input`]   | table     | forward least squares, also of inputs that move within dwells |
//! | [`magnitude`]     | gravity, turntable | accelerometer from the magnitude of gravity over many poses; gyro from that of a turntable's rate |
//! | [`rotation`]      | gravity   | gyro from the turns between dwells                       |
//! | [`whole_turns`]   | gravity   | the same with turns that end where they began            |
//! | [`with_turns`]    | gravity   | accelerometer from magnitudes and turns together         |
//! | [`factor_fit`]    | gravity, turntable | the nonlinear fit of a list of factors, under the last four |
//! | [`earth`]         | gravity   | the Earth's rate in the gyro's readings                   |
//! | [`earth_on_table`] | table    | the same through the dwells of a table                    |
//! | [`earth_shared`]  | table     | what is unknown of it, shared by dwells                   |
//! | [`least_squares`] | both      | the algebra under all of them                            |

pub mod earth;
pub mod earth_on_table;
pub mod earth_shared;
pub mod factor_fit;
mod inputs;
pub mod known_input;
pub mod least_squares;
pub mod magnitude;
pub mod rotation;
pub mod whole_turns;
pub mod with_turns;

use nalgebra::Vector3;

use crate::observable::Observable;
use crate::quantity::Sensor;
use crate::triad::{Covariance, Triad};
use crate::warning::Warning;
pub use earth_on_table::EarthShare;
use least_squares::Scatter;

/// The mean of a dwell. If the input moves within the dwell, also another weighted sum over it, with weights that add to zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Index of the dwell it comes from.
    pub dwell: usize,
    /// Mean raw reading, or the sum of the raw readings.
    pub raw: Vector3<f64>,
    /// Variance of `raw` by the noise within dwells, raw units squared.
    pub variance: Vector3<f64>,
    /// The same of the known input in SI, for a gyro with the known part of the Earth's rate; not a number if only the magnitude of gravity is known.
    pub input: Vector3<f64>,
    /// The Earth's rate: its known part, which the input includes, and the rest.
    pub earth: EarthShare,
    /// The same of the rate of change of the true input, SI/s; zero if it is constant.
    pub change: Vector3<f64>,
}

impl Observation {
    /// The known input without the Earth's rate. It decides what an experiment determines: the Earth turns far too slowly for a scale factor.
    pub fn without_earth(&self) -> Self {
        Self {
            input: self.input - self.earth.known,
            ..*self
        }
    }
}

/// Delays of the readings of three axes behind the reference, s.
///
/// They come from filters of the sensor and from the clocks of table and converter. To first order both shift the time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delays {
    /// Estimates.
    pub value: Vector3<f64>,
    /// Standard deviations.
    pub sigma: Vector3<f64>,
}

/// The estimate of one triad.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimated {
    /// The calibration.
    pub triad: Triad,
    /// Scatter: by axis if the axes are fitted one by one, otherwise by group.
    pub scatter: Vec<(Observable, Scatter)>,
    /// Condition number of the scaled design.
    pub condition: f64,
    /// Delays of the readings, if moving inputs determine them.
    pub delays: Option<Delays>,
    /// The unknown numbers of the Earth's rate, if known inputs contain it: by heading, in standard deviations.
    pub earth: Vec<Vector3<f64>>,
    /// What a unit of error of each of the accelerometer's twelve parameters (C by rows, then o) adds to those of a gyro that was estimated with the
    /// accelerometer's directions.
    pub follows_accel: Option<Covariance>,
    /// What a person should know.
    pub notes: Vec<Warning>,
}

impl Estimated {
    /// Without delays, Earth and notes.
    pub fn new(triad: Triad, scatter: Vec<(Observable, Scatter)>, condition: f64) -> Self {
        Self {
            triad,
            scatter,
            condition,
            delays: None,
            earth: Vec::new(),
            follows_accel: None,
            notes: Vec::new(),
        }
    }

    /// Error of an observation with a known input, SI: its calibrated value, corrected for the delay, minus its input. `bias` is the sum of the
    /// weights: 1 for a mean, 0 for the other sums.
    pub fn error(&self, o: &Observation, bias: f64) -> Vector3<f64> {
        let behind = match &self.delays {
            Some(delays) => delays
                .value
                .component_mul(&(self.triad.forward.matrix * o.change)),
            None => Vector3::zeros(),
        };
        let inverse = &self.triad.inverse;
        let earth = self.earth.get(o.earth.heading);
        let input = o.input + earth.map_or_else(Vector3::zeros, |e| o.earth.by * e);
        inverse.matrix * (o.raw + behind) + inverse.offset * bias - input
    }
}

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// The experiment leaves parameters undetermined: their names, and what to add.
    Undetermined {
        /// Names of the parameters.
        parameters: String,
        /// What to add to the experiment.
        add: Addition,
    },
    /// The iteration did not converge or the result is singular: what was seen.
    NoSolution(String),
}

/// What has to be added to an experiment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Addition {
    /// Dwells with inputs along these axes.
    Inputs(String),
    /// Other additions, in words.
    Words(String),
}

impl Addition {
    /// What to add for `sensor`, as a sentence fragment. A level pose has a force along an axis and no rate about it.
    pub fn words(self, sensor: Sensor) -> String {
        let inputs = sensor.pick("rates", "forces");
        match self {
            Self::Inputs(axes) => {
                format!("add dwells with {inputs} along {axes}, in both directions")
            }
            Self::Words(words) => words,
        }
    }
}

impl From<String> for Addition {
    fn from(words: String) -> Self {
        Self::Words(words)
    }
}

impl From<&str> for Addition {
    fn from(words: &str) -> Self {
        Self::Words(words.into())
    }
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
    pub fn into_error(self, sensor: Sensor) -> mimu_recording::error::Error {
        let problem = self.problem();
        match self {
            Self::Undetermined { add, .. } => {
                mimu_recording::error::Error::undetermined(sensor, problem, add.words(sensor))
            }
            Self::NoSolution(_) => mimu_recording::error::Error::new(
                sensor,
                problem,
                "check the recording: wrong columns, wrong reference, or motion within dwells",
            ),
        }
    }
}
