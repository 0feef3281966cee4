//! Columns of models: their basis, and those that are independent of others.

use nalgebra::DMatrix;

/// Orthonormal basis of the space that `columns` span.
pub fn basis(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = columns.clone().svd(true, false);
    let largest = svd.singular_values.max();
    let kept: Vec<usize> = (0..svd.singular_values.len())
        .filter(|k| svd.singular_values[*k] > 1e-9 * largest)
        .collect();
    svd.u
        .map_or_else(|| columns.clone(), |u| u.select_columns(&kept))
}

/// `matrix` with the columns of `more` appended.
pub fn beside(matrix: &DMatrix<f64>, more: &DMatrix<f64>) -> DMatrix<f64> {
    let (p, q) = (matrix.ncols(), more.ncols());
    let mut all = matrix.clone().resize_horizontally(p + q, 0.0);
    all.columns_mut(p, q).copy_from(more);
    all
}

/// Part of a column of length 1 that must be independent of the others; less is rounding.
const OF_ITS_OWN: f64 = 1e-6;

/// Those of `columns`, scaled to length 1, that are linearly independent of `model` and of those
/// before them.
pub fn independent_of(columns: &DMatrix<f64>, model: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = unit_columns(columns);
    let mut spanned = basis(&unit_columns(model));
    let mut kept = Vec::new();
    for (k, column) in columns.column_iter().enumerate() {
        // Twice, because once leaves rounding in the direction of the basis.
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

/// Columns scaled to length 1.
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
