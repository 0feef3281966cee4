//! What a gyro reads at rest: turns about the vertical are no rests, and the accelerometer does not show them.

use crate::signal::blocks::{OF_MEDIAN, quantile};
use crate::signal::window::Window;

/// If the temperature varies by less than this over all windows, K, it moves a bias by no more than hands do.
const LEVELS_FROM_K: f64 = 5.0;
/// Least width, K, and least number of windows (one minute) of a temperature bin with one level: a turn in a bin is then the smaller part
/// of it.
const LEVEL_K: f64 = 1.0;
const LEVEL_WINDOWS: usize = 600;
/// Largest deviation of a window at rest from its level, in sigmas of all windows.
const REACH_SIGMAS: f64 = 5.0;

/// Range of a channel's mean reading in windows at rest: the median of the quiet windows, plus or minus a margin and five of their standard
/// deviations, which include a drift of the bias.
///
/// A turn about the vertical does not show in the accelerometer, and a slow one hardly in the variance of the gyro. A bias that follows the
/// temperature looks like such a turn, so each window is compared with others at the same temperature, from which only a turn differs.
pub(crate) struct RateAtRest {
    /// Temperature and median reading, by temperature; a single pair if the temperature hardly changes.
    levels: Vec<(f64, f64)>,
    reach: f64,
}

impl RateAtRest {
    /// From the windows in which channel `c` is quiet; `margin` is added to the reach.
    pub fn of(at_rest: &[&Window], c: usize, margin: f64) -> Self {
        let mut by_temp: Vec<(f64, f64)> = at_rest.iter().map(|w| (w.temp_c, w.mean[c])).collect();
        by_temp.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ends = by_temp.first().zip(by_temp.last());
        let changes = ends.is_some_and(|(a, b)| b.0 - a.0 > LEVELS_FROM_K);
        let mut bins: Vec<&[(f64, f64)]> = Vec::new();
        let mut from = 0;
        for i in 0..by_temp.len() {
            let full = changes
                && i - from >= LEVEL_WINDOWS
                && by_temp[i].0 - by_temp[from].0 >= LEVEL_K
                && by_temp.len() - i >= LEVEL_WINDOWS;
            if full {
                bins.push(&by_temp[from..i]);
                from = i;
            }
        }
        bins.push(&by_temp[from..]);
        let level = |bin: &&[(f64, f64)]| {
            let median = |of: fn(&(f64, f64)) -> f64| {
                let mut values: Vec<f64> = bin.iter().map(of).collect();
                quantile(&mut values, 0.5)
            };
            Some((median(|w| w.0)?, median(|w| w.1)?))
        };
        let mut rate = Self {
            levels: bins.iter().filter_map(level).collect(),
            reach: f64::INFINITY,
        };
        let mut deviations: Vec<f64> = at_rest
            .iter()
            .map(|w| (w.mean[c] - rate.level(w.temp_c)).abs())
            .collect();
        let sigma = OF_MEDIAN * quantile(&mut deviations, 0.5).unwrap_or(0.0);
        rate.reach = margin + REACH_SIGMAS * sigma;
        rate
    }

    /// Interpolated linearly between the levels of the nearest temperatures; beyond them, extrapolated through the last two.
    fn level(&self, temp_c: f64) -> f64 {
        let [first, .., last] = self.levels.as_slice() else {
            return self.levels.first().map_or(0.0, |l| l.1);
        };
        if !temp_c.is_finite() {
            return 0.5 * (first.1 + last.1);
        }
        let k = self.levels.partition_point(|l| l.0 < temp_c);
        let k = k.clamp(1, self.levels.len() - 1);
        let [(t0, a), (t1, b)] = [self.levels[k - 1], self.levels[k]];
        a + (b - a) * (temp_c - t0) / (t1 - t0)
    }

    /// Whether channel `c` reads in `window` what it reads at rest.
    pub fn has(&self, window: &Window, c: usize) -> bool {
        let off = window.mean[c] - self.level(window.temp_c);
        self.levels.is_empty() || off.abs() <= self.reach
    }
}
