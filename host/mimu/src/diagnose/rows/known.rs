//! Rows of dwells whose input is known.
//!
//! A row is the reading of an axis minus its prediction by `u = P x + b`, over the scale factor. It is the error of the calibrated vector along the sensitive
//! direction, and is not a factor of [`crate::factor`]: the noise of the axes is independent in the readings only, and the derivatives are those at the
//! reading that the input predicts, whose noise is not in the row.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix3, RowVector3, Vector3};

use super::build::{Part, mean};
use super::{Row, Stratum, shared_by_several};
use crate::estimate::{Observation, earth_shared};
use crate::fit::lever_arm;
use crate::observable::Observable;
use crate::observation::{ALL, slope};
use crate::quantity::Sensor;
use crate::signal::contrast::Contrast;
use crate::triad::Forward;

impl Part<'_> {
    /// A row for each dwell and sensor axis, and one for each contrast. `None` if the model is singular, or if there are no observations.
    pub(super) fn add_known(&mut self) -> Option<()> {
        let (prepared, sensor) = (self.session.prepared, self.sensor);
        let forward = Forward::of(&self.model)?;
        let unknown = prepared.observations(sensor);
        // The rows are errors after the likeliest rate of the Earth; its size remains in the covariance.
        let means = earth_shared::likely(&unknown, &forward.matrix);
        if means.is_empty() {
            return None;
        }
        let readings: Vec<Vector3<f64>> = means.iter().map(|o| forward.apply(&o.input)).collect();
        self.centre = mean(readings.iter());
        self.free = &ALL[..9];
        let within = prepared.contrasts().into_iter();
        let within = within.filter_map(|c| Some((prepared.observation(sensor, &c)?, c)));
        let within: Vec<(Observation, Contrast)> = within.collect();
        let list = &prepared.dwells.list;
        let moves = means.iter().any(|o| list[o.dwell].moves(sensor)) && !within.is_empty();
        // A delay belongs to the session, because the clocks do.
        let delay = |o: &Observation, scale: f64, axis: usize| {
            let change = (forward.matrix.row(axis) * o.change)[(0, 0)];
            let mut own = vec![0.0; if moves { 3 } else { 0 }];
            own.iter_mut()
                .skip(axis)
                .take(1)
                .for_each(|d| *d = -change / scale);
            own
        };
        let dwells: Vec<usize> = means.iter().map(|o| o.dwell).collect();
        for dwell in &dwells {
            self.follow(*dwell, &forward);
        }
        let wander = prepared.noise.wander(sensor, list);
        let random_walk = self.random_walk(&dwells);
        for axis in 0..3 {
            let (from, scale) = (self.lines.len(), self.scale[axis]);
            let along = self.direction.row(axis).transpose();
            for (o, reading) in means.iter().zip(&readings) {
                let row = self.mean_over(o.dwell, Vector3::ith(axis, 1.0));
                let y = (o.raw[axis] - reading[axis]) / scale;
                self.add(y, &slope(&along, reading), delay(o, scale, axis), row);
            }
            let wander = wander.as_ref().map(|w| &w[axis]);
            let mut stratum = of_means(&means, (axis, scale), wander, from..self.lines.len());
            if unknown.iter().any(|o| o.earth.is_unknown()) {
                add_earth(&mut stratum, &unknown, (axis, scale), &forward.matrix);
            }
            stratum.random_walk = Some(random_walk.clone());
            self.strata.push(stratum);
        }
        // A bias that wanders as fast as the input is in the known variance, and a slower one cancels in a contrast. So contrasts share no
        // noise with the means.
        for axis in 0..if within.is_empty() { 0 } else { 3 } {
            let (from, scale) = (self.lines.len(), self.scale[axis]);
            let along = self.direction.row(axis).transpose();
            for (o, contrast) in &within {
                let reading = forward.matrix * o.input;
                // The bias cancels.
                let mut by = slope(&along, &reading);
                by.fixed_rows_mut::<3>(9).fill(0.0);
                let weights = contrast.weights.iter();
                let row = Row {
                    conditions: self.dwell(contrast.dwell),
                    weights: weights.map(|w| Vector3::ith(axis, *w)).collect(),
                    dwells: [contrast.dwell; 2],
                    moving: true,
                };
                let y = (o.raw[axis] - reading[axis]) / scale;
                self.add(y, &by, delay(o, scale, axis), row);
            }
            let variances = within
                .iter()
                .map(|(o, _)| o.variance[axis] / (scale * scale));
            let variances = DVector::from_iterator(within.len(), variances);
            let rows = from..self.lines.len();
            let stratum = Stratum::independent(Observable::Within(axis), rows, variances);
            self.strata.push(stratum);
        }
        self.add_arm();
        Some(())
    }

    /// Adds the derivatives by a lever arm of the whole unit, m, if the table turns an accelerometer. It belongs to the session, because the place on the
    /// table does.
    fn add_arm(&mut self) {
        let prepared = self.session.prepared;
        let dwells = &prepared.dwells.list;
        let mut all = self.lines.iter();
        let spins = all.any(|line| dwells[line.row.dwells[0]].spins());
        if self.sensor != Sensor::Accel || !spins {
            return;
        }
        for line in &mut self.lines {
            let by_block = lever_arm::by_block(prepared, &dwells[line.row.dwells[0]]);
            let each = line.row.weights.iter().zip(by_block);
            let each = each.map(|(weight, by)| weight.transpose() * self.direction * by);
            line.own.extend(each.sum::<RowVector3<f64>>().iter());
        }
    }

    /// Sets the angular acceleration and the reading of a dwell with a moving input to those that the reference predicts. The measured reading
    /// of a block has noise that is in the contrasts as well, and bits of its code seemed to explain that: two of three clean gyros seemed to
    /// have converter nonlinearity.
    fn follow(&mut self, dwell: usize, forward: &Forward) {
        let conditions = self.dwell(dwell);
        let prepared = self.session.prepared;
        let list = &prepared.dwells.list[dwell];
        if list.moves == [false; 2] {
            return;
        }
        let Some(course) = prepared.course(list) else {
            return;
        };
        for (k, block) in course.blocks.iter().enumerate() {
            let at = conditions.start + block - list.blocks.start;
            if let (true, Some([_, change])) =
                (list.moves(Sensor::Gyro), &course.of[Sensor::Gyro as usize])
            {
                self.conditions[at].angular_acceleration = change[k];
            }
            if let Some([input, _]) = &course.of[self.sensor as usize] {
                self.readings[at] = forward.apply(&input[k]);
            }
        }
    }
}

