//! Holding dwells out, and the dwells that an effect depends on.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::columns::unit_columns;
use crate::diagnose::rows::Rows;
use crate::diagnose::search::{Chosen, Search};
use crate::diagnose::variance::Fitted;
use crate::fit::Split;
use crate::observable::Observable;

/// Contiguous blocks that are left out in turn.
const BLOCKS: usize = 4;

/// Root mean square of the judged rows, of which `judged.1` count as one dwell or turn.
pub(in crate::diagnose) fn rms(rows: &Rows, residuals: &DVector<f64>) -> f64 {
    let (count, together) = rows.judged;
    (residuals.rows(0, count).norm_squared() / (count / together) as f64).sqrt()
}

/// Part that a dwell belongs to. With several recordings, each block contains a segment of every one.
pub(in crate::diagnose) fn part(split: Split, rows: &Rows, dwell: usize) -> usize {
    let (place, of) = rows.place(dwell);
    split.part(place, of, BLOCKS)
}

/// Largest variance of the predictions of a block, over the variance of its rows. Above it the rest extrapolates to the block.
const OPEN: f64 = 100.0;

/// Held-out residuals: each row against the model fitted without its block. `None` if the rest of the experiment does not determine the
/// model.
pub(in crate::diagnose) fn held_out(
    search: &Search,
    model: &DMatrix<f64>,
    at: &Fitted,
    split: Split,
) -> Option<DVector<f64>> {
    let rows = search.rows;
    let parts_of = |r: usize| rows.dwells(r).map(|d| part(split, rows, d));
    let mut out = DVector::zeros(rows.y.len());
    let prior = at.prior.iter();
    let prior: Vec<(usize, f64)> = prior
        .map(|(k, sigma)| (*k, 1.0 / (sigma * model.column(*k).norm())))
        .collect();
    // Columns of length 1: a model must not seem undetermined because it has the square of a temperature far from the reference.
    let model = unit_columns(model);
    let variances = search.variance.variances(&at.components);
    for block in 0..BLOCKS {
        let kept: Vec<usize> = (0..rows.y.len())
            .filter(|r| !parts_of(*r).contains(&block))
            .collect();
        // With no more rows than parameters there is nothing to hold out.
        if kept.len() <= model.ncols() {
            return None;
        }
        let parts = search.variance.kept(&at.components, &kept)?;
        let white = parts.whiten(&model.select_rows(&kept));
        let y = parts.vector(&rows.y.select_rows(&kept));
        let (count, all) = (kept.len(), kept.len() + prior.len());
        let mut white = white.resize_vertically(all, 0.0);
        let y = y.resize_vertically(all, 0.0);
        for (i, (column, weight)) in prior.iter().enumerate() {
            white[(count + i, *column)] = *weight;
        }
        let svd = white.svd(true, true);
        let most = svd.singular_values.max();
        if svd.singular_values.min() < 1e-7 * most {
            return None;
        }
        let solution = svd.solve(&y, 0.0).ok()?;
        let by_parameters = svd.v_t.as_ref()?.transpose()
            * DMatrix::from_diagonal(&svd.singular_values.map(|s| 1.0 / s));
        let (mut open, mut own) = (0.0, 0.0);
        // A turn belongs to the block in which it ends.
        for r in (0..rows.y.len()).filter(|r| parts_of(*r)[1] == block) {
            out[r] = rows.y[r] - (model.row(r) * &solution)[0];
            if r < rows.judged.0 {
                open += (model.row(r) * &by_parameters).norm_squared();
                own += variances[r];
            }
        }
        if open > OPEN * own {
            return None;
        }
    }
    Some(out)
}

/// Root mean square of the rows at rest, SI, if the judged rows are turns; `None` if there are none.
pub(super) fn rms_at_rest(rows: &Rows, residuals: &DVector<f64>) -> Option<f64> {
    let count = rows.y.len() - rows.judged.0;
    (rows.observable == Observable::Turns && count > 0)
        .then(|| (residuals.rows(rows.judged.0, count).norm_squared() / count as f64).sqrt())
}

/// Sums of the squares of held-out `residuals` over the variances of their rows, by the parts that were left out.
///
/// Over all rows, not only the judged ones: for a gyro judged by gravity these are turns, and a drift that lowered its scatter at rest from
/// 0.0477 to 0.0047 deg/s was rejected because no turn showed it.
pub(super) fn held_out_by_part(
    rows: &Rows,
    split: Split,
    residuals: &DVector<f64>,
    variances: &DVector<f64>,
) -> [f64; BLOCKS] {
    let mut sums = [0.0; BLOCKS];
    for r in 0..rows.y.len() {
        sums[part(split, rows, rows.dwells(r)[1])] += residuals[r] * residuals[r] / variances[r];
    }
    sums
}

