//! Tests effects on a recording that they were not found in.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::hold_out::rms;
use crate::diagnose::columns::{basis, beside};
use crate::diagnose::rows::Rows;
use crate::diagnose::search::Search;
use crate::diagnose::variance::LikelihoodKind;
use crate::effects::fitted::FittedEffect;

/// If an effect should change the residuals of a recording by fewer sigmas than this, the recording neither confirms nor
/// contradicts it.
const SHOWS: f64 = 3.0;

/// One effect on another recording, with coefficients that were found without it. The other effects are removed.
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
    /// Expected change of the residuals in sigmas: the length of the part of the effect that the affine parameters cannot absorb.
    pub expected_sigmas: f64,
    /// Whether that is enough for the recording to judge the effect.
    pub shows: bool,
}

impl Second {
    /// Whether the recording contradicts the effect.
    pub fn contradicts(&self) -> bool {
        self.shows && !(self.chi2_after < self.chi2_before)
    }
}

/// Tests each of `effects` on `rows`. The affine parameters are fitted to this recording, so that only the effect is judged.
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
    // Residuals of a fit of the affine parameters alone, and the length of the decorrelated ones.
    let left = |y: &DVector<f64>| {
        let by = white.solve(&whitener.vector(y), 1e-12).ok()?;
        let plain = y - &search.basis * by;
        let by_noise = whitener.vector(&plain);
        Some((plain, by_noise.norm()))
    };
    let mut all = Vec::new();
    for (i, error) in errors.iter().enumerate() {
        // An effect that this recording cannot evaluate, for lack of a temperature or a channel, must not affect the judgement of
        // the others.
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
