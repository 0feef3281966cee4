//! Whether the calibration file with the effects found errs more than the file without them: on the other recordings of the unit, and for an
//! accelerometer by hand also after the turns of the recording itself.
//!
//! The search fits the rows of another recording with a separate matrix, which absorbs errors that the file does not correct: an effect whose affine
//! part is wrong by a factor of a hundred passes that test, and fails this one. Here the matrix is that of the file. The biases are those of the
//! recording, because every power-on changes them: a g-sensitivity of 0.03 deg/s/g, planted in two sessions of two units of an array, was found with
//! p < 1e-6 and refused for turns on the second that the biases of the first took from 0.277 to 0.284 and from 0.272 to 0.287 deg.
//!
//! Each kind of observation that the effects change is judged separately. The magnitude of specific force shows one number of a nonlinearity in three;
//! where it falls from 8.4 to 1.7 mm/s², the directions of gravity may err more, and turns show these.

use mimu_core::compensation::Affine;
use nalgebra::{DVector, Vector3};

use super::Calibrator;
use super::columns::basis;
use super::decision::{Accepted, Decision};
use super::rejected::{ErrorRms, Reason, Rejected};
use super::rows::{FreeParameters, Rows, Session};
use super::variance::{Components, LikelihoodKind, VarianceModel};
use crate::calibration::Calibration;
use crate::effects::fitted::FittedEffect;
use crate::effects::removal::{remove, remove_within};
use crate::fit::{Fit, SensorFit};
use crate::observable::Observable;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use mimu_recording::Reference;

/// If the effects change the residuals of a kind of observation by fewer sigmas than this, it does not judge them.
const SHOWS: f64 = 3.0;
/// Growth of the error in sample above which coefficients are wrong: the true ones lower it.
const GROWS: f64 = 1.02;
/// Growth of the errors, in standard deviations of its noise, above which the file with effects is worse: one in twenty if both files err alike. With
/// the true effect the growth is negative by half the change of the residuals, so that fewer than one in a thousand is refused.
const BEYOND_CHANCE: f64 = 1.645;

/// Data to judge the file with effects.
pub(super) struct AsWritten<'a> {
    pub sensor: Sensor,
    /// The fit of the first recording before effects of this sensor are removed.
    pub before: &'a Fit,
    /// The other recordings, likewise.
    pub others: &'a [Prepared],
    pub calibrator: &'a Calibrator<'a>,
}

/// How the errors of one kind of observation change from the file without effects to that with them.
struct Change {
    /// The other recording; `None` for held-out turns of the first.
    recording: Option<String>,
    errors: [ErrorRms; 2],
    /// Growth of the sum of squares over its standard deviation by noise. Infinite if an error is not finite.
    growth: f64,
}

impl Change {
    /// From decorrelated residuals of unit variance; `None` if they hardly differ.
    fn of(
        recording: Option<String>,
        errors: [ErrorRms; 2],
        [without, with]: [&DVector<f64>; 2],
    ) -> Option<Self> {
        let change = (with - without).norm();
        let growth = (with.norm_squared() - without.norm_squared()) / (2.0 * change);
        let growth = if growth.is_finite() {
            growth
        } else {
            f64::INFINITY
        };
        (!(change <= SHOWS)).then_some(Self {
            recording,
            errors,
            growth,
        })
    }

    fn reason(self) -> Reason {
        match self.recording {
            Some(recording) => Reason::FileErrsMore(recording, self.errors),
            None => Reason::TurnsErrMore(self.errors),
        }
    }
}

/// Calibrations of gyro and accelerometer, raw to SI.
fn models(fit: &Fit) -> [Option<Affine<f64>>; 2] {
    Sensor::BOTH.map(|s| Some(fit.sensor(s)?.estimated.triad.inverse))
}

/// Residuals with the biases fitted, at these components.
fn left(rows: &Rows, at: &Components) -> Option<DVector<f64>> {
    let model = basis(&rows.nuisance);
    let fitted = VarianceModel::new(rows, false).fit_at(&model, at)?;
    Some(&rows.y - model * fitted.coefficients)
}

