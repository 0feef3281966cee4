//! Dwells in which no bias explains the gyro's reading: slow turns about the vertical, which the accelerometer does not show.
//!
//! At rest a gyro reads its bias and a term that is linear in the force, its g-sensitivity. The reading of each dwell is compared with the
//! prediction of such a model from the other dwells: the studentised deletion residual. [`crate::signal::rest`] finds even turns by the
//! median of three neighbours instead. Its scatter includes the g-sensitivity, so it misses turns of some tenths of a degree per second.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::quantity::Sensor;
use crate::signal::rest::expected;

/// Bias, and the force along three axes.
const PARAMETERS: usize = 4;
/// With so many parameters, fewer dwells do not show what is usual.
const FEWEST: usize = 12;
/// Largest share of dwells that may be slow turns; beyond it, it is unknown which dwells are rests.
const MOST: f64 = 0.25;
/// One of so many dwells is removed at once, so that the number of fits does not grow with that of the dwells.
const AT_ONCE: usize = 128;
/// Probability that any dwell of a recording at rest is mistaken for a turn because of noise.
const FALSE_ALARM: f64 = 1e-3;
/// Least limit on a deviation, in sigmas of the scatter: biases wander from dwell to dwell, and their tails are longer than those of noise.
const SIGMAS: f64 = 6.0;

/// Means of a dwell, and its length.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reading {
    /// Raw channels.
    pub mean: [f64; 6],
    /// Length, s.
    pub duration_s: f64,
}

/// Which of `readings` are slow turns.
pub(crate) fn find(readings: &[Reading]) -> Vec<bool> {
    let n = readings.len();
    let mut found = vec![false; n];
    if n < FEWEST {
        return found;
    }
    for c in Sensor::Gyro.channels() {
        let suspects = of_channel(readings, c);
        for k in suspects {
            found[k] = true;
        }
    }
    let count = found.iter().filter(|slow| **slow).count();
    match count as f64 <= MOST * n as f64 {
        true => found,
        // So many cannot be exceptions: the sensor does this at rest.
        false => vec![false; n],
    }
}

/// The slow turns that channel `c` shows. The quarter of the dwells that fits worst is removed first, so that turns do not hide each other.
/// Dwells that the rest predicts are then restored. If a dwell agrees with its neighbours in time, its bias drifts or warms up, and it is
/// not a turn.
fn of_channel(readings: &[Reading], c: usize) -> Vec<usize> {
    let n = readings.len();
    let mut kept: Vec<usize> = (0..n).collect();
    let least = n - (MOST * n as f64) as usize;
    while kept.len() > least {
        let Some(fit) = Fit::of(readings, &kept, c) else {
            return Vec::new();
        };
        let deleted = kept.iter().map(|k| fit.deleted(&readings[*k], c));
        let mut order: Vec<(usize, f64)> = deleted.enumerate().collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let count = (n / AT_ONCE).clamp(1, kept.len() - least);
        let mut worst: Vec<usize> = order[..count].iter().map(|(at, _)| *at).collect();
        worst.sort_unstable();
        for at in worst.into_iter().rev() {
            kept.remove(at);
        }
    }
    loop {
        let Some(fit) = Fit::of(readings, &kept, c) else {
            return Vec::new();
        };
        let limit = fit.limit(n);
        let outside = (0..n).filter(|k| !kept.contains(k));
        let back: Vec<usize> = outside
            .filter(|k| fit.predicted(&readings[*k], c) <= limit)
            .collect();
        if back.is_empty() {
            let off: Vec<f64> = readings.iter().map(|r| fit.off(r, c)).collect();
            let strays = |k: &usize| {
                let (level, trend) = expected(&off, *k);
                let least = limit * fit.sigma(&readings[*k]);
                (off[*k] - level).abs() > least + trend
            };
            let outside = (0..n).filter(|k| !kept.contains(k));
            return outside.filter(strays).collect();
        }
        kept.extend(back);
        kept.sort_unstable();
    }
}

/// A channel's readings as a function of the force.
struct Fit {
    parameters: DVector<f64>,
    /// Inverse of the normal matrix.
    inverse: DMatrix<f64>,
    /// Variance of the residual of a dwell of one second.
    variance: f64,
    dof: f64,
    /// Divisor of the forces.
    size: f64,
}

fn row(reading: &Reading, size: f64) -> DVector<f64> {
    let [.., x, y, z] = reading.mean;
    DVector::from_vec(vec![1.0, x / size, y / size, z / size])
}

