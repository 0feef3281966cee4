//! Rows of dwells whose input is known.

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, RowVector3, Vector3};

use super::build::{Builder, Part};
use super::{Row, RowFigure, Stratum, shared_by_several};
use crate::diagnose::columns::beside;
use crate::estimate::{Observation, earth_shared};
use crate::fit::lever_arm;
use crate::observable::{Observable, StratumName};
use crate::quantity::Sensor;
use crate::signal::contrast::Contrast;
use crate::triad::Forward;

/// First derivative by a delay, of one for each axis if an input moves. Before it are those by bias and matrix row of each axis.
const DELAYS: usize = 12;

/// The observations of a sensor by a table, and their rows so far.
struct ByTable {
    forward: Forward,
    scale: Vector3<f64>,
    /// Mean readings of dwells as recorded, whose part by the Earth may be unknown.
    unknown: Vec<Observation>,
    /// The same with the likeliest rate of the Earth.
    means: Vec<Observation>,
    /// Readings that the model predicts for them, and the mean of these.
    readings: Vec<Vector3<f64>>,
    centre: Vector3<f64>,
    /// Dwell of each of them.
    dwells: Vec<usize>,
    /// Contrasts, and what the sensor reads in them.
    within: Vec<(Contrast, Observation)>,
    /// Whether the input moves, so that a delay shows.
    moves: bool,
    y: Vec<f64>,
    nuisance: DMatrix<f64>,
    by_matrix: DMatrix<f64>,
}

impl ByTable {
    /// `None` if the model is singular, or if there are no observations.
    fn of(builder: &Builder, inverse: &Affine<f64>) -> Option<Self> {
        let forward = Forward::of(inverse)?;
        let (prepared, sensor) = (builder.prepared, builder.sensor);
        let unknown = prepared.observations(sensor);
        // The rows are errors after the likeliest rate of the Earth; its size remains in the covariance.
        let means = earth_shared::likely(&unknown, &forward.matrix);
        if means.is_empty() {
            return None;
        }
        let dwells: Vec<usize> = means.iter().map(|o| o.dwell).collect();
        let readings: Vec<Vector3<f64>> = means.iter().map(|o| forward.apply(&o.input)).collect();
        let centre = readings.iter().sum::<Vector3<f64>>() / means.len() as f64;
        let within = prepared.contrasts().into_iter().filter_map(|c| {
            let o = prepared.observation(sensor, &c)?;
            Some((c, o))
        });
        let within: Vec<(Contrast, Observation)> = within.collect();
        let list = &prepared.dwells.list;
        let moves = dwells.iter().any(|d| list[*d].moves(sensor)) && !within.is_empty();
        let columns = if moves { DELAYS + 3 } else { DELAYS };
        let count = 3 * (means.len() + within.len());
        Some(Self {
            forward,
            scale: builder.scale,
            unknown,
            means,
            readings,
            centre,
            dwells,
            within,
            moves,
            y: Vec::new(),
            nuisance: DMatrix::zeros(count, columns),
            by_matrix: DMatrix::zeros(count, 9),
        })
    }

    /// Adds a row: the residual of an observation of `axis`, and its derivatives by the parameters of that axis.
    fn add(
        &mut self,
        o: &Observation,
        axis: usize,
        bias: f64,
        reading: Vector3<f64>,
        predicted: f64,
    ) {
        let (row, scale) = (self.y.len(), self.scale[axis]);
        let matrix = &self.forward.matrix;
        self.nuisance[(row, 4 * axis)] = bias;
        for k in 0..3 {
            self.nuisance[(row, 4 * axis + 1 + k)] = o.input[k];
        }
        // For u = P x + b the derivative by C is -P dC (u - b). A bias absorbs its constant part.
        for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
            self.by_matrix[(row, 3 * r + c)] = matrix[(axis, r)] * reading[c] / scale;
        }
        if self.moves {
            let change = (matrix.row(axis) * o.change)[(0, 0)];
            self.nuisance[(row, DELAYS + axis)] = -change / scale;
        }
        self.y.push((o.raw[axis] - predicted) / scale);
    }

    fn add_mean(&mut self, i: usize, axis: usize) {
        let (o, reading) = (self.means[i], self.readings[i]);
        self.add(&o, axis, 1.0, reading - self.centre, reading[axis]);
    }

    fn add_contrast(&mut self, k: usize, axis: usize) {
        let o = self.within[k].1;
        let matrix = self.forward.matrix;
        let predicted = (matrix.row(axis) * o.input)[(0, 0)];
        self.add(&o, axis, 0.0, matrix * o.input, predicted);
    }

    /// With the wander of the bias of `axis`, if that is known.
    fn stratum_of_means(
        &self,
        axis: usize,
        wander: Option<&DMatrix<f64>>,
        random_walk: &DMatrix<f64>,
    ) -> Stratum {
        let n = self.means.len();
        let s2 = self.scale[axis] * self.scale[axis];
        let dwells = &self.dwells;
        let mut known = DMatrix::from_fn(n, n, |i, j| match (i == j, wander) {
            (true, _) => self.means[i].variance[axis] / s2,
            (_, Some(w)) => w[(dwells[i], dwells[j])] / s2,
            _ => 0.0,
        });
        let (mut by_earth, mut open) = (None, None);
        if self.unknown.iter().any(|o| o.earth.is_unknown()) {
            let mut alone = DVector::zeros(n);
            let matrix = &self.forward.matrix;
            let shared = earth_shared::factor(&self.unknown, axis, matrix, &mut alone);
            let shared = shared_by_several(&shared, &mut alone);
            open = shared.map(|shared| shared / self.scale[axis]);
            alone /= s2;
            known += DMatrix::from_diagonal(&alone);
            by_earth = Some(alone);
        }
        Stratum {
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
        }
    }

    /// Of the rows added last.
    fn stratum_of_contrasts(&self, axis: usize) -> Stratum {
        let n = self.within.len();
        let s2 = self.scale[axis] * self.scale[axis];
        let variances = self.within.iter().map(|(_, o)| o.variance[axis] / s2);
        let known = DVector::from_iterator(n, variances);
        Stratum {
            name: StratumName(Observable::Within(axis), None),
            // A row is not a function of one quantity, so it is not drawn against one.
            axis: None,
            session: 0,
            rows: self.y.len() - n..self.y.len(),
            known: DMatrix::from_diagonal(&known),
            by_reference: None,
            by_earth: None,
            open: None,
            random_walk: None,
            wander_known: true,
            within: true,
        }
    }
}

