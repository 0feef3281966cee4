//! Rows of dwells whose input is known.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Vector3};

use super::build::{Builder, Part};
use super::{Row, RowFigure, Stratum, shared_by_several};
use crate::estimate::{Observation, earth_shared};
use crate::observable::{Observable, StratumName};
use crate::quantity::Sensor;
use crate::signal::contrast::Contrast;
use crate::triad::Forward;

/// First derivative by a delay, of one for each axis if an input moves. Before it are those by bias and matrix row of each axis.
const DELAYS: usize = 12;

impl Builder<'_> {
    /// A row for each dwell and sensor axis, and one for each contrast; `accel` is the calibrated accelerometer, for the forces on a gyro.
    pub(super) fn known(
        mut self,
        inverse: &Affine<f64>,
        accel: Option<&Affine<f64>>,
    ) -> Option<Part> {
        let forward = Forward::of(inverse)?;
        let (prepared, scale) = (self.prepared, self.scale);
        let unknown = prepared.observations(self.sensor);
        // The rows are errors after the likeliest rate of the Earth; its size remains in the covariance.
        let observations = earth_shared::likely(&unknown, &forward.matrix);
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
        for (dwell, range) in dwells.iter().zip(&conditions) {
            self.follow(*dwell, range, &forward);
        }
        let contrasts = prepared.contrasts();
        let within: Vec<(&Contrast, Observation)> = contrasts
            .iter()
            .filter_map(|c| Some((c, prepared.observation(self.sensor, c)?)))
            .collect();
        let list = &prepared.dwells.list;
        let moves = dwells.iter().any(|d| list[*d].moves(self.sensor)) && !within.is_empty();
        let columns = if moves { DELAYS + 3 } else { DELAYS };
        let count = 3 * (n + within.len());
        let random_walk = self.random_walk(&dwells);
        let mut y = Vec::new();
        let mut nuisance = DMatrix::zeros(count, columns);
        let mut by_matrix = DMatrix::zeros(count, 9);
        let readings: Vec<Vector3<f64>> = observations
            .iter()
            .map(|o| forward.apply(&o.input))
            .collect();
        let centre = readings.iter().sum::<Vector3<f64>>() / n as f64;
        let mut strata = Vec::new();
        // Writes a row of the nuisance: derivatives of an observation by the parameters of `axis`.
        let mut derivatives =
            |row: usize, o: &Observation, axis: usize, bias: f64, reading: Vector3<f64>| {
                nuisance[(row, 4 * axis)] = bias;
                for k in 0..3 {
                    nuisance[(row, 4 * axis + 1 + k)] = o.input[k];
                }
                // For u = P x + b the derivative by C is -P dC (u - b). A bias absorbs its constant part.
                for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    by_matrix[(row, 3 * r + c)] =
                        forward.matrix[(axis, r)] * reading[c] / scale[axis];
                }
                if moves {
                    let change = (forward.matrix.row(axis) * o.change)[(0, 0)];
                    nuisance[(row, DELAYS + axis)] = -change / scale[axis];
                }
            };
        for axis in 0..3 {
            for (i, o) in observations.iter().enumerate() {
                derivatives(y.len(), o, axis, 1.0, readings[i] - centre);
                let predicted = readings[i][axis];
                self.mean_row(o.dwell, &conditions[i], Vector3::ith(axis, 1.0));
                y.push((o.raw[axis] - predicted) / scale[axis]);
            }
            let s2 = scale[axis] * scale[axis];
            let mut known = DMatrix::from_fn(n, n, |i, j| match (i == j, &wander) {
                (true, _) => observations[i].variance[axis] / s2,
                (_, Some(w)) => w[axis][(dwells[i], dwells[j])] / s2,
                _ => 0.0,
            });
            let (mut by_earth, mut open) = (None, None);
            if unknown.iter().any(|o| o.earth.is_unknown()) {
                let mut alone = DVector::zeros(n);
                let shared = earth_shared::factor(&unknown, axis, &forward.matrix, &mut alone);
                open = shared_by_several(&shared, &mut alone).map(|shared| shared / scale[axis]);
                alone /= s2;
                known += DMatrix::from_diagonal(&alone);
                by_earth = Some(alone);
            }
            strata.push(Stratum {
                name: StratumName(Observable::Axis(axis), None),
                axis: Some(axis),
                session: 0,
                rows: axis * n..(axis + 1) * n,
                known,
                by_reference: None,
                by_earth,
                open,
                random_walk: Some(random_walk.clone()),
                wander_known: wander.is_some(),
                within: false,
            });
        }
        // A bias that wanders as fast as the input is in the known variance, and a slower one cancels in a contrast. So contrasts share no
        // noise with the means.
        for axis in 0..if within.is_empty() { 0 } else { 3 } {
            let from = y.len();
            for (contrast, o) in &within {
                derivatives(y.len(), o, axis, 0.0, forward.matrix * o.input);
                let place = dwells.partition_point(|d| *d < contrast.dwell);
                self.contrast_row(contrast, &conditions[place], axis);
                let predicted = (forward.matrix.row(axis) * o.input)[(0, 0)];
                y.push((o.raw[axis] - predicted) / scale[axis]);
            }
            let s2 = scale[axis] * scale[axis];
            let variances = within.iter().map(|(_, o)| o.variance[axis] / s2);
            let known = DVector::from_iterator(within.len(), variances);
            strata.push(Stratum {
                name: StratumName(Observable::Within(axis), None),
                // A row is not a function of one quantity, so it is not drawn against one.
                axis: None,
                session: 0,
                rows: from..y.len(),
                known: DMatrix::from_diagonal(&known),
                by_reference: None,
                by_earth: None,
                open: None,
                random_walk: None,
                wander_known: true,
                within: true,
            });
        }
        let figure = (RowFigure::Input, count, 1);
        let parameters = by_forward(inverse, &scale).resize_horizontally(columns, 0.0);
        // A delay belongs to the session, as a bias does, because the clocks do.
        let biases = [0, 4, 8].into_iter().chain(DELAYS..columns).collect();
        self.finish(y, (nuisance, parameters, by_matrix), biases, strata, figure)
    }

    /// Sets the angular acceleration and the reading of a dwell with a moving input to those that the reference predicts. The measured reading
    /// of a block has noise that is in the contrasts as well, and bits of its code seemed to explain that: two of three clean gyros seemed to
    /// have converter nonlinearity.
    fn follow(&mut self, dwell: usize, conditions: &Range<usize>, forward: &Forward) {
        let prepared = self.prepared;
        let list = &prepared.dwells.list[dwell];
        if list.moves == [false; 2] {
            return;
        }
        let Some(course) = prepared.course(list) else {
            return;
        };
        for (k, block) in course.blocks.iter().enumerate() {
            let at = &mut self.conditions[conditions.start + block - list.blocks.start];
            if let (true, Some([_, change])) =
                (list.moves(Sensor::Gyro), &course.of[Sensor::Gyro as usize])
            {
                at.angular_acceleration = change[k];
            }
            if let Some([input, _]) = &course.of[self.sensor as usize] {
                at.reading.mean = forward.apply(&input[k]);
            }
        }
    }

    /// Adds the row of `contrast`: a weighted sum over a dwell of an error of `axis`.
    fn contrast_row(&mut self, contrast: &Contrast, conditions: &Range<usize>, axis: usize) {
        let weights = contrast.weights.iter();
        self.rows.push(Row {
            conditions: conditions.clone(),
            weights: weights.map(|w| Vector3::ith(axis, *w)).collect(),
            dwells: [contrast.dwell; 2],
            moving: true,
        });
    }
}

/// What the bias and the matrix row of each axis of the forward model, in SI, add to the inverse model: C by rows, then o.
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
