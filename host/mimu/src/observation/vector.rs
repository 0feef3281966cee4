//! A known vector: the input that a table gives, or the rate of a gyro at rest, which is that of the Earth.

use mimu_core::compensation::Affine;
use nalgebra::{SMatrix, Vector3};

use super::{Block, slope};

/// Error of the `input` at the mean reading `raw`, SI.
pub fn at(model: &Affine<f64>, raw: &Vector3<f64>, input: &Vector3<f64>) -> Block<3> {
    let rows = [0, 1, 2].map(|axis| slope(&Vector3::ith(axis, 1.0), raw).transpose());
    Block {
        residual: model.apply(raw) - input,
        by: SMatrix::from_rows(&rows),
    }
}