/// The variance components of the file that leaves less.
fn least(both: [&Rows; 2]) -> Option<Components> {
    let [a, b] = both.map(|rows| {
        let variance = VarianceModel::new(rows, false);
        let model = basis(&rows.nuisance);
        Some(
            variance
                .fit(&model, &variance.none(), LikelihoodKind::Likelihood)?
                .components,
        )
    });
    let (a, b) = (a?, b?);
    let least = |(a, b): (&[f64; 2], &[f64; 2])| [a[0].min(b[0]), a[1].min(b[1])];
    Some(a.iter().zip(&b).map(least).collect())
}

/// The changes of each kind of row from the first of `both` to the second.
fn changes(both: [&Rows; 2], recording: &str) -> Option<Vec<Change>> {
    let [without, with] = both;
    let at = least(both)?;
    let plain = [left(without, &at)?, left(with, &at)?];
    let variance = VarianceModel::new(without, false);
    let whitener = variance.whitener(&at)?;
    let white = plain.each_ref().map(|left| whitener.vector(left));
    let kinds = [Figure::Direction, Figure::GravityMagnitude, Figure::Input];
    let changes = kinds.into_iter().filter_map(|kind| {
        let ours = || {
            without
                .strata
                .iter()
                .filter(move |s| s.name.0.figure() == kind)
        };
        let errors = plain.each_ref().map(|left| {
            let squares = |(name, r): (Observable, f64)| r * r * name.components() as f64;
            let each = ours().flat_map(|s| s.rows.clone().map(|r| (s.name.0, left[r])));
            let count = ours().map(|s| s.rows.len()).sum::<usize>() as f64;
            ErrorRms {
                figure: kind,
                sensor: without.sensor,
                rms: (each.map(squares).sum::<f64>() / count).sqrt(),
            }
        });
        let rows: Vec<usize> = ours().flat_map(|s| s.rows.clone()).collect();
        let [a, b] = white
            .each_ref()
            .map(|white| DVector::from_iterator(rows.len(), rows.iter().map(|r| white[*r])));
        (!rows.is_empty())
            .then(|| Change::of(Some(recording.into()), errors, [&a, &b]))
            .flatten()
    });
    Some(changes.collect())
}

/// The change of the directions after held-out turns, between two fits of one recording; `None` without such turns.
fn change_of_turns(both: [&Fit; 2]) -> Option<Change> {
    let turns = both.map(|fit| {
        fit.sensor(Sensor::Gyro)
            .filter(|s| s.figure == Figure::Direction)
    });
    let [Some(without), Some(with)] = turns else {
        return None;
    };
    let of = |fit: &SensorFit, dwell: usize| {
        let mut all = fit.residuals.iter();
        all.find(|r| r.dwell == dwell)?.held_out
    };
    let ends = without.residuals.iter().map(|r| r.dwell);
    let pairs: Vec<[Vector3<f64>; 2]> = ends
        .filter_map(|dwell| Some([of(without, dwell)?, of(with, dwell)?]))
        .collect();
    let count = pairs.len() as f64;
    let errors = [0, 1].map(|k| {
        let squares: f64 = pairs.iter().map(|p| p[k].norm_squared()).sum();
        ErrorRms {
            figure: Figure::Direction,
            sensor: Sensor::Gyro,
            rms: (squares / count).sqrt(),
        }
    });
    // A direction has two components.
    let sigma = errors[0].rms.min(errors[1].rms) / 2f64.sqrt();
    let [a, b] = [0, 1].map(|k| {
        let all = pairs.iter().flat_map(|p| <[f64; 3]>::from(p[k] / sigma));
        DVector::from_iterator(3 * pairs.len(), all)
    });
    (!pairs.is_empty())
        .then(|| Change::of(None, errors, [&a, &b]))
        .flatten()
}

