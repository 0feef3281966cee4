//! Errors of dwells whose inputs have known magnitudes, in sample and held out: poses under gravity, and turns of a turntable.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::hold_out::{Refits, Split};
use super::predicted;
use super::sensor::Residual;
use crate::estimate::{Estimated, Observation};
use crate::observation::magnitude::Magnitude;
use crate::triad::{Covariance, Triad};
use crate::unseen::Unseen;

/// Dwells with their magnitudes, SI.
pub(super) struct Magnitudes<'a>(pub Vec<(&'a Observation, f64)>);

/// The part of a dwell, in a split.
pub(super) type PartOf<'a> = &'a dyn Fn(Split, usize) -> usize;

fn error(triad: &Triad, o: &Observation, size: f64) -> Vector3<f64> {
    let off = Magnitude::at(&triad.inverse, &o.raw, size).residual();
    Vector3::new(off, 0.0, 0.0)
}

impl<'a> Magnitudes<'a> {
    /// Errors by `triad`; `floors` by noise alone.
    pub fn residuals(&self, triad: &Triad, floors: &[f64]) -> Vec<Residual> {
        let each = self.0.iter().zip(floors);
        let residual = |((o, size), floor): (&(&Observation, f64), &f64)| Residual {
            dwell: o.dwell,
            within: false,
            value: error(triad, o, *size),
            held_out: None,
            floor: *floor,
        };
        each.map(residual).collect()
    }

    /// Those of a part.
    pub fn of_part(
        &self,
        (split, part): (Split, usize),
        part_of: PartOf,
    ) -> impl Iterator<Item = (&'a Observation, f64)> {
        let own = self.0.iter().copied();
        own.filter(move |(o, _)| part_of(split, o.dwell) == part)
    }

    /// Adds the held-out errors to the `residuals`.
    pub fn hold_out(
        &self,
        residuals: &mut [Residual],
        refits: &Refits<Estimated>,
        part_of: PartOf,
    ) {
        for (residual, (o, size)) in residuals.iter_mut().zip(&self.0) {
            let refit = refits.without(part_of(refits.split, o.dwell));
            residual.held_out = refit.map(|refit| error(&refit.triad, o, *size));
        }
    }

    /// The held-out errors with what is predicted of them, if the parameters of a refit have this `covariance` and its magnitudes these `variances` by noise.
    pub fn unseen(
        &self,
        refits: &Refits<Estimated>,
        part_of: PartOf,
        covariance: impl Fn(&Triad) -> Covariance,
        variances: impl Fn(&Affine<f64>, &[Observation]) -> Vec<f64>,
    ) -> Vec<Unseen> {
        refits.unseen(|part, refit| {
            let own = || self.of_part((refits.split, part), part_of);
            let observations: Vec<Observation> = own().map(|(o, _)| *o).collect();
            let model = &refit.triad.inverse;
            let noise = variances(model, &observations);
            predicted::magnitudes(model, &covariance(&refit.triad), own(), noise)
        })
    }
}
