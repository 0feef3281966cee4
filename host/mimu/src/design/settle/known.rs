//! What a recording has told already of the matrix and of effects. Its bias tells nothing: after the next power-on it is another.

use nalgebra::DMatrix;

use super::Question;
use super::layout::{Block, Part, What, affine_error};
use crate::diagnose::rows::Rows;
use crate::diagnose::spread::Spread;
use crate::quantity::Sensor;

/// The rows of a recording, sensor by sensor.
#[derive(Debug, Clone, Default)]
pub struct Known {
    /// Rows.
    pub rows: Vec<Rows>,
}

impl Known {
    fn of(&self, sensor: Sensor) -> Option<&Rows> {
        self.rows.iter().find(|r| r.sensor == sensor)
    }

    /// Information on the parameters of `block`, in their SI units, with a bias of the recording's own taken out. Nothing where
    /// a regressor was not recorded.
    pub fn information(&self, question: &Question, block: &Block) -> DMatrix<f64> {
        let nothing = DMatrix::zeros(block.columns.len(), block.columns.len());
        let found = self.of(block.sensor).and_then(|rows| {
            let biases: Vec<usize> = match block.part {
                Part::Axis(i) => vec![i],
                Part::Size => vec![0, 1, 2],
            };
            let mut columns = DMatrix::zeros(rows.y.len(), 0);
            for what in block.columns.iter().copied() {
                let column = column(question, block, rows, what);
                columns = crate::diagnose::search::beside(&columns, &column);
            }
            for axis in biases {
                let bias = affine_column(block, rows, What::Bias(axis), axis);
                columns = crate::diagnose::search::beside(&columns, &bias);
            }
            let spread = Spread::new(rows, false);
            let white = spread.whitener(&spread.none())?.whiten(&columns);
            let p = block.columns.len();
            // Of a temperature that was not recorded nothing is known.
            let known = |k: usize| white.column(k).iter().all(|v| v.is_finite());
            let mut own = white.columns(0, p).into_owned();
            for k in (0..p).filter(|k| !known(*k)) {
                own.column_mut(k).fill(0.0);
            }
            let q = white.columns(p, white.ncols() - p).into_owned().qr().q();
            let left = &own - &q * q.tr_mul(&own);
            let mut told = left.tr_mul(&left);
            for (k, what) in block.columns.iter().enumerate() {
                if matches!(what, What::Bias(_)) || !known(k) {
                    told.row_mut(k).fill(0.0);
                    told.column_mut(k).fill(0.0);
                }
            }
            Some(told)
        });
        found.unwrap_or(nothing)
    }
}

fn affine_column(block: &Block, rows: &Rows, what: What, axis: usize) -> DMatrix<f64> {
    rows.columns(&rows.moments(None), &[axis], |at, out| {
        out[0] = affine_error(block.sensor, what, at)[axis];
    })
}

fn column(question: &Question, block: &Block, rows: &Rows, what: What) -> DMatrix<f64> {
    let of = |i: usize| {
        let candidate = &question.suspects[i].candidate;
        candidate.columns(rows, block.form(candidate))
    };
    match what {
        What::Bias(axis) | What::Matrix(axis, _) => affine_column(block, rows, what, axis),
        What::Coefficient(i, k) => of(i).columns(k, 1).into_owned(),
        What::Whole(i) => {
            let suspect = &question.suspects[i];
            let here = |axis: usize| block.part == Part::Size || block.part == Part::Axis(axis);
            let axes = suspect.candidate.axes();
            let sizes = axes.iter().zip(&suspect.sizes);
            let sizes = sizes.map(|(axis, size)| if here(*axis) { *size } else { 0.0 });
            of(i) * DMatrix::from_iterator(axes.len(), 1, sizes)
        }
    }
}
