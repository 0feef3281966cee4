//! The likeliest unknown part of the Earth's rate in a session on a table.
//!
//! The direction of the Earth's rate on the table is the same for the whole session, while the bias follows the temperature. So a few numbers are fitted
//! to all rows, beside a bias that is piecewise linear in time, whatever the temperature does to it, and scale factors and cross terms with a slope in
//! time. The curves then start from inputs that contain the Earth's rate. What remains unknown of it is estimated together with them.

use nalgebra::{DMatrix, DVector, Vector3};

use crate::row::Row;

/// Distance of the knots of the bias, s. A scheme of poses takes two to three minutes, so several are between two knots.
const KNOTS_S: f64 = 600.0;
/// Functions of time of each scale factor and cross term: constant, linear, quadratic.
const OF_TIME: usize = 3;
/// Regularization of the bias and the matrix, as a share of the largest element: a session need not determine all of it.
const RIDGE: f64 = 1e-10;

/// Adds the likeliest unknown part of the Earth's rate to the inputs of a gyro's `rows`.
pub(crate) fn complete(rows: &mut [Row]) {
    let known = |r: &Row| r.input.iter().all(|x| x.is_finite());
    let used: Vec<&Row> = rows.iter().filter(|r| known(r)).collect();
    let Some(numbers) = numbers(&used) else {
        return;
    };
    for row in rows.iter_mut() {
        let Some(own) = numbers.get(row.earth.heading) else {
            continue;
        };
        let unknown = row.earth.by * own;
        row.input += unknown;
        row.earth.known += unknown;
    }
}

/// The numbers of each heading, in standard deviations. `None` if no row depends on them.
fn numbers(rows: &[&Row]) -> Option<Vec<Vector3<f64>>> {
    let concerned = rows.iter().filter(|r| r.earth.is_unknown());
    let headings = 1 + concerned.map(|r| r.earth.heading).max()?;
    let (first, last) = (rows.first()?.middle_s, rows.last()?.middle_s);
    let span_s = (last - first).max(1.0);
    let pieces = (span_s / KNOTS_S).ceil();
    let largest = rows.iter().map(|r| r.input.norm()).fold(0.0, f64::max);
    let columns = 3 * OF_TIME + pieces as usize + 1;
    let entries = |r: &Row| {
        let mut out = DVector::zeros(columns);
        let at = (r.middle_s - first) / span_s;
        for k in 0..3 {
            for power in 0..OF_TIME {
                out[OF_TIME * k + power] = r.input[k] / largest * at.powi(power as i32);
            }
        }
        let place = at * pieces;
        let knot = (place as usize).min(pieces as usize - 1);
        out[3 * OF_TIME + knot] = 1.0 - (place - knot as f64);
        out[3 * OF_TIME + knot + 1] = place - knot as f64;
        out
    };
    let mut gram = DMatrix::zeros(columns, columns);
    let mut with = DMatrix::zeros(columns, 3);
    for r in rows {
        let x = entries(r);
        gram.ger(r.samples, &x, &x, 1.0);
        with += &x * r.raw.transpose() * r.samples;
    }
    let ridge = RIDGE * gram.amax();
    let factor = (gram + DMatrix::identity(columns, columns) * ridge).cholesky()?;
    let solved = factor.solve(&with);
    // The numbers of a heading by the rows of that heading: those of other headings hardly share a bias with it.
    let mut normal = vec![(DMatrix::identity(3, 3), DVector::zeros(3)); headings];
    for axis in 0..3 {
        let gain = |r: &Row| {
            let at = (r.middle_s - first) / span_s;
            let along = |k: usize| {
                let by = (0..OF_TIME).map(|p| solved[(OF_TIME * k + p, axis)] * at.powi(p as i32));
                by.sum::<f64>() / largest
            };
            Vector3::new(along(0), along(1), along(2))
        };
        let left = |r: &Row| r.raw[axis] - (solved.column(axis).dot(&entries(r)));
        let dof = (rows.len() as f64 - columns as f64).max(1.0);
        let variance = rows
            .iter()
            .map(|r| left(r).powi(2) * r.samples)
            .sum::<f64>()
            / dof;
        let variance = variance.max(f64::MIN_POSITIVE);
        for (heading, (gram, with)) in normal.iter_mut().enumerate() {
            let own = || rows.iter().filter(|r| r.earth.heading == heading);
            let mut across = DMatrix::zeros(columns, 3);
            let mut of_rows = DMatrix::<f64>::zeros(3, 3);
            let mut of_left = DVector::<f64>::zeros(3);
            for r in own() {
                let by = r.earth.by.tr_mul(&gain(r));
                let by = DVector::from_column_slice(by.as_slice());
                of_rows.ger(r.samples, &by, &by, 1.0);
                of_left.axpy(r.samples * left(r), &by, 1.0);
                across.ger(r.samples, &entries(r), &by, 1.0);
            }
            // What bias and matrix explain says nothing about the numbers.
            *gram += (of_rows - across.tr_mul(&factor.solve(&across))) / variance;
            *with += of_left / variance;
        }
    }
    let solve = |(gram, with): (DMatrix<f64>, DVector<f64>)| {
        let found = gram.cholesky().map(|c| c.solve(&with));
        found.map_or_else(Vector3::zeros, |v| Vector3::new(v[0], v[1], v[2]))
    };
    Some(normal.into_iter().map(solve).collect())
}
