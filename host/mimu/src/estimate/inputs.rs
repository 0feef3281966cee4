//! Known inputs as the design of a regression.

use nalgebra::DMatrix;

use super::Observation;

/// Size of the largest input: the unit in which designs are judged.
pub(super) fn span<'a>(observations: impl IntoIterator<Item = &'a Observation>) -> f64 {
    observations
        .into_iter()
        .map(|o| o.input.norm())
        .fold(0.0, f64::max)
        .max(f64::MIN_POSITIVE)
}

/// Rows `[1, x, y, z]`, inputs in units of `span`.
pub(super) fn design(observations: &[Observation], span: f64) -> DMatrix<f64> {
    DMatrix::from_fn(observations.len(), 4, |i, j| match j {
        0 => 1.0,
        _ => observations[i].input[j - 1] / span,
    })
}