/// Number of parts in which an effect of so many `coefficients` lowers the held-out error, and number of those in which it raises the error
/// by more than the noise of needless coefficients would. `sums` are those of [`held_out_by_part`] without it and with it.
pub(super) fn parts_helped(sums: [&[f64; BLOCKS]; 2], coefficients: usize) -> [usize; 2] {
    let by_noise = 2.0 * coefficients as f64;
    let each = || sums[0].iter().zip(sums[1]);
    [
        each().filter(|(without, with)| with < without).count(),
        each()
            .filter(|(without, with)| **with > *without + by_noise)
            .count(),
    ]
}

/// Number of dwells that are left out, one at a time, to test an effect: those with the largest part in its drop in deviance.
const LEFT_OUT: usize = 3;

/// Largest probability by chance of `one`, corrected for the number of tests, when any one dwell is left out, with all others in its pose
/// and the turns that begin or end there. `without` and `with` are the models without it and with it; `fitted` is the fit of the latter.
pub(super) fn chance_without_a_dwell(
    search: &Search,
    one: &Chosen,
    [without, with]: [&DMatrix<f64>; 2],
    fitted: &Fitted,
) -> Option<f64> {
    let rows = search.rows;
    let variance = &search.variance;
    let at = &fitted.components;
    let whitener = variance.whitener(at)?;
    let left = |model: &DMatrix<f64>| {
        let found = variance.fit_at(model, at)?;
        let left = &rows.y - model * found.coefficients;
        Some(whitener.vector(&left))
    };
    let (a, b) = (left(without)?, left(with)?);
    let witnesses = rows.witnesses();
    let of_row = |r: usize| rows.dwells(r).map(|d| witnesses[d]);
    let mut owed = vec![0.0; rows.dwell_count()];
    for r in 0..rows.y.len() {
        let [from, to] = of_row(r);
        let gain = a[r].powi(2) - b[r].powi(2);
        owed[to] += gain;
        if from != to {
            owed[from] += gain;
        }
    }
    let mut order: Vec<usize> = (0..owed.len()).collect();
    order.sort_by(|i, j| owed[*j].total_cmp(&owed[*i]));
    let chance = |dwell: &usize| {
        let kept: Vec<usize> = (0..rows.y.len())
            .filter(|r| !of_row(*r).contains(dwell))
            .collect();
        if kept.len() <= with.ncols() {
            return None;
        }
        let parts = variance.kept(at, &kept)?;
        let y = parts.vector(&rows.y.select_rows(&kept));
        let chi2 = |model: &DMatrix<f64>| {
            let q = parts
                .whiten(&unit_columns(model).select_rows(&kept))
                .qr()
                .q();
            (&y - &q * q.tr_mul(&y)).norm_squared()
        };
        let [a, b] = [chi2(without), chi2(with)];
        // The former if the noise is known, the latter if it is estimated from the rows.
        let drop = (a - b).min(kept.len() as f64 * (a / b).ln());
        Some(search.chance(drop, one.columns.ncols(), without.ncols(), &one.candidate))
    };
    order
        .iter()
        .take(LEFT_OUT)
        .filter_map(chance)
        .reduce(f64::max)
}

/// Largest shares of one dwell, and of one block of time, in the information about the coefficients of an effect.
pub(super) fn leverage(rows: &Rows, others: &DMatrix<f64>, columns: &DMatrix<f64>) -> [f64; 2] {
    let q = others.clone().qr().q();
    let z = columns - &q * q.tr_mul(columns);
    let count = rows.dwell_count();
    let mut worst = [0.0_f64; 2];
    for column in z.column_iter() {
        let mut by = [vec![0.0; count], vec![0.0; BLOCKS]];
        for (r, v) in column.iter().enumerate() {
            let dwell = rows.dwells(r)[1];
            by[0][dwell] += v * v;
            by[1][part(Split::Blocks, rows, dwell)] += v * v;
        }
        for (worst, by) in worst.iter_mut().zip(by) {
            let total: f64 = by.iter().sum();
            *worst = worst.max(by.into_iter().fold(0.0, f64::max) / total);
        }
    }
    worst
}
