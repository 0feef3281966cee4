//! Errors of the forces that a gyro is judged by.

use nalgebra::{DMatrix, Vector3};

use crate::estimate::turn::Turn;

/// Errors of an accelerometer's forces that several or all of its poses share.
#[derive(Debug, Clone)]
pub struct ForceErrors {
    /// Index of each dwell, ascending.
    pub dwells: Vec<usize>,
    /// Covariance, three rows for each of them, (m/s²)².
    pub covariance: DMatrix<f64>,
}

impl ForceErrors {
    /// Covariance of turns' direction errors. Each component comes with its turn, and its derivatives by the force
    /// before and after.
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
