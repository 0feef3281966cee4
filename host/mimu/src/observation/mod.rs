//! What one observation says about a unit: a file for each kind.
//!
//! Each kind turns condensed data and the models of a unit's triads into a residual and its derivatives by the twelve parameters of a triad,
//! `x = C u + o`, C by rows and then o. Estimators, held-out refits, outliers, diagnosis, designs and predictions take them from here and choose which
//! parameters are free ([`LOWER`], [`free`]), about which reading the bias is meant ([`about`]), and in which units.
//!
//! | kind | residual | derivatives |
//! |---|---|---|
//! | [`vector`] | error of a known vector: an input of a table, or the rate at rest | by its triad |
//! | [`magnitude`] | error of a known magnitude: of gravity, or of a turntable's rate | by its triad |
//! | [`closure`] | error of the heading after whole turns that end where they began | by the gyro, by the forces before and after, and so by the accelerometer |
//! | [`turn`] | error of the direction of gravity after a turn, two components | by the gyro, by the forces before and after, and so by the accelerometer; by the Earth's level rate |
//!
//! A new kind is a file with a function that gives [`Block`], a row in this table, a case in `tests.rs`, and a variant of [`crate::factor::Kind`].

pub mod closure;
pub mod magnitude;
pub mod turn;
pub mod vector;

use mimu_core::compensation::Affine;
use nalgebra::{SMatrix, SVector, Vector3};

/// Derivatives of one residual by C (rows first) and o of a triad, raw to SI.
pub type ByTriad = SVector<f64, 12>;

/// Residuals of one observation and their derivatives by the parameters of one triad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block<const N: usize> {
    /// Residuals: what the models give minus what is known.
    pub residual: SVector<f64, N>,
    /// Derivatives, a row for each residual.
    pub by: SMatrix<f64, N, 12>,
}

impl<const N: usize> Block<N> {
    /// Derivatives of residual `k`.
    pub fn by(&self, k: usize) -> ByTriad {
        self.by.row(k).transpose()
    }
}

/// The parameters that magnitudes determine: the lower triangle of C, then o.
///
/// Magnitudes do not change if the whole triad is rotated, so the frame has to be chosen: the body frame has its x axis along the sensor x and its xy plane
/// through the sensor y, fang (13) with `Mp = 1`.
pub const LOWER: [usize; 9] = [0, 3, 4, 6, 7, 8, 9, 10, 11];

/// All parameters, which turns determine.
pub const ALL: [usize; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

/// Row and column of parameter `k` in C; the column is `None` for an element of o.
pub const fn place(k: usize) -> (usize, Option<usize>) {
    match k {
        0..9 => (k / 3, Some(k % 3)),
        _ => (k - 9, None),
    }
}

/// The derivatives by the parameters that are `free`.
pub fn free<const M: usize>(by: &ByTriad, free: &[usize; M]) -> SVector<f64, M> {
    SVector::from_fn(|k, _| by[free[k]])
}

/// Derivatives of `along · (C u + o)`: `along` itself for o, and its products with the reading `u` for C.
pub fn slope(along: &Vector3<f64>, u: &Vector3<f64>) -> ByTriad {
    SVector::from_fn(|k, _| match place(k) {
        (row, Some(column)) => along[row] * u[column],
        (row, None) => along[row],
    })
}

/// The derivatives if o is the input at the reading `centre`: `x = C (u - centre) + o`. About the mean reading C and o are nearly independent; about zero
/// the offset of a converter makes them nearly dependent.
pub fn about(by: &ByTriad, centre: &Vector3<f64>) -> ByTriad {
    SVector::from_fn(|k, _| match place(k) {
        (row, Some(column)) => by[k] - by[9 + row] * centre[column],
        (_, None) => by[k],
    })
}

/// What one unit of each parameter about `centre` adds to the parameters about zero, as columns: the derivatives of [`about`] hold for them.
pub fn from_centre(centre: &Vector3<f64>) -> SMatrix<f64, 12, 12> {
    let mut change = SMatrix::identity();
    for k in 0..9 {
        change[(9 + k / 3, k)] = -centre[k % 3];
    }
    change
}

/// The derivatives by a further model `x' = (1 + A) x + d` of what `model` gives, at A = 0 and d = 0: A by rows, then d.
pub fn of_output(by: &ByTriad, model: &Affine<f64>) -> ByTriad {
    SVector::from_fn(|k, _| match place(k) {
        (row, Some(column)) => {
            let of_c = (0..3).map(|m| by[3 * row + m] * model.matrix[(column, m)]);
            of_c.sum::<f64>() + by[9 + row] * model.offset[column]
        }
        (_, None) => by[k],
    })
}

#[cfg(test)]
mod tests;
