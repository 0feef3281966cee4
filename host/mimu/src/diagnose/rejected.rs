//! Rejected effects. The reason is a type; only its display is a sentence.

use std::fmt;

use mimu_recording::error::Error;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use super::rows::Rows;
use crate::quantity::{Figure, Sensor, p_value, significant};

/// An effect that was tried and not accepted.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// Public id.
    pub id: String,
    /// Sensor whose readings would err.
    pub sensor: Sensor,
    /// Why not.
    pub reason: Reason,
}

impl Serialize for Rejected {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("Rejected", 4)?;
        out.serialize_field("id", &self.id)?;
        out.serialize_field("sensor", &self.sensor)?;
        out.serialize_field("reason", &self.reason.to_string())?;
        let reason_id: &'static str = (&self.reason).into();
        out.serialize_field("reason_id", reason_id)?;
        out.end()
    }
}

/// Why an effect is not accepted. JSON has the name, as `turns_err_more`, and the sentence. The first figure of a pair is without the effect, the second
/// with it.
#[derive(Debug, Clone, PartialEq, strum::IntoStaticStr, thiserror::Error)]
#[strum(serialize_all = "snake_case")]
pub enum Reason {
    /// One dwell contains this share of its information.
    #[error("one dwell contains {:.0} % of its information", 100.0 * .0)]
    OneDwell(f64),
    /// The held-out error does not go down.
    #[error("the held-out error does not go down: {} without, {} with", .0[0], .0[1])]
    HeldOut([ErrorRms; 2]),
    /// The error of the second recording does not go down: chi-squares, and rms.
    #[error("the error on the second recording does not go down: chi-square {:.0} without, {:.0} with; rms {} and {}", .0[0], .0[1], .1[0], .1[1])]
    SecondRecording([f64; 2], [ErrorRms; 2]),
    /// Number of held-out parts whose error goes down, and number of those whose error goes up.
    #[error("the held-out error goes down in {0} of the parts, and up in {1}")]
    Parts(usize, usize),
    /// The data without one block do not determine it.
    #[error("the data without one block do not determine it")]
    UndeterminedWithoutBlock,
    /// It fits the noise: the residual in units of the noise.
    #[error("it fits the noise: without it the residual is {} times the noise, with it {} times", significant(.0[0]), significant(.0[1]))]
    FitsNoise([f64; 2]),
    /// One dwell and those in its pose contain the evidence: the probability by chance without them.
    #[error("its evidence depends on one dwell and those in the same pose: without them, {}", p_value(*.0))]
    LostWithDwell(f64),
    /// It lowers the held-out error, but has no known physics, and no second recording confirms it: the probability by
    /// chance.
    #[error("{}, and it lowers the held-out error, but no known physics explains it: a suggestion. Confirm it by a second recording that shows it", p_value(*.0))]
    Suggestion(f64),
    /// A bias that walks at random explains the rows as well: the probability by chance beside such a walk.
    #[error("a bias that wanders at random explains the residuals as well: beside such a bias, {}", if *.0 > CHANCE { "it is no better than chance".into() } else { p_value(*.0) })]
    RandomWalk(f64),
    /// It was not chosen in the search.
    #[error("{0}")]
    NotChosen(NotChosen),
    /// The calibration file with it errs more on this recording, whose biases are free.
    #[error("the calibration file with it has a larger error on {}: {} without effects, {} with them", .0, .1[0], .1[1])]
    FileErrsMore(String, [ErrorRms; 2]),
    /// With it the directions of gravity after held-out turns err more.
    #[error("the directions of gravity after held-out turns err more with it: {} without, {} with", .0[0], .0[1])]
    TurnsErrMore([ErrorRms; 2]),
    /// Without it another effect predicts better.
    #[error("another effect predicts better, together with the calibration that then results")]
    OtherPredictsBetter,
    /// Readings without it cannot be calibrated.
    #[error("after its removal the readings cannot be calibrated: {}", .0.refused().problem)]
    NotCalibrated(Error),
}

/// An effect that the search did not choose, or gave up.
#[derive(Debug, Clone, PartialEq)]
pub struct NotChosen {
    /// Probability by chance beside the chosen effects.
    pub p: f64,
    /// Why it was not chosen although it is significant now; `None` if it is not.
    pub why: Option<Passed>,
}

/// Why an effect that is significant was not chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passed {
    /// Others explained the same, and it was given up.
    GivenUp,
    /// So many effects were found before it, and the search stops there.
    Enough(usize),
    /// It was not significant beside what was sought at first.
    NotAtFirst,
}

/// An error of a sensor, rms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorRms {
    /// Quantity.
    pub figure: Figure,
    /// Sensor.
    pub sensor: Sensor,
    /// Value, unit of the figure.
    pub rms: f64,
}

/// Probability by chance above which an effect is rejected.
const CHANCE: f64 = 0.5;

impl fmt::Display for NotChosen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.p > CHANCE {
            true => f.write_str("no better than chance")?,
            false => f.write_str(&p_value(self.p))?,
        }
        match self.why {
            Some(Passed::GivenUp) => {
                f.write_str(", but it was found first and dropped when others explained the same")?;
            }
            Some(Passed::Enough(count)) => write!(
                f,
                ", but {count} effects of the sensor were found before it, and the search stops there"
            )?,
            Some(Passed::NotAtFirst) => {
                f.write_str(", but it was not significant among all that were tried first")?;
            }
            None => {}
        }
        Ok(())
    }
}

impl ErrorRms {
    /// Of the judged `rows`.
    pub(super) fn of(rows: &Rows, rms: f64) -> Self {
        Self {
            figure: rows.observable.figure(),
            sensor: rows.sensor,
            rms,
        }
    }
}

impl fmt::Display for ErrorRms {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (factor, unit) = self.figure.readable(self.sensor);
        match self.rms.is_finite() {
            true => write!(f, "{} {unit}", significant(self.rms * factor)),
            false => f.write_str("nothing that can be named"),
        }
    }
}
