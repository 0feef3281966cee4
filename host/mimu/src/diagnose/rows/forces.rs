//! The forces that a gyro is judged by, and how they may err.

use nalgebra::{DMatrix, Vector3};

use crate::estimate::turn::Turn;

/// Errors of the forces of an accelerometer that are common to all of its poses, or to several.
#[derive(Debug, Clone)]
pub struct ForceErrors {
    /// Index of each dwell, ascending.
    pub dwells: Vec<usize>,
    /// Covariance, three rows for each of them, (m/s²)².
    pub covariance: DMatrix<f64>,
}

impl ForceErrors {
    /// Covariance of components of direction errors, each of a turn, with what it owes to the force before and after it.
    pub fn of_turns(&self, components: &[(&Turn, [Vector3<f64>; 2])]) -> DMatrix<f64> {
        let mut by = DMatrix::zeros(components.len(), self.covariance.nrows());
        for (row, (turn, ends)) in components.iter().enumerate() {
            for (dwell, end) in [turn.from, turn.to].iter().zip(ends) {
                if let Ok(at) = self.dwells.binary_search(dwell) {
                    for k in 0..3 {
                        by[(row, 3 * at + k)] += end[k];
                    }
                }
            }
        }
        &by * &self.covariance * by.transpose()
    }
}
