//! Whether the calibration file with the effects found errs less on the other recordings of the unit than the file without them.
//!
//! The rows of another recording are fitted with separate biases and, if none is given, a separate matrix. These absorb errors that the
//! file does not correct: an effect whose affine part is wrong by a factor of a hundred passes that test, and fails this one.

use super::decision::{Accepted, Decision};
use super::rejected::{ErrorRms, Reason, Rejected};
use crate::calibration::Calibration;
use crate::calibration::verify::verify;
use crate::effects::fitted::FittedEffect;
use crate::effects::removal::remove;
use crate::fit::Fit;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};

/// Ratio of the error with the effects to that without them, above which the file is worse. Smaller differences are noise of the
/// recording.
const WORSE: f64 = 1.02;

/// Data to judge the file with effects.
pub(super) struct AsWritten<'a> {
    pub sensor: Sensor,
    /// The fit of the first recording before effects of this sensor are removed.
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

    /// If the file errs more on another recording with the effects, the effect that causes this, with the reason. `after` is the fit of
    /// the first recording without the effects of `decision`.
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
