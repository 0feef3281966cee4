//! Candidates that are tried on a sensor.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::diagnose::rows::Rows;
use crate::diagnose::search::{EXCITED, LARGEST, SEPARATE, Search};
use crate::effects;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;
use crate::effects::regressor::{Product, Regressor};

/// Share of its upper bound below which a product is rounding.
const ROUNDING: f64 = 1e-9;

/// All candidates of a sensor, and the effects that its experiment would not show at data-sheet size.
///
/// An effect is tried if its columns are independent of the affine ones. A real fault may have ten thousand times the data-sheet size, and
/// if an effect is not tried, its rivals take its place: a steady drift of twice the noise was found as a warm-up in 13 of 16 units.
pub(super) fn candidates(
    rows: &Rows,
    dwell_ends: &[(usize, f64)],
) -> (Vec<Candidate>, Vec<&'static Effect>) {
    let sensor = rows.sensor;
    let mut all = Vec::new();
    let mut not_excited = Vec::new();
    // Excitation is judged by the known noise.
    let plain = Search::new(rows, Vec::new());
    let Some(whitener) = plain.variance.whitener(&plain.variance.none()) else {
        return (all, not_excited);
    };
    let q = whitener.whiten(&plain.basis).qr().q();
    let across = |columns: &DMatrix<f64>| {
        let white = whitener.whiten(columns);
        let z = &white - &q * q.tr_mul(&white);
        // Rounding leaves a little of columns that the affine parameters span.
        DVector::from_fn(z.ncols(), |k, _| {
            let (left, all) = (z.column(k).norm(), white.column(k).norm());
            if left > 1e-6 * all { left } else { 0.0 }
        })
    };
    let mut listed: Vec<(usize, Regressor)> = Vec::new();
    for effect in effects::all().filter(|e| e.sensor == sensor) {
        if !effect.is_error() && !rows.earth_unknown {
            continue;
        }
        let mut not_seen = || not_excited.push(effect);
        let mut candidate = Candidate::new(sensor, CandidateKind::Effect(effect));
        // How many sigmas a coefficient of 1 would be from zero, at the nonlinear parameter at which it shows best.
        let mut best = vec![0.0_f64; effect.coefficients.len()];
        for parameter in candidate.parameters() {
            let seen = across(&candidate.columns(rows, parameter));
            for (k, seen) in candidate.active.iter().zip(seen.iter()) {
                if seen.is_finite() {
                    best[*k] = best[*k].max(*seen);
                }
            }
        }
        let sigmas = |k: &usize| best[*k] * effect.coefficients[*k].typical;
        candidate.active.retain(|k| sigmas(k) > EXCITED / LARGEST);
        if candidate.parameter().is_none() {
            let white = whitener.whiten(&candidate.columns(rows, 0.0));
            separate(&mut candidate, &(&white - &q * q.tr_mul(&white)));
        }
        let shown = |k: &usize| sigmas(k) > EXCITED;
        candidate.excited = candidate.active.iter().copied().filter(shown).collect();
        if candidate.excited.is_empty() {
            not_seen();
        }
        if !candidate.active.is_empty() {
            let of_axis = candidate.active.iter().filter_map(|k| {
                let coefficient = &effect.coefficients[*k];
                Some((coefficient.axis?, coefficient.regressor))
            });
            listed.extend(of_axis);
            all.extend(candidate.variants(rows));
        }
    }
    let terms: Vec<Vec<Candidate>> = Product::terms()
        .into_par_iter()
        .map(|product| {
            let term = |axis| Candidate::new(sensor, CandidateKind::Term(axis, product));
            let columns = rows.term(&product, &[0, 1, 2]);
            let seen = across(&columns);
            // If a table turns about one axis at a time, the rates about the others are rounding: with a coefficient of 5e12 their product
            // passed for an effect.
            let rounding = ROUNDING * rows.largest(&product);
            let seen = |axis: &usize| {
                let column = columns.column(*axis);
                let finite = column.iter().all(|v| v.is_finite());
                finite && seen[*axis] > 0.0 && column.amax() > rounding
            };
            // A product that is the regressor of a named effect is that effect.
            let named = |axis: &usize| {
                let mut on_axis = listed.iter().filter(|(of, _)| of == axis);
                on_axis.any(|(_, regressor)| regressor.is_on_axis(&product, *axis, sensor))
            };
            let unnamed = (0..3).filter(|axis| !named(axis));
            unnamed.filter(seen).map(term).collect()
        })
        .collect();
    all.extend(terms.into_iter().flatten());
    for &(session, t_s) in dwell_ends {
        let jump = |axis| CandidateKind::Jump { axis, session, t_s };
        all.extend((0..3).map(|axis| Candidate::new(sensor, jump(axis))));
    }
    (all, not_excited)
}

/// Keeps the active coefficients whose columns, decorrelated beside the affine parameters, are independent of the ones before. At rest the
/// squares of the force along three axes add up to a constant, which is a bias.
fn separate(candidate: &mut Candidate, columns: &DMatrix<f64>) {
    let mut spanned: Vec<DVector<f64>> = Vec::new();
    let mut kept = Vec::new();
    for (k, column) in candidate.active.iter().zip(columns.column_iter()) {
        let left = spanned.iter().fold(column.into_owned(), |left, unit| {
            let share = unit.dot(&left);
            left - unit * share
        });
        if left.norm() > SEPARATE * column.norm() {
            spanned.push(left.normalize());
            kept.push(*k);
        } else {
            candidate.inseparable.push(*k);
        }
    }
    candidate.active = kept;
}
