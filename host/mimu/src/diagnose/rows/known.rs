//! Rows of dwells whose input is known.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, Vector3};

use super::build::{Builder, Part};
use super::{Figure, Stratum};
use crate::triad::Forward;

impl Builder<'_> {
    /// A row for each dwell and sensor axis; `accel` is the calibrated accelerometer, for the forces on a gyro.
    pub(super) fn known(
        mut self,
        inverse: &Affine<f64>,
        accel: Option<&Affine<f64>>,
    ) -> Option<Part> {
        let forward = Forward::of(inverse)?;
        let (prepared, scale) = (self.prepared, self.scale);
        let observations = prepared.observations(self.sensor);
        let n = observations.len();
        if n == 0 {
            return None;
        }
        let dwells: Vec<usize> = observations.iter().map(|o| o.dwell).collect();
        let wander = prepared.noise.wander(self.sensor, &prepared.dwells.list);
        let conditions: Vec<Range<usize>> = dwells
            .iter()
            .map(|d| self.dwell(*d, self.force(*d, accel)))
            .collect();
        let random_walk = self.random_walk(&dwells);
        let mut y = Vec::new();
        let mut nuisance = DMatrix::zeros(3 * n, 12);
        let mut by_matrix = DMatrix::zeros(3 * n, 9);
        let readings: Vec<Vector3<f64>> = observations
            .iter()
            .map(|o| forward.apply(&o.input))
            .collect();
        let centre = readings.iter().sum::<Vector3<f64>>() / n as f64;
        let mut strata = Vec::new();
        for axis in 0..3 {
            for (i, o) in observations.iter().enumerate() {
                let row = y.len();
                let predicted = readings[i][axis];
                self.mean_row(o.dwell, &conditions[i], Vector3::ith(axis, 1.0));
                y.push((o.raw[axis] - predicted) / scale[axis]);
                nuisance[(row, 4 * axis)] = 1.0;
                for k in 0..3 {
                    nuisance[(row, 4 * axis + 1 + k)] = o.input[k];
                }
                // Of u = P x + b the derivative by C is -P dC (u - b), and what is constant of it a bias.
                for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    by_matrix[(row, 3 * r + c)] =
                        forward.matrix[(axis, r)] * (readings[i] - centre)[c] / scale[axis];
                }
            }
            let s2 = scale[axis] * scale[axis];
            let known = DMatrix::from_fn(n, n, |i, j| match (i == j, &wander) {
                (true, _) => observations[i].variance[axis] / s2,
                (_, Some(w)) => w[axis][(dwells[i], dwells[j])] / s2,
                _ => 0.0,
            });
            strata.push(Stratum {
                name: crate::quantity::AXES[axis].into(),
                axis: Some(axis),
                session: 0,
                rows: axis * n..(axis + 1) * n,
                known,
                by_reference: None,
                open: None,
                random_walk: Some(random_walk.clone()),
                wander_known: wander.is_some(),
            });
        }
        let figure = (Figure::Input, 3 * n, 1);
        let parameters = by_forward(inverse, &scale);
        self.finish(
            y,
            (nuisance, parameters, by_matrix),
            vec![0, 4, 8],
            strata,
            figure,
        )
    }
}

/// What a bias and a row of the forward model, in SI along each axis, add to the inverse one: C by rows, then o.
fn by_forward(inverse: &Affine<f64>, scale: &Vector3<f64>) -> DMatrix<f64> {
    let (c, o) = (&inverse.matrix, &inverse.offset);
    let mut out = DMatrix::zeros(12, 12);
    for axis in 0..3 {
        let column = c.column(axis) * scale[axis];
        for i in 0..3 {
            out[(9 + i, 4 * axis)] = -column[i];
            for k in 0..3 {
                for j in 0..3 {
                    out[(3 * i + j, 4 * axis + 1 + k)] = -column[i] * c[(k, j)];
                }
                out[(9 + i, 4 * axis + 1 + k)] = -column[i] * o[k];
            }
        }
    }
    out
}