/// Dwell means of an axis with this scale factor, and the wander of its bias, if that is known.
fn of_means(
    means: &[Observation],
    (axis, scale): (usize, f64),
    wander: Option<&DMatrix<f64>>,
    rows: Range<usize>,
) -> Stratum {
    let s2 = scale * scale;
    let variances = means.iter().map(|o| o.variance[axis] / s2);
    let variances = DVector::from_iterator(means.len(), variances);
    let mut stratum = Stratum::independent(Observable::Axis(axis), rows, variances);
    stratum.wander_known = wander.is_some();
    if let Some(wander) = wander {
        let n = means.len();
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            if i != j {
                stratum.known[(i, j)] = wander[(means[i].dwell, means[j].dwell)] / s2;
            }
        }
    }
    stratum
}

/// Adds the part of the Earth's rate that is unknown.
fn add_earth(
    stratum: &mut Stratum,
    unknown: &[Observation],
    (axis, scale): (usize, f64),
    matrix: &Matrix3<f64>,
) {
    let mut alone = DVector::zeros(unknown.len());
    let shared = earth_shared::factor(unknown, axis, matrix, &mut alone);
    let shared = shared_by_several(&shared, &mut alone);
    stratum.open = shared.map(|shared| shared / scale);
    alone /= scale * scale;
    stratum.known += DMatrix::from_diagonal(&alone);
    stratum.by_earth = Some(alone);
}
