//! Poses of the body by another instrument, and its clock against that of the recording.

use mimu::in_use::Trajectory;
use mimu_recording::units::median;
use nalgebra::{UnitQuaternion, Vector3};

use crate::series::Series;

/// Longest time between two poses that is bridged, s.
const APART_S: f64 = 0.2;
/// Time between the values that are compared to find the clock, s, and the largest difference of clocks that is searched, s.
const GRID_S: f64 = 0.02;
const SEARCHED_S: f64 = 30.0;

/// Correlation of the magnitudes of rates beyond which both are of one motion. Trials of one person alike reach 0.6.
const LIKE: f64 = 0.8;
/// Longest usual time between poses, s.
const SPARSE_S: f64 = 0.1;

/// Attitude (body to reference) and position, m, over time, s.
pub(super) struct Poses {
    pub t: Vec<f64>,
    pub attitude: Vec<UnitQuaternion<f64>>,
    pub position: Option<Vec<Vector3<f64>>>,
}

impl Poses {
    /// As the file has them; `reversed` if its quaternions turn from the reference to the body.
    pub fn of(trajectory: &Trajectory, reversed: bool) -> Self {
        let poses = trajectory.poses();
        let attitude = poses.iter().map(|pose| match reversed {
            true => pose.attitude.inverse(),
            false => pose.attitude,
        });
        Self {
            t: poses.iter().map(|pose| pose.t_s).collect(),
            attitude: attitude.collect(),
            position: trajectory
                .has_positions()
                .then(|| poses.iter().map(|pose| pose.position).collect()),
        }
    }

    /// Usual time between poses, s, if that is too long for what happens between.
    pub fn is_sparse(&self) -> Option<f64> {
        let between = median(self.t.windows(2).map(|w| w[1] - w[0]).collect())?;
        (between > SPARSE_S).then_some(between)
    }

    /// The pose next to a time.
    pub fn near(&self, t: f64) -> usize {
        let after = self.t.partition_point(|of| *of < t).min(self.t.len() - 1);
        let before = after.saturating_sub(1);
        match t - self.t[before] < self.t[after] - t {
            true => before,
            false => after,
        }
    }

    /// Whether no gap lies between two poses.
    pub fn is_dense(&self, from: usize, to: usize) -> bool {
        let mut pairs = self.t[from..=to].windows(2);
        pairs.all(|pair| pair[1] - pair[0] <= APART_S)
    }

    /// Attitude between poses, by the cubic through four rotations from the pose before. The shortest turn between two would err by an eighth of the angular acceleration times the
    /// square of the time between: 0.1 deg in motion by hand at 20 Hz, which gravity makes 20 mm/s².
    pub fn attitude_at(&self, t: f64) -> Option<UnitQuaternion<f64>> {
        let next = self.t.partition_point(|of| *of <= t);
        let at = next.checked_sub(1)?;
        if self.t[at] == t {
            return Some(self.attitude[at]);
        }
        if next == self.t.len() || !self.is_dense(at, next) {
            return None;
        }
        let around = (at.saturating_sub(1), (next + 1).min(self.t.len() - 1));
        let (first, last) = match self.is_dense(around.0, around.1) {
            true => around,
            false => (at, next),
        };
        let mut turn = Vector3::zeros();
        for k in (first..=last).filter(|k| *k != at) {
            let others = (first..=last).filter(|other| *other != k);
            let weight = others.map(|o| (t - self.t[o]) / (self.t[k] - self.t[o]));
            turn += weight.product::<f64>() * self.turn(at, k);
        }
        Some(self.attitude[at] * UnitQuaternion::from_scaled_axis(turn))
    }

    /// Turn between two poses as a rotation vector in the frame of the body at the first, rad.
    pub fn turn(&self, from: usize, to: usize) -> Vector3<f64> {
        (self.attitude[from].inverse() * self.attitude[to]).scaled_axis()
    }

    /// By how much the times of raw rates are later than those of the poses, s, to a hundredth of a second or so: where the magnitudes of both agree best.
    pub fn clock(&self, raw: &Series) -> Option<f64> {
        let stride = (GRID_S / median(self.t.windows(2).map(|w| w[1] - w[0]).collect())?)
            .round()
            .max(1.0) as usize;
        let ends: Vec<usize> = (0..self.t.len()).step_by(stride).collect();
        let rates = ends.windows(2).filter(|w| self.is_dense(w[0], w[1]));
        let rates = rates.map(|w| {
            let between = self.t[w[1]] - self.t[w[0]];
            let middle = self.t[w[0]] + 0.5 * between;
            (middle, self.turn(w[0], w[1]).norm() / between)
        });
        let rates: Vec<(f64, f64)> = rates.collect();
        let mean = raw.x.iter().sum::<Vector3<f64>>() / raw.len() as f64;
        let size = raw.clone().map(|u| Vector3::repeat((u - mean).norm()));
        let steps = (SEARCHED_S / GRID_S) as i32;
        let likeness = |lag: f64| {
            correlation(
                rates
                    .iter()
                    .filter_map(|(t, rate)| Some((*rate, size.line_at(t + lag)?.x))),
            )
        };
        let lags = (-steps..=steps).map(|k| f64::from(k) * GRID_S);
        let best = lags.max_by(|a, b| likeness(*a).total_cmp(&likeness(*b)))?;
        (likeness(best) > LIKE).then_some(best)
    }
}

/// Correlation of pairs; -1 for fewer than 50.
fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let pairs: Vec<(f64, f64)> = pairs.collect();
    let n = pairs.len() as f64;
    if n < 50.0 {
        return -1.0;
    }
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let product = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>();
    let xy = product(&|p| (p.0 - x) * (p.1 - y));
    let found = xy / (product(&|p| (p.0 - x).powi(2)) * product(&|p| (p.1 - y).powi(2))).sqrt();
    if found.is_nan() { -1.0 } else { found }
}