impl AsWritten<'_> {
    /// The rows of `of` in `recording` by the file of `fit` and `effects`, with the biases free.
    fn rows(
        &self,
        recording: &Prepared,
        fit: &Fit,
        effects: &[FittedEffect],
        of: Sensor,
    ) -> Option<Rows> {
        let models = models(fit);
        let file = Calibration::of(fit, effects, "").ok()?;
        let session = Session::later(recording, &models);
        let [gyro, accel] = [session.gyro.as_ref(), session.accel.as_ref()];
        let clean = remove_within(recording, gyro, accel, file.effects(), file.limits())?;
        Rows::of(
            &[Session::later(&clean, &models)],
            of,
            FreeParameters::Bias(None),
        )
    }

    /// How the errors change with the file of `after` and `effects`.
    fn changes(&self, after: &Fit, effects: &[FittedEffect]) -> Vec<Change> {
        let mut all = Vec::new();
        let by_hand = |p: &Prepared| p.manifest.reference == Reference::Gravity;
        for recording in self.others {
            // The directions that turns are judged by are those of the accelerometer.
            let by_turns = self.sensor == Sensor::Accel && by_hand(recording);
            let of: &[Sensor] = match by_turns {
                true => &[Sensor::Accel, Sensor::Gyro],
                false => &[self.sensor],
            };
            for of in of {
                let without = self.rows(recording, self.before, &[], *of);
                let with = self.rows(recording, after, effects, *of);
                if let (Some(without), Some(with)) = (without, with)
                    && without.y.len() == with.y.len()
                {
                    let found = changes([&without, &with], &recording.place);
                    let judged =
                        |c: &Change| *of == self.sensor || c.errors[0].figure == Figure::Direction;
                    all.extend(found.into_iter().flatten().filter(judged));
                }
            }
        }
        if self.sensor == Sensor::Accel && by_hand(&self.before.prepared) {
            let fits =
                [self.before, after].map(|fit| self.calibrator.judged(fit.prepared.clone()).ok());
            if let [Some(without), Some(with)] = &fits {
                all.extend(change_of_turns([without, with]));
            }
        }
        all
    }

    /// The change in the recording that the effects come from, if its errors grow: with free biases and a walk of them, coefficients that twelve dwells leave
    /// open passed for a bias, while they took the error of a fibre gyro from 6.3e-5 to 3.4e-4 deg/s.
    fn change_in_sample(&self, after: &Fit) -> Option<Change> {
        let error = |fit: &Fit| {
            let own = fit.sensor(self.sensor)?;
            Some(ErrorRms {
                figure: own.figure,
                sensor: self.sensor,
                rms: own.rms(),
            })
        };
        let errors = [error(self.before)?, error(after)?];
        (errors[1].rms > GROWS * errors[0].rms).then(|| Change {
            recording: Some(self.before.prepared.place.clone()),
            errors,
            growth: f64::INFINITY,
        })
    }

    fn worst_change(&self, after: &Fit, effects: &[FittedEffect]) -> Option<Change> {
        let all = self.changes(after, effects).into_iter();
        let all = all.chain(self.change_in_sample(after));
        all.max_by(|a, b| a.growth.total_cmp(&b.growth))
    }

    /// If the file errs more with the effects, the effect that causes this, with the reason. `after` is the fit of the first recording without the
    /// effects of `decision`.
    pub fn worst(&self, after: &Fit, decision: &Decision) -> Option<Rejected> {
        let lasting: Vec<&Accepted> = decision.accepted.iter().filter(|a| a.of_unit).collect();
        let effects = |of: &[&Accepted]| -> Vec<FittedEffect> {
            of.iter().map(|a| a.effect.clone()).collect()
        };
        if lasting.is_empty() {
            return None;
        }
        let worse = self.worst_change(after, &effects(&lasting))?;
        if worse.growth <= BEYOND_CHANCE {
            return None;
        }
        let without = |k: usize| {
            let mut rest = lasting.clone();
            rest.remove(k);
            let rest = effects(&rest);
            let [gyro, accel] = models(self.before);
            let first = &self.before.prepared;
            let clean = remove(first, gyro.as_ref(), accel.as_ref(), &rest)?;
            let fit = self.calibrator.calibrate(clean).ok()?;
            Some(
                self.worst_change(&fit, &rest)
                    .map_or(f64::NEG_INFINITY, |c| c.growth),
            )
        };
        let each = (0..lasting.len()).map(|k| (k, without(k).unwrap_or(f64::INFINITY)));
        let (culprit, _) = each.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Rejected {
            id: lasting[culprit].chosen.candidate.id(),
            sensor: self.sensor,
            reason: worse.reason(),
        })
    }
}
