//! Held-out errors of a fit and their predicted covariances, for [`crate::unseen`].

use nalgebra::{DMatrix, DVector};

use crate::estimate::least_squares::{Errors, root};
use crate::unseen::Unseen;

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