impl Builder<'_> {
    /// A row for each dwell and sensor axis, and one for each contrast; `accel` is the calibrated accelerometer, for the forces on a gyro.
    pub(super) fn known(
        mut self,
        inverse: &Affine<f64>,
        accel: Option<&Affine<f64>>,
    ) -> Option<Part> {
        let mut by_table = ByTable::of(&self, inverse)?;
        let dwells = by_table.dwells.clone();
        let conditions: Vec<Range<usize>> = dwells
            .iter()
            .map(|d| self.dwell(*d, self.force(*d, accel)))
            .collect();
        for (dwell, range) in dwells.iter().zip(&conditions) {
            self.follow(*dwell, range, &by_table.forward);
        }
        let wander = self
            .prepared
            .noise
            .wander(self.sensor, &self.prepared.dwells.list);
        let random_walk = self.random_walk(&dwells);
        let mut strata = Vec::new();
        for axis in 0..3 {
            for (i, dwell) in dwells.iter().enumerate() {
                by_table.add_mean(i, axis);
                self.mean_row(*dwell, &conditions[i], Vector3::ith(axis, 1.0));
            }
            let wander = wander.as_ref().map(|w| &w[axis]);
            strata.push(by_table.stratum_of_means(axis, wander, &random_walk));
        }
        // A bias that wanders as fast as the input is in the known variance, and a slower one cancels in a contrast. So contrasts share no
        // noise with the means.
        for axis in 0..if by_table.within.is_empty() { 0 } else { 3 } {
            for k in 0..by_table.within.len() {
                by_table.add_contrast(k, axis);
                let contrast = &by_table.within[k].0;
                let place = dwells.partition_point(|d| *d < contrast.dwell);
                self.contrast_row(contrast, &conditions[place], axis);
            }
            strata.push(by_table.stratum_of_contrasts(axis));
        }
        let ByTable {
            y,
            nuisance,
            by_matrix,
            ..
        } = by_table;
        let nuisance = match self.by_arm() {
            Some(by_arm) => beside(&nuisance, &by_arm),
            None => nuisance,
        };
        let (count, columns) = nuisance.shape();
        let figure = (RowFigure::Input, count, 1);
        let parameters = by_forward(inverse, &self.scale).resize_horizontally(columns, 0.0);
        // As a bias does, a delay belongs to the session, because the clocks do, and a lever arm, because the place on the table does.
        let biases = [0, 4, 8].into_iter().chain(DELAYS..columns).collect();
        self.finish(y, (nuisance, parameters, by_matrix), biases, strata, figure)
    }

    /// The rows by a lever arm of the whole unit, m; `None` if the table does not turn an accelerometer.
    fn by_arm(&self) -> Option<DMatrix<f64>> {
        let dwells = &self.prepared.dwells.list;
        let spins = self.rows.iter().any(|row| dwells[row.dwells[0]].spins());
        if self.sensor != Sensor::Accel || !spins {
            return None;
        }
        let rows = self.rows.iter().map(|row| {
            let by_block = lever_arm::by_block(self.prepared, &dwells[row.dwells[0]]);
            let each = row.weights.iter().zip(by_block);
            let each = each.map(|(weight, by)| weight.transpose() * self.direction * by);
            <[f64; 3]>::from(each.sum::<RowVector3<f64>>().transpose())
        });
        Some(DMatrix::from_row_iterator(rows.len(), 3, rows.flatten()))
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
