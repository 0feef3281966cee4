//! One triad of all calibrations: units, population, and what each measurement is compared with.

use mimu::nalgebra::DMatrix;
use mimu::quantity::Sensor;
use mimu::sessions::between::Estimates;
use mimu_recording::{NORMAL_95, Reference};

use crate::measured::Basis;
use crate::population::{self, Population};
use crate::repeats::Repeats;
use crate::result::{Histogram, ParameterOfFleet, TriadOfFleet};
use crate::tree::Measurement;

/// The measurements of one triad.
pub struct Estimated {
    /// Units of its parameters.
    pub basis: Basis,
    /// Estimates of each measurement; `None` without this triad.
    pub estimates: Vec<Option<Estimates>>,
}

impl Estimated {
    /// Those of `sensor`. `None` if no measurement has it.
    pub fn of(sensor: Sensor, reference: Option<Reference>, all: &[Measurement]) -> Option<Self> {
        let physical: Vec<_> = all.iter().map(|m| m.of.triads[sensor]).collect();
        let basis = Basis::of(sensor, reference, &physical)?;
        let each = physical.iter();
        let estimates = each.map(|p| p.as_ref().map(|p| basis.estimates(p)));
        Some(Self {
            estimates: estimates.collect(),
            basis,
        })
    }

    /// Number of parameters.
    pub fn n(&self) -> usize {
        self.basis.free.len()
    }
}

/// One triad of the fleet.
pub struct Triad {
    /// Units of its parameters.
    pub basis: Basis,
    /// Estimates of each measurement; `None` without this triad.
    pub estimates: Vec<Option<Estimates>>,
    /// Repeated measurements.
    pub repeats: Repeats,
    /// Population of the units of [`Repeats::units`].
    pub population: Population,
    /// Typical covariance of a fit.
    pub fit: DMatrix<f64>,
}

/// Bins of a histogram, over this many standard deviations on both sides of the mean.
const BINS: usize = 41;
const SIGMAS: f64 = 5.125;

impl Triad {
    /// The triad by its measurements of these units. `None` if too few have it, or if a covariance is singular.
    pub fn of(estimated: Estimated, units: &[Vec<usize>]) -> Option<Self> {
        let Estimated { basis, estimates } = estimated;
        let repeats = Repeats::of(&estimates, units)?;
        let population = population::fit(&repeats.estimates, None)?;
        let n = basis.free.len();
        let fit = DMatrix::from_fn(n, n, |i, j| {
            let mut sum: Vec<f64> = estimates
                .iter()
                .flatten()
                .map(|e| e.covariance[(i, j)])
                .collect();
            crate::robust::median(&mut sum)
        });
        Some(Self {
            basis,
            estimates,
            repeats,
            population,
            fit,
        })
    }

    /// Number of parameters.
    pub fn n(&self) -> usize {
        self.basis.free.len()
    }

    /// Covariance of a measurement about the mean of the population.
    pub fn of_one(&self) -> DMatrix<f64> {
        let within = self.repeats.within.clone();
        let n = self.n();
        // Medians of covariances need not be a covariance; their diagonal is.
        let fit = DMatrix::from_diagonal(&self.fit.diagonal());
        &self.population.covariance + fit + within.unwrap_or_else(|| DMatrix::zeros(n, n))
    }

    /// As in the result.
    pub fn result(&self) -> TriadOfFleet {
        let used = self.population.used.iter().filter(|u| **u).count();
        let rows = |m: &DMatrix<f64>| m.row_iter().map(|r| r.iter().copied().collect()).collect();
        TriadOfFleet {
            units: self.repeats.units.len(),
            used,
            jointly: self.population.jointly,
            scale: self.basis.scale,
            parameters: (0..self.n()).map(|i| self.parameter(i)).collect(),
            covariance: rows(&self.population.covariance),
            mean_covariance: rows(&self.population.mean_covariance),
        }
    }

    fn parameter(&self, i: usize) -> ParameterOfFleet {
        let population = &self.population;
        let within = self.repeats.within.as_ref().map(|w| w[(i, i)].sqrt());
        let mean = population.mean[i];
        let sigma = self.of_one()[(i, i)].sqrt();
        let width = 2.0 * SIGMAS * sigma / BINS as f64;
        let from = mean - SIGMAS * sigma;
        let mut counts = vec![0; BINS];
        for unit in &self.repeats.estimates {
            let bin = (unit.values[i] - from) / width;
            if (0.0..BINS as f64).contains(&bin) {
                counts[bin as usize] += 1;
            }
        }
        ParameterOfFleet {
            name: self.basis.parameter(i).to_string(),
            unit: self.basis.unit(i),
            mean,
            half_width: NORMAL_95 * population.mean_covariance[(i, i)].sqrt(),
            sigma: population.covariance[(i, i)].sqrt(),
            fit_sigma: self.fit[(i, i)].sqrt(),
            within_sigma: within,
            histogram: Histogram {
                from,
                width,
                counts,
            },
        }
    }
}
