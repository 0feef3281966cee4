//! The errors of a fit: in sample, and held out by fits without a part of the dwells.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::hold_out::{HoldOut, Refits, Split, determined};
use super::sensor::{Residual, typical};
use crate::estimate::{Estimated, Failure};
use crate::judging::{Both, Judging, Models, rms};
use crate::observation::ByTriad;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use crate::triad::Triad;
use crate::unseen::Unseen;
use mimu_recording::error::Error;

/// The parts of a recording: how many, and which a dwell belongs to.
#[derive(Clone, Copy)]
pub(super) struct Parts {
    pub count: usize,
    dwells: usize,
}

impl Parts {
    /// So many parts of so many dwells.
    pub fn new(count: usize, dwells: usize) -> Self {
        Self { count, dwells }
    }

    /// The part of a dwell.
    pub fn of(&self, split: Split, dwell: usize) -> usize {
        split.part(dwell, self.dwells, self.count)
    }
}

/// A fit without a part of the dwells.
pub(super) struct Refit {
    /// Its calibrations.
    pub models: Models,
    triad: Triad,
    both: Both,
    /// Errors of the parameters that the left-out dwells share, by one standard deviation: nothing is judged by it.
    common: ByTriad,
}

impl Refit {
    /// Of one triad; `common` as above.
    pub fn of_one(sensor: Sensor, triad: Triad, common: ByTriad) -> Self {
        let covariance = triad.known_covariance() - common * common.transpose();
        let mut models = Models::default();
        models[sensor] = Some(triad.inverse);
        Self {
            both: Both::of_one(sensor, covariance),
            models,
            triad,
            common,
        }
    }

    /// Of a gyro and the accelerometer whose directions it takes.
    pub fn of_both(gyro: Estimated, accel: &Triad) -> Self {
        Self {
            models: Models {
                gyro: Some(gyro.triad.inverse),
                accel: Some(accel.inverse),
            },
            both: Both::of(&gyro, accel),
            triad: gyro.triad,
            common: ByTriad::zeros(),
        }
    }

    /// Variance by the parameters of an error with these derivatives.
    fn open(&self, by: &[ByTriad]) -> f64 {
        let variance = |by: &ByTriad| self.triad.variance(by) - by.dot(&self.common).powi(2);
        by.iter().map(variance).sum::<f64>().max(0.0)
    }
}

/// The errors of a fit, in sample and held out.
pub(super) struct Judged {
    pub figure: Figure,
    pub residuals: Vec<Residual>,
    /// Number of dwells used.
    pub dwells: usize,
    pub static_rms: Option<(f64, Option<f64>)>,
    pub held_out: HoldOut,
    pub unseen: Vec<Unseen>,
    pub uncalibrated_rms: Option<f64>,
}

/// The errors of a fit in sample.
pub(super) struct InSample<'a> {
    prepared: &'a Prepared,
    with: With<'a>,
    judging: Judging<'a>,
    models: Models,
    pub errors: Errors,
}

/// What judges by given models, with their noise.
type With<'a> = &'a dyn Fn(&Models) -> Option<Judging<'a>>;

/// Errors in sample, by which refits are checked, side by side.
pub(super) struct Errors {
    of: (Figure, Sensor),
    parts: Parts,
    residuals: Vec<Residual>,
    /// Derivatives of each.
    by: Vec<Vec<ByTriad>>,
    /// Their rms or, if larger, that by noise alone.
    pub typical: f64,
}

impl Errors {
    /// Refuses a refit that does not determine the errors of its part.
    pub fn checked(&self, refit: Refit, split: Split, part: usize) -> Result<Refit, Failure> {
        let own = self.residuals.iter().zip(&self.by);
        let own = own.filter(|(r, _)| self.parts.of(split, r.dwell) == part);
        determined(own.map(|(_, by)| refit.open(by)), self.typical, self.of)?;
        Ok(refit)
    }
}

impl<'a> InSample<'a> {
    /// By the `models` of the fit.
    ///
    /// # Errors
    /// Nothing judges them.
    pub fn of(
        prepared: &'a Prepared,
        sensor: Sensor,
        with: With<'a>,
        models: Models,
        parts: Parts,
    ) -> Result<Self, Error> {
        let seen = "the fit does not give back what it was fitted to";
        let lost = || prepared.refused(Failure::NoSolution(seen.into()), sensor);
        Self::by(prepared, with, models, parts).ok_or_else(lost)
    }

    fn by(prepared: &'a Prepared, with: With<'a>, models: Models, parts: Parts) -> Option<Self> {
        let judging = with(&models)?;
        let errors = judging.errors(&models)?.into_iter();
        let each = errors.zip(judging.floors(&models)?).zip(judging.dwells());
        let residuals: Vec<Residual> = each
            .map(|((value, floor), dwell)| Residual {
                dwell,
                within: false,
                value,
                held_out: None,
                floor,
            })
            .collect();
        let errors = Errors {
            of: (judging.figure, judging.sensor),
            parts,
            by: judging.derivatives(&models)?,
            typical: typical(judging.figure, &residuals),
            residuals,
        };
        Some(Self {
            prepared,
            with,
            judging,
            models,
            errors,
        })
    }

    /// The errors with those of data that were held out, by a `refit` without each part.
    pub fn held_out(
        &self,
        refit: impl Fn(Split, usize) -> Result<Refit, Failure> + Sync + Send,
    ) -> Judged {
        let (judging, parts) = (&self.judging, self.errors.parts);
        let held = Refits::of(parts.count, refit);
        let part = |dwell: usize| parts.of(held.split, dwell);
        let mut residuals = self.errors.residuals.clone();
        let mut unseen = Vec::new();
        for (number, refit) in held.refits.iter().enumerate() {
            let Ok(refit) = refit else { continue };
            let errors = judging.errors(&refit.models).into_iter().flatten();
            let own = residuals.iter_mut().zip(errors);
            for (residual, error) in own.filter(|(r, _)| part(r.dwell) == number) {
                residual.held_out = Some(error);
            }
            let of = |judging: &Judging| {
                let is_own = |dwell| part(dwell) == number;
                judging.unseen(&refit.models, &refit.both, is_own)
            };
            unseen.extend(match judging.figure {
                Figure::Direction => of(judging),
                _ => (self.with)(&refit.models).as_ref().and_then(of),
            });
        }
        let rests = judging.rests.iter().filter_map(|rest| {
            let refit = held.without(part(rest.dwell))?;
            Some(refit.models.gyro?.apply(&rest.raw) - rest.rate)
        });
        let rests: Vec<Vector3<f64>> = rests.collect();
        let held_at_rest = (!rests.is_empty()).then(|| rms(Figure::Input, rests.into_iter()));
        let at_rest = self.models.gyro.and_then(|gyro| judging.at_rest(&gyro));
        let in_si = self.prepared.is_in_si();
        let one = Models::both(Some(Affine::identity()));
        let uncalibrated = || Some(judging.rms(&judging.errors(&one)?));
        Judged {
            figure: judging.figure,
            dwells: match judging.figure {
                Figure::Direction => judging.rests.len(),
                _ => residuals.len() + judging.rests.len(),
            },
            residuals,
            static_rms: at_rest.map(|rms| (rms, held_at_rest)),
            unseen,
            uncalibrated_rms: in_si.then(uncalibrated).flatten(),
            held_out: held.into(),
        }
    }
}
