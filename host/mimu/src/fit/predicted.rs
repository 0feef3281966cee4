//! Held-out errors of a fit and their predicted covariances, for [`crate::unseen`].

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector};

use crate::estimate::least_squares::{Errors, root};
use crate::estimate::{Estimated, Observation};
use crate::factor::Factors;
use crate::observation::turn::Turn;
use crate::quantity::Sensor;
use crate::triad::{Covariance, Triad};
use crate::unseen::Unseen;

/// Errors of `factors` by these calibrations, whose parameters have the covariance `root rootᵀ`.
pub(crate) fn unseen(
    factors: &Factors,
    models: &[(Sensor, &Affine<f64>)],
    root: &DMatrix<f64>,
) -> Unseen {
    let values = factors.values(models);
    let (at, noise) = (factors.at(&values), factors.variances(&values));
    Unseen::of(at.residuals, noise.into(), &at.jacobian, root)
}

/// Errors of magnitudes that are `known`, by a triad whose parameters have this `covariance`. `variances`: of the magnitudes by noise.
pub(crate) fn magnitudes<'a>(
    model: &Affine<f64>,
    covariance: &Covariance,
    known: impl Iterator<Item = (&'a Observation, f64)>,
    variances: Vec<f64>,
) -> Unseen {
    let mut factors = Factors::default();
    for ((o, size), variance) in known.zip(variances) {
        factors.magnitude(Sensor::Accel, (o.dwell, o.raw), (size, None), variance);
    }
    let models = [(Sensor::Accel, model)];
    unseen(&factors, &models, &root(&covariance.resize(12, 12, 0.0)))
}

/// How uncertain a gyro and an accelerometer are by what is known: of one, of the other, and how the gyro follows the accelerometer.
pub(crate) struct Both {
    /// Of the gyro: C by rows, then o.
    pub gyro: Covariance,
    /// Of the accelerometer.
    pub accel: Covariance,
    /// What a unit of error of each parameter of the accelerometer adds to those of the gyro.
    pub follows: Covariance,
}

impl Both {
    /// Of two triads of one fit.
    pub fn of(gyro: &Estimated, accel: &Triad) -> Self {
        Self {
            gyro: gyro.triad.known_covariance(),
            accel: accel.known_covariance(),
            follows: gyro.follows_accel.unwrap_or_else(Covariance::zeros),
        }
    }

    /// A root of the covariance of the twenty-four parameters.
    fn root(&self) -> DMatrix<f64> {
        let with = self.follows * self.accel;
        let full = DMatrix::from_fn(24, 24, |i, j| match (i < 12, j < 12) {
            (true, true) => self.gyro[(i, j)],
            (true, false) => with[(i, j - 12)],
            (false, true) => with[(j, i - 12)],
            (false, false) => self.accel[(i - 12, j - 12)],
        });
        root(&full)
    }
}

/// Errors of the directions after `turns`, two for each, by the gyro and the accelerometer.
pub(crate) fn directions(turns: &[Turn], [gyro, accel]: [&Affine<f64>; 2], of: &Both) -> Unseen {
    let factors = Factors::of_turns(turns);
    let models = [(Sensor::Gyro, gyro), (Sensor::Accel, accel)];
    unseen(&factors, &models, &of.root())
}

/// Readings of one axis that depend linearly on a few parameters, with their known errors, and how a fit weights them.
pub(crate) struct LinearAxis {
    /// Derivatives, a row for each reading.
    pub design: DMatrix<f64>,
    /// Known errors.
    pub errors: Errors,
    /// Extra variance of each that the fit found.
    pub extra: DVector<f64>,
}

impl LinearAxis {
    /// What the held-out `readings`, which differ by `errors` from what a fit to the others predicts, were predicted to differ by.
    ///
    /// Errors that held-out and other readings share are in both, so that most of them cancels.
    pub fn unseen(&self, errors: DVector<f64>, readings: &[usize]) -> Option<Unseen> {
        let others: Vec<usize> = (0..self.extra.len())
            .filter(|i| !readings.contains(i))
            .collect();
        let noise = self.errors.variances().select_rows(readings);
        let predicted = match &self.errors {
            Errors::Independent(variances) => self.independent(
                variances,
                &DMatrix::zeros(variances.len(), 0),
                readings,
                &others,
            )?,
            Errors::Shared(variances, factor) => {
                self.independent(variances, factor, readings, &others)?
            }
            Errors::Correlated(covariance) => {
                let of = |a: &[usize], b: &[usize]| covariance.select_rows(a).select_columns(b);
                let among = of(&others, &others);
                let weight = (&among + DMatrix::from_diagonal(&self.extra.select_rows(&others)))
                    .cholesky()?;
                let by = self.design.select_rows(&others);
                let weighted = weight.solve(&by);
                let gain = (by.tr_mul(&weighted))
                    .cholesky()?
                    .solve(&weighted.transpose());
                let through = self.design.select_rows(readings) * gain;
                let shared = &through * of(&others, readings);
                let full = of(readings, readings) - &shared - shared.transpose()
                    + &through * among * through.transpose();
                Errors::Correlated((&full + full.transpose()) * 0.5)
            }
        };
        Some(Unseen {
            errors,
            noise,
            predicted,
        })
    }

    /// The numbers that readings share, as columns of `factor`, are parameters of the fit of unit variance.
    fn independent(
        &self,
        variances: &DVector<f64>,
        factor: &DMatrix<f64>,
        readings: &[usize],
        others: &[usize],
    ) -> Option<Errors> {
        let (own, shared) = (self.design.ncols(), factor.ncols());
        let all = DMatrix::from_fn(self.design.nrows(), own + shared, |i, j| match j < own {
            true => self.design[(i, j)],
            false => factor[(i, j - own)],
        });
        let mut normal = DMatrix::zeros(own + shared, own + shared);
        let mut by_noise = DMatrix::zeros(own + shared, own + shared);
        for k in own..own + shared {
            normal[(k, k)] = 1.0;
            by_noise[(k, k)] = 1.0;
        }
        for i in others {
            let row = all.row(*i);
            let weight = (variances[*i] + self.extra[*i]).recip();
            let square = row.transpose() * row;
            normal += &square * weight;
            by_noise += square * (weight * weight * variances[*i]);
        }
        let inverse = normal.cholesky()?.inverse();
        let factor = root(&(&inverse * by_noise * &inverse));
        Some(Errors::Shared(
            variances.select_rows(readings),
            all.select_rows(readings) * factor,
        ))
    }
}
