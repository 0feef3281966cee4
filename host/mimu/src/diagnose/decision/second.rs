//! What effects do to a recording that they were not found in.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::hold_out::rms;
use crate::diagnose::rows::Rows;
use crate::diagnose::search::{Search, basis, beside};
use crate::diagnose::variance::LikelihoodKind;
use crate::effects::fitted::FittedEffect;

/// An effect that should change the residuals of a recording by fewer sigmas than this is neither borne out nor contradicted by it.
const SHOWS: f64 = 3.0;

/// One effect in another recording, with coefficients that this had no part in; the other effects are taken out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Second {
    /// Root mean square of the judged rows without it.
    pub rms_before: f64,
    /// With it.
    pub rms_after: f64,
    /// Sum of the squares of the decorrelated residuals without it.
    pub chi2_before: f64,
    /// With it.
    pub chi2_after: f64,
    /// By how many sigmas it should change the residuals: the length of what the affine parameters cannot do.
    pub expected_sigmas: f64,
    /// Whether that is enough for the recording to say anything of it.
    pub shows: bool,
}

impl Second {
    /// Whether the recording speaks against the effect.
    pub fn contradicts(&self) -> bool {
        self.shows && !(self.chi2_after < self.chi2_before)
    }
}

/// Each of `effects` in `rows`. The affine parameters are the recording's own: what is judged is the effect alone.
pub(super) fn second(rows: &Rows, effects: &[FittedEffect]) -> Option<Vec<Second>> {
    let search = Search::new(rows, Vec::new());
    let columns: Vec<DMatrix<f64>> = effects
        .iter()
        .map(|e| e.candidate.columns(rows, e.parameter))
        .collect();
    let finite = |c: &&DMatrix<f64>| c.iter().all(|v| v.is_finite());
    let all = columns
        .iter()
        .filter(finite)
        .fold(search.basis.clone(), |m, c| beside(&m, c));
    let variance = &search.variance;
    let noise = variance.fit(&basis(&all), &variance.none(), LikelihoodKind::Likelihood)?;
    let whitener = variance.whitener(&noise.components)?;
    let white = whitener.whiten(&search.basis).svd(true, true);
    let errors: Vec<DVector<f64>> = columns
        .iter()
        .zip(effects)
        .map(|(c, e)| c * DVector::from_column_slice(&e.values))
        .collect();
    // What the affine parameters leave of some residuals, as they are and decorrelated.
    let left = |y: &DVector<f64>| {
        let y = DMatrix::from_column_slice(y.len(), 1, y.as_slice());
        let decorrelated = whitener.whiten(&y);
        let by = white.solve(&decorrelated, 1e-12).ok()?;
        let plain = (&y - &search.basis * &by).column(0).into_owned();
        let by_noise = decorrelated - whitener.whiten(&(&search.basis * by));
        Some((plain, by_noise.norm()))
    };
    let mut all = Vec::new();
    for (i, error) in errors.iter().enumerate() {
        // One that the recording says nothing of, for want of a temperature or a channel, says nothing of the others either.
        let finite = |e: &DVector<f64>| e.iter().all(|v| v.is_finite());
        let others = errors.iter().enumerate();
        let others = others.filter(|(j, e)| *j != i && finite(e));
        let y = others.fold(rows.y.clone(), |y, (_, e)| y - e);
        let (without, with) = (left(&y)?, left(&(&y - error))?);
        let expected_sigmas = left(error)?.1;
        all.push(Second {
            rms_before: rms(rows, &without.0),
            rms_after: rms(rows, &with.0),
            chi2_before: without.1.powi(2),
            chi2_after: with.1.powi(2),
            expected_sigmas,
            shows: expected_sigmas > SHOWS,
        });
    }
    Some(all)
}
