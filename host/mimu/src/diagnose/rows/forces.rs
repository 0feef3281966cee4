//! Errors of the forces that a gyro is judged by.

use nalgebra::{DMatrix, Vector3};

use crate::observation::turn::Turn;

/// Errors of an accelerometer's forces that several or all of its poses share.
#[derive(Debug, Clone)]
pub struct ForceErrors {
    /// Index of each dwell, ascending.
    pub dwells: Vec<usize>,
    /// Factor of their covariance, three rows for each of them, m/s²: the covariance is this times its transpose. It has few columns, one for each
    /// uncertain parameter, so that its size grows with the number of dwells instead of its square.
    pub factor: DMatrix<f64>,
}

impl ForceErrors {
    /// Factor of the covariance of turns' direction errors, rad. Each component comes with its turn, and its derivatives by the force
    /// before and after.
    pub fn of_turns(&self, components: &[(&Turn, [Vector3<f64>; 2])]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(components.len(), self.factor.ncols());
        for (row, (turn, ends)) in components.iter().enumerate() {
            for (dwell, end) in [turn.from, turn.to].iter().zip(ends) {
                if let Ok(at) = self.dwells.binary_search(dwell) {
                    let added = end.transpose() * self.factor.fixed_rows::<3>(3 * at);
                    let mut row = out.row_mut(row);
                    row += added;
                }
            }
        }
        out
    }
}
