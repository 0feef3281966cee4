//! Whether the calibration file with the effects found errs less on the other recordings of the unit than the file without them.
//!
//! Rows of another recording are fitted with biases, and where nothing else is known with a matrix, of their own. What a fit absorbs there
//! a file does not: an effect of which the affine part is wrong by a hundred times passes the one and not the other.

use super::decision::{Accepted, Decision};
use super::rejected::{ErrorRms, Reason, Rejected};
use crate::calibration::Calibration;
use crate::calibration::verify::verify;
use crate::effects::fitted::FittedEffect;
use crate::effects::removal::remove;
use crate::fit::Fit;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};

/// Ratio of the errors with the effects and without from which on the file is worse: below it they differ by the noise of the recording.
const WORSE: f64 = 1.02;

/// What the file with effects is judged by.
pub(super) struct AsWritten<'a> {
    pub sensor: Sensor,
    /// The fit of the first recording without the effects of this sensor.
    pub before: &'a Fit,
    /// The other recordings, likewise.
    pub others: &'a [Prepared],
    pub calibrate: &'a dyn Fn(Prepared) -> mimu_recording::error::Result<Fit>,
}

impl AsWritten<'_> {
    /// Error of the sensor in `recording` by the calibration file of `fit` and `effects`.
    fn error(
        &self,
        recording: &Prepared,
        fit: &Fit,
        effects: &[FittedEffect],
    ) -> Option<(Figure, f64)> {
        let file = Calibration::of(fit, effects, "").ok()?;
        let judged = verify(recording, &file).ok()?;
        let sensor = judged.sensors[self.sensor].as_ref()?;
        Some((sensor.figure, sensor.rms))
    }

    /// The effect that makes the file worse for another recording, and the reason; `after` is the fit of the first without the effects of
    /// `decision`.
    pub fn worst(&self, after: &Fit, decision: &Decision) -> Option<Rejected> {
        let lasting: Vec<&Accepted> = decision.accepted.iter().filter(|a| a.of_unit).collect();
        let effects = |of: &[&Accepted]| -> Vec<FittedEffect> {
            of.iter().map(|a| a.effect.clone()).collect()
        };
        let all = effects(&lasting);
        let worse = self.others.iter().find_map(|recording| {
            let (figure, before) = self.error(recording, self.before, &[])?;
            let (_, after) = self.error(recording, after, &all)?;
            // A file whose error is not finite counts as worse.
            (!(after <= WORSE * before)).then_some((recording, figure, [before, after]))
        });
        let (recording, figure, both) = worse?;
        let without = |k: usize| {
            let mut rest = lasting.clone();
            rest.remove(k);
            let rest = effects(&rest);
            let [gyro, accel] =
                Sensor::BOTH.map(|s| Some(self.before.sensor(s)?.estimated.triad.inverse));
            let first = &self.before.prepared;
            let clean = remove(first, gyro.as_ref(), accel.as_ref(), &rest)?;
            let fit = (self.calibrate)(clean).ok()?;
            Some(self.error(recording, &fit, &rest)?.1)
        };
        let each = (0..lasting.len()).map(|k| (k, without(k).unwrap_or(f64::INFINITY)));
        let (culprit, _) = each.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let errors = both.map(|rms| ErrorRms {
            figure,
            sensor: self.sensor,
            rms,
        });
        Some(Rejected {
            id: lasting[culprit].chosen.candidate.id(),
            sensor: self.sensor,
            reason: Reason::FileErrsMore(recording.place.clone(), errors),
        })
    }
}
