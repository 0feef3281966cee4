//! Screens all candidates by the share of the scatter that each explains, with the noise of the model so far.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{COEFFICIENT, Chosen, Search, exceeds};
use crate::diagnose::variance::Fitted;
use crate::effects::candidate::Candidate;

/// A screened candidate.
pub(super) struct Screened {
    pub index: usize,
    pub parameter: f64,
    /// Probability by chance.
    pub p: f64,
    /// Drop in deviance minus the cost of its coefficients.
    pub gain: f64,
}

/// Part of `columns` outside the orthonormal columns `others`; both are decorrelated.
fn across(others: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    columns - others * others.tr_mul(columns)
}

impl Search<'_> {
    /// Screens all candidates beside the chosen ones; the most promising first. Of the variants of a named effect only
    /// the best is returned.
    pub(super) fn screen(&self, chosen: &[Chosen], null: &Fitted) -> Vec<Screened> {
        let Some(whitener) = self.variance.whitener(&null.components) else {
            return Vec::new();
        };
        let others = whitener.whiten(&self.model(chosen)).qr().q();
        let y = whitener.vector(&self.rows.y);
        let left = &y - &others * others.tr_mul(&y);
        let total = left.norm_squared();
        let taken = |c: &Candidate| chosen.iter().any(|k| k.candidate.is_variant_of(c));
        let mut found: Vec<Screened> = (0..self.candidates.len())
            .into_par_iter()
            .filter(|i| !taken(&self.candidates[*i]))
            .flat_map_iter(|index| {
                let mut best: Option<Screened> = None;
                for columns in &self.screened[index] {
                    let parameter = columns.parameter;
                    let white = whitener.whiten_rotated(columns.rotated.clone());
                    let Some((p, gain)) = self.explained(&others, &left, total, &white) else {
                        continue;
                    };
                    if best.as_ref().is_none_or(|b| gain > b.gain) {
                        best = Some(Screened {
                            index,
                            parameter,
                            p,
                            gain,
                        });
                    }
                }
                best
            })
            .collect();
        // Sorted by probability instead of gain: with a dozen rows six coefficients gain more than the three that are
        // significant.
        found.sort_by(|a, b| a.p.total_cmp(&b.p).then(b.gain.total_cmp(&a.gain)));
        let mut seen: Vec<usize> = Vec::new();
        found.retain(|s| {
            let candidate = &self.candidates[s.index];
            let again = candidate.is_listed()
                && seen
                    .iter()
                    .any(|i| self.candidates[*i].is_variant_of(candidate));
            seen.push(s.index);
            !again
        });
        found
    }

    fn explained(
        &self,
        others: &DMatrix<f64>,
        left: &DVector<f64>,
        total: f64,
        white: &DMatrix<f64>,
    ) -> Option<(f64, f64)> {
        let raw: Vec<f64> = white.column_iter().map(|c| c.norm()).collect();
        let mut z = across(others, white);
        for (mut column, raw) in z.column_iter_mut().zip(&raw) {
            let norm = column.norm();
            // The others span the column, and only rounding is left of it.
            if !(norm > 1e-7 * raw) || !norm.is_finite() {
                return None;
            }
            column /= norm;
        }
        let svd = z.svd(true, false);
        let rank = svd.singular_values.iter().filter(|s| **s > 1e-4).count();
        let u = svd.u?;
        let explained: f64 = (0..rank).map(|k| u.column(k).dot(left).powi(2)).sum();
        let dof = self.dof(others.ncols() + rank);
        if rank == 0 || dof < 2.0 {
            return None;
        }
        let f = explained / rank as f64 / ((total - explained) / dof);
        let drop = -(left.len() as f64) * (-explained / total).ln_1p();
        Some((
            exceeds(f, rank as f64, dof),
            drop - COEFFICIENT * rank as f64,
        ))
    }
}
