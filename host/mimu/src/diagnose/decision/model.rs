//! A fitted model of the rows, kept so that plots show what was decided on.

use nalgebra::{DMatrix, DVector};

use super::hold_out::held_out;
use crate::diagnose::search::{Chosen, Search};
use crate::diagnose::variance::{Fitted, LikelihoodKind};
use crate::fit::Split;

/// Affine parameters and effects, fitted.
#[derive(Debug, Clone)]
pub struct Model {
    /// Columns of the affine parameters, then of the effects; SI, a row for each residual.
    pub columns: DMatrix<f64>,
    /// Coefficients, and the noise that they are estimated with.
    pub fitted: Fitted,
    /// In-sample residuals, SI.
    pub residuals: DVector<f64>,
    /// Residuals of rows that were not used for the coefficients; `None` if the remaining rows do not determine them.
    pub held_out: Option<DVector<f64>>,
}

impl Model {
    /// With the chosen effects; `tested` is their fit in the search. The affine model alone is held out with the noise of `tested`: it has
    /// no effects whose search that noise has to allow for.
    pub(in crate::diagnose) fn of(
        search: &Search,
        chosen: &[Chosen],
        tested: &Fitted,
        split: Split,
    ) -> Option<Self> {
        let columns = search.model(chosen);
        let variance = &search.variance;
        let fitted = variance.fit(&columns, &tested.components, LikelihoodKind::Restricted)?;
        let fitted = fitted.with_prior(search.prior(chosen));
        let judged = match chosen.is_empty() {
            true => tested,
            false => &fitted,
        };
        Some(Self {
            residuals: &search.rows.y - &columns * &fitted.coefficients,
            held_out: held_out(search, &columns, judged, split),
            columns,
            fitted,
        })
    }
}
