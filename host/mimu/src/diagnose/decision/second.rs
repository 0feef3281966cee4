//! What effects do to a recording that they were not found in.

use nalgebra::{DMatrix, DVector};

use super::hold_out::rms;
use crate::diagnose::rows::Rows;
use crate::diagnose::search::{Search, basis, beside};
use crate::diagnose::variance::By;
use crate::effects::removal::Removed;

/// An effect that should change the residuals of a recording by fewer sigmas than this is neither borne out nor contradicted by it.
const SHOWS: f64 = 3.0;

/// One effect in another recording, with coefficients that this had no part in; the other effects are taken out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Second {
    /// By how many sigmas it should change the residuals: the length of what the affine parameters cannot do.
    pub expected: f64,
    /// Sum of the squares of the decorrelated residuals without it and with it.
    pub chi2: [f64; 2],
    /// Root mean square of the judged rows without it and with it.
    pub rms: [f64; 2],
}

impl Second {
    /// Whether the recording can tell.
    pub fn shows(&self) -> bool {
        self.expected > SHOWS
    }

    /// Whether the recording speaks against the effect.
    pub fn contradicts(&self) -> bool {
        self.shows() && !(self.chi2[1] < self.chi2[0])
    }
}

/// Each of `effects` in `rows`. The affine parameters are the recording's own: what is judged is the effect alone.
pub(super) fn second(rows: &Rows, effects: &[Removed]) -> Option<Vec<Second>> {
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
    let noise = variance.fit(&basis(&all), &variance.none(), By::Likelihood)?;
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
        all.push(Second {
            expected: left(error)?.1,
            chi2: [without.1.powi(2), with.1.powi(2)],
            rms: [rms(rows, &without.0), rms(rows, &with.0)],
        });
    }
    Some(all)
}