impl Fit {
    fn of(readings: &[Reading], kept: &[usize], c: usize) -> Option<Self> {
        let force = |r: &Reading| r.mean[3..].iter().map(|u| u * u).sum::<f64>().sqrt();
        let size = readings.iter().map(force).fold(0.0, f64::max);
        if !(size > 0.0) || kept.len() <= PARAMETERS + 2 {
            return None;
        }
        let mut normal = DMatrix::zeros(PARAMETERS, PARAMETERS);
        let mut right = DVector::zeros(PARAMETERS);
        for k in kept {
            let (row, weight) = (row(&readings[*k], size), readings[*k].duration_s);
            normal += weight * &row * row.transpose();
            right += weight * readings[*k].mean[c] * row;
        }
        let inverse = normal.try_inverse()?;
        let parameters = &inverse * right;
        let squares = kept.iter().map(|k| {
            let off = readings[*k].mean[c] - row(&readings[*k], size).dot(&parameters);
            readings[*k].duration_s * off * off
        });
        let dof = (kept.len() - PARAMETERS) as f64;
        let variance = squares.sum::<f64>() / dof;
        (variance > 0.0).then_some(Self {
            parameters,
            inverse,
            variance,
            dof,
            size,
        })
    }

    /// Reading of a dwell minus the prediction, raw.
    fn off(&self, reading: &Reading, c: usize) -> f64 {
        reading.mean[c] - row(reading, self.size).dot(&self.parameters)
    }

    /// Standard deviation of that, raw.
    fn sigma(&self, reading: &Reading) -> f64 {
        (self.variance / reading.duration_s).sqrt()
    }

    /// Residual of a dwell, scaled to one second, and its leverage.
    fn residual(&self, reading: &Reading, c: usize) -> (f64, f64) {
        let row = row(reading, self.size);
        let off = self.off(reading, c);
        let leverage = reading.duration_s * (row.transpose() * &self.inverse * &row)[0];
        (off * reading.duration_s.sqrt(), leverage)
    }

    /// Deletion residual of a dwell that was fitted, in standard deviations of the others.
    fn deleted(&self, reading: &Reading, c: usize) -> f64 {
        let (off, leverage) = self.residual(reading, c);
        // It can be judged only if another dwell predicts it.
        if leverage > 0.99 {
            return 0.0;
        }
        let own = off * off / (1.0 - leverage);
        let others = (self.variance * self.dof - own) / (self.dof - 1.0);
        (own / others.max(f64::MIN_POSITIVE)).sqrt()
    }

    /// The same for a dwell that was not fitted.
    fn predicted(&self, reading: &Reading, c: usize) -> f64 {
        let (off, leverage) = self.residual(reading, c);
        off.abs() / (self.variance * (1.0 + leverage)).sqrt()
    }

    /// Deviation beyond which one of `n` dwells of three axes is not a rest.
    fn limit(&self, n: usize) -> f64 {
        let by_chance = FALSE_ALARM / (6.0 * n as f64);
        let t = StudentsT::new(0.0, 1.0, self.dof);
        t.map_or(f64::INFINITY, |t| {
            t.inverse_cdf(1.0 - by_chance).max(SIGMAS)
        })
    }
}

#[cfg(test)]
mod tests {
    use mimu_rig::random::Random;

    use super::*;

    /// Twenty-two poses: biases in counts with noise of 1, g-sensitivity of 20 counts, and the turns given, in counts.
    fn session(seed: u64, turns: &[(usize, f64)]) -> Vec<Reading> {
        let mut noise = Random::new(seed, "slow turns");
        let mut random = || noise.normal();
        let by_force: [f64; 9] = std::array::from_fn(|_| 20.0 * random());
        let each = |k: usize| {
            let force: [f64; 3] = std::array::from_fn(|_| random());
            let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
            let force = force.map(|f| f / size);
            let up = turns
                .iter()
                .find(|(turned, _)| *turned == k)
                .map_or(0.0, |(_, rate)| *rate);
            let gyro: [f64; 3] = std::array::from_fn(|i| {
                let sag: f64 = (0..3).map(|j| by_force[3 * i + j] * force[j]).sum();
                2000.0 + sag + up * force[i] + random()
            });
            let [x, y, z] = force.map(|f| 8000.0 * f);
            Reading {
                mean: [gyro[0], gyro[1], gyro[2], x, y, z],
                duration_s: 4.0,
            }
        };
        (0..22).map(each).collect()
    }

    #[test]
    fn a_bias_that_warms_up_is_no_turn() {
        for seed in 1..=50 {
            let mut readings = session(seed, &[]);
            for (k, reading) in readings.iter_mut().enumerate() {
                reading.mean[0] += 100.0 * (-(k as f64) / 4.0).exp();
            }
            assert_eq!(find(&readings), [false; 22], "{seed}");
        }
    }

    #[test]
    fn turns_about_the_vertical_are_found_whatever_the_g_sensitivity_and_rests_are_kept() {
        let (mut kept, mut found) = (0, 0);
        for seed in 1..=200 {
            kept += find(&session(seed, &[]))
                .iter()
                .filter(|slow| **slow)
                .count();
            let turned = [(3, 30.0), (4, -25.0), (10, 20.0), (21, 25.0)];
            let slow = find(&session(seed, &turned));
            found += turned.iter().filter(|(k, _)| slow[*k]).count();
            let wrong = (0..22).filter(|k| slow[*k] && turned.iter().all(|(t, _)| t != k));
            kept += wrong.count();
        }
        assert!(kept <= 2, "{kept} rests of 8000 are taken for turns");
        assert!(found >= 760, "{found} turns of 800 are found");
    }
}
