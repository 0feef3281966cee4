//! What is tried on a sensor.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::diagnose::candidate::{Candidate, Kind, Monomial};
use crate::diagnose::library;
use crate::diagnose::rows::Rows;
use crate::diagnose::search::Search;

/// An effect whose coefficient of the size of a data sheet would not be this many sigmas is not excited.
pub(in crate::diagnose) const EXCITED: f64 = 3.0;

/// Share of what a product could be at most below which it is made of rounding.
const ROUNDING: f64 = 1e-9;

/// Everything that is tried on a sensor, and the effects that its experiment does not show.
pub(super) fn candidates(
    rows: &Rows,
    dwell_ends: &[(usize, f64)],
) -> (Vec<Candidate>, Vec<(String, String)>) {
    let sensor = rows.sensor;
    let mut all = Vec::new();
    let mut not_excited = Vec::new();
    // Excitation is judged by the known noise.
    let plain = Search::new(rows, Vec::new());
    let Some(whitener) = plain.spread.whitener(&plain.spread.none()) else {
        return (all, not_excited);
    };
    let q = whitener.whiten(&plain.basis).qr().q();
    let across = |columns: &DMatrix<f64>| {
        let white = whitener.whiten(columns);
        let z = &white - &q * q.tr_mul(&white);
        // Of what the affine parameters span rounding leaves a little.
        DVector::from_fn(z.ncols(), |k, _| {
            let (left, all) = (z.column(k).norm(), white.column(k).norm());
            if left > 1e-6 * all { left } else { 0.0 }
        })
    };
    for effect in library::all().filter(|e| e.sensor == sensor) {
        let Some(mut candidate) = Candidate::effect_in(effect, rows) else {
            not_excited.push((effect.id.into(), effect.needs.into()));
            continue;
        };
        let mut best = vec![0.0_f64; effect.coefficients.len()];
        for form in candidate.forms() {
            let seen = across(&candidate.columns(rows, form));
            for (best, (seen, typical)) in best.iter_mut().zip(seen.iter().zip(effect.typical)) {
                if seen.is_finite() {
                    *best = best.max(seen * typical);
                }
            }
        }
        candidate.active.retain(|k| best[*k] > EXCITED);
        if candidate.active.is_empty() {
            not_excited.push((effect.id.into(), effect.needs.into()));
        } else {
            all.extend(candidate.variants(rows));
        }
    }
    let terms: Vec<Vec<Candidate>> = Monomial::all()
        .into_par_iter()
        .map(|monomial| {
            let term = |axis| Candidate::new(sensor, Kind::Term(axis, monomial.clone()));
            let columns = term(0).columns_by_axis(rows, &[0, 1, 2]);
            let seen = across(&columns);
            // A table that turns about one axis at a time has rates about the others of rounding's size: with a coefficient of
            // 5e12 their product passed for an effect.
            let rounding = ROUNDING * monomial.largest(&rows.moments(term(0).behind(0.0)));
            let seen = |axis: &usize| {
                let column = columns.column(*axis);
                let finite = column.iter().all(|v| v.is_finite());
                finite && seen[*axis] > 0.0 && column.amax() > rounding
            };
            (0..3).filter(seen).map(term).collect()
        })
        .collect();
    all.extend(terms.into_iter().flatten());
    for &(session, t_s) in dwell_ends {
        let jump = |axis| Kind::Jump { axis, session, t_s };
        all.extend((0..3).map(|axis| Candidate::new(sensor, jump(axis))));
    }
    (all, not_excited)
}
