//! Where to look: waves and steps against the reading, and zeros of a converter of the usual weight.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::sight::{Sight, ends, median_sd, range};
use crate::diagnose::library::readout::{BITS, Converter};
use crate::diagnose::rows::RowReading;

/// Periods are looked at so many to a cycle over the range of the readings.
const OVERSAMPLED: f64 = 2.5;
/// Most periods.
const PERIODS: usize = 4000;
/// Most places times readings: of a recording by hand every 10 ms of a turn is a reading, and all periods of all would take a minute.
const EVALUATIONS: usize = 4_000_000;
/// Places that are looked at all the same.
const FEWEST: usize = 100;
/// Cycles in a standard deviation of the readings: more, and noise has levelled five sixths of the wave.
const FINEST: f64 = 0.3;
/// Most places of a step.
const STEPS: usize = 256;
/// Waves, and steps, that are followed up. The highest wave may be a third harmonic.
const WAVES: usize = 6;
const FOLLOWED_STEPS: usize = 2;
/// Zeros of a converter of the usual weight, a power of two times the step of the readings, that are looked at.
pub(super) const ZEROS: usize = 1024;
/// And followed up.
const FOLLOWED_ZEROS: usize = 4;
/// Phases and directions that a period stands for, as tests.
const PHASES: f64 = 4.0;

impl Sight {
    /// Waves and steps against the reading, as the converter that each would be the heaviest bit of, the best first, and how many places
    /// were looked at.
    pub(super) fn first_sight(&self, readings: &[RowReading]) -> (Vec<(f64, Converter)>, f64) {
        let sd = median_sd(readings);
        let cycle = 1.0 / (OVERSAMPLED * range(readings));
        let finest = (FINEST / sd / cycle).min(affordable(readings, PERIODS) as f64);
        let waves: Vec<(f64, Converter)> = (1..finest as usize)
            .into_par_iter()
            .filter_map(|k| self.wave(readings, k as f64 * cycle))
            .collect();
        let mut levels: Vec<f64> = readings.iter().map(|r| r.mean).collect();
        levels.sort_by(f64::total_cmp);
        let every = levels.len().div_ceil(STEPS).max(1);
        let between = levels.windows(2).step_by(every);
        let places: Vec<f64> = between.map(|w| 0.5 * (w[0] + w[1])).collect();
        let steps: Vec<(f64, Converter)> = places
            .par_iter()
            .filter_map(|at| self.step(readings, *at))
            .collect();
        let count = PHASES * waves.len() as f64 + 2.0 * steps.len() as f64;
        let mut followed = peaks(waves, WAVES);
        followed.extend(peaks(steps, FOLLOWED_STEPS));
        followed.sort_by(|a, b| b.0.total_cmp(&a.0));
        (followed, count)
    }

    /// Converters of the usual weight that fit best: of their zeros nothing is known, and with all bits at work no single wave says it.
    pub(super) fn usual(&self, readings: &[RowReading]) -> Vec<(f64, Converter)> {
        let Some(step) = self.step else {
            return Vec::new();
        };
        let (lowest, highest) = ends(readings);
        let weight = step * ((highest - lowest) / step).log2().ceil().exp2();
        let all: [usize; BITS] = std::array::from_fn(|bit| bit);
        let zeros = affordable(readings, ZEROS);
        let at = |k: usize| {
            // Bits of a zero one weight further are the same, but for the sign of the first.
            let zero = lowest - weight * (k + 1) as f64 / zeros as f64;
            let converter = Converter::of(weight, zero);
            let normal = self.bits(readings, &converter, &all);
            Some((self.drop(normal.explains_with_ridge()?), converter))
        };
        let all: Vec<_> = (0..zeros).into_par_iter().filter_map(at).collect();
        peaks(all, FOLLOWED_ZEROS)
    }

    fn wave(&self, readings: &[RowReading], frequency: f64) -> Option<(f64, Converter)> {
        let normal = self.normal(readings, 2, |r, out| {
            let (sin, cos) = (2.0 * PI * frequency * r.mean).sin_cos();
            let left = (-2.0 * (PI * frequency * r.sd).powi(2)).exp();
            (out[0], out[1]) = (left * cos, left * sin);
        });
        let explained = normal.explains(&[0, 1], f64::INFINITY)?;
        let of = normal.matrix.cholesky()?.solve(&normal.with_left);
        // Of a bit the share is 1/2 - 2/π sin(2π f (u - zero)) and so on; of which sign its error is does not matter here.
        let zero = f64::atan2(-of[0], of[1]) / (2.0 * PI * frequency);
        let weight = 0.5 / frequency;
        Some((self.drop(explained), Converter::of(weight, zero)))
    }

    fn step(&self, readings: &[RowReading], at: f64) -> Option<(f64, Converter)> {
        // So heavy that it turns nowhere else.
        let weight = 2.0 * range(readings);
        let zero = at - weight;
        let converter = Converter::of(weight, zero);
        let normal = self.normal(readings, 1, |r, out| {
            out[0] = converter.share(0, r.mean, r.sd);
        });
        let own = normal.matrix[(0, 0)];
        (own > 0.0).then(|| (self.drop(normal.with_left[0].powi(2) / own), converter))
    }
}

/// So many places, or as many as so many readings leave time for: of periods the longest.
pub(super) fn affordable(readings: &[RowReading], places: usize) -> usize {
    (EVALUATIONS / readings.len().max(1)).clamp(FEWEST, places)
}

/// The highest of some places in a row, none beside a higher one.
fn peaks(all: Vec<(f64, Converter)>, most: usize) -> Vec<(f64, Converter)> {
    let before = |k: usize| k.checked_sub(1).map_or(f64::NEG_INFINITY, |k| all[k].0);
    let after = |k: usize| all.get(k + 1).map_or(f64::NEG_INFINITY, |a| a.0);
    let mut peaks: Vec<_> = (0..all.len())
        .filter(|k| all[*k].0 >= before(*k) && all[*k].0 > after(*k))
        .map(|k| all[k])
        .collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(most);
    peaks
}
