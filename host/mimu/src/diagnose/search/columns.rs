//! Columns of models: what they span, and what is new in them.

use nalgebra::DMatrix;

/// Columns that span what `columns` do.
pub fn basis(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = columns.clone().svd(true, false);
    let largest = svd.singular_values.max();
    let kept: Vec<usize> = (0..svd.singular_values.len())
        .filter(|k| svd.singular_values[*k] > 1e-9 * largest)
        .collect();
    svd.u
        .map_or_else(|| columns.clone(), |u| u.select_columns(&kept))
}

/// `matrix` with more columns behind.
pub fn beside(matrix: &DMatrix<f64>, more: &DMatrix<f64>) -> DMatrix<f64> {
    let (p, q) = (matrix.ncols(), more.ncols());
    let mut all = matrix.clone().resize_horizontally(p + q, 0.0);
    all.columns_mut(p, q).copy_from(more);
    all
}

/// Part of a column beyond which it is no sum of others, rounding aside.
const OF_ITS_OWN: f64 = 1e-6;

/// Those of `columns`, at size 1, that are no sums of `model` and of those before them.
pub fn independent_of(columns: &DMatrix<f64>, model: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = unit_columns(columns);
    let mut spanned = basis(&unit_columns(model));
    let mut kept = Vec::new();
    for (k, column) in columns.column_iter().enumerate() {
        // Twice, as once leaves rounding in the direction of what was taken away.
        let once = column - &spanned * spanned.tr_mul(&column);
        let left = &once - &spanned * spanned.tr_mul(&once);
        if left.norm() > OF_ITS_OWN {
            let left = left.normalize();
            spanned = beside(
                &spanned,
                &DMatrix::from_column_slice(left.len(), 1, left.as_slice()),
            );
            kept.push(k);
        }
    }
    columns.select_columns(&kept)
}

/// Columns of size 1.
pub fn unit_columns(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let mut columns = columns.clone();
    for mut column in columns.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    columns
}
