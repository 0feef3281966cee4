//! A steady line: amplitude, phase and frequency by least squares over the whole series.

use std::f64::consts::TAU;

use nalgebra::{Matrix5, Vector5};

/// Blocks that the series is condensed to within the band of a line, for each bin of that band.
const BLOCKS: f64 = 16.0;
/// Steps of the refinement: from within a tenth of the resolution each squares the error.
const STEPS: usize = 4;
/// Samples after which a phasor that is turned sample by sample is set anew.
const PHASOR: usize = 1024;

/// `cos` and `sin` amplitudes of a line, phase zero in the middle of the series.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sinusoid {
    pub frequency_hz: f64,
    cos: f64,
    sin: f64,
}

impl Sinusoid {
    /// The one of the most power in `rates` within `half_width_hz` of `near_hz`. `None` where least squares find none in there.
    pub fn fit(rates: &[f64], dt_s: f64, near_hz: f64, half_width_hz: f64) -> Option<Self> {
        let start = coarse(rates, dt_s, near_hz, half_width_hz);
        let mut line = Self {
            frequency_hz: start,
            cos: 0.0,
            sin: 0.0,
        };
        for step in 0..=STEPS {
            // At first the amplitudes alone: without them there is no slope by frequency.
            line = line.refine(rates, dt_s, step > 0)?;
        }
        let stays = (line.frequency_hz - near_hz).abs() <= half_width_hz;
        (stays && line.cos.is_finite() && line.sin.is_finite()).then_some(line)
    }

    /// Mean square.
    pub fn power(&self) -> f64 {
        0.5 * (self.cos * self.cos + self.sin * self.sin)
    }

    /// Takes it off the series that it was fitted to.
    pub fn subtract(&self, rates: &mut [f64], dt_s: f64) {
        let middle = middle(rates.len());
        let mut phasor = Phasor::new(TAU * self.frequency_hz * dt_s);
        for (i, rate) in rates.iter_mut().enumerate() {
            let (sin, cos) = phasor.at(i, middle);
            *rate -= self.cos * cos + self.sin * sin;
        }
    }

    /// One step of Gauss–Newton on what is left of the series without the line.
    fn refine(&self, rates: &[f64], dt_s: f64, by_frequency: bool) -> Option<Self> {
        let middle = middle(rates.len());
        let half = middle.max(1.0);
        let mut phasor = Phasor::new(TAU * self.frequency_hz * dt_s);
        let (mut normal, mut right) = (Matrix5::<f64>::zeros(), Vector5::<f64>::zeros());
        let reference = rates.first().copied().unwrap_or(0.0);
        for (i, rate) in rates.iter().enumerate() {
            let (sin, cos) = phasor.at(i, middle);
            let along = (i as f64 - middle) / half;
            let slope = match by_frequency {
                true => along * (self.sin * cos - self.cos * sin),
                false => 0.0,
            };
            // The bias and its drift beside it: a mean of a thousand amplitudes is not orthogonal to a broken number of periods.
            let row = [cos, sin, slope, 1.0, along];
            let left = rate - reference - self.cos * cos - self.sin * sin;
            for j in 0..5 {
                right[j] += row[j] * left;
                for k in j..5 {
                    normal[(j, k)] += row[j] * row[k];
                }
            }
        }
        for j in 0..5 {
            for k in 0..j {
                normal[(j, k)] = normal[(k, j)];
            }
        }
        if !by_frequency {
            normal[(2, 2)] = 1.0;
        }
        let step = normal.cholesky()?.solve(&right);
        Some(Self {
            cos: self.cos + step[0],
            sin: self.sin + step[1],
            frequency_hz: self.frequency_hz + step[2] / (half * dt_s * TAU),
        })
    }
}

fn middle(samples: usize) -> f64 {
    0.5 * (samples as f64 - 1.0)
}

/// Sine and cosine of evenly spaced angles, turned from one to the next.
struct Phasor {
    step: f64,
    turn: (f64, f64),
    now: (f64, f64),
}

impl Phasor {
    fn new(step: f64) -> Self {
        Self {
            step,
            turn: step.sin_cos(),
            now: (0.0, 1.0),
        }
    }

    /// At sample `i`, which is the one after that of the last call.
    fn at(&mut self, i: usize, middle: f64) -> (f64, f64) {
        if i.is_multiple_of(PHASOR) {
            self.now = ((i as f64 - middle) * self.step).sin_cos();
        } else {
            let ((s, c), (ds, dc)) = (self.now, self.turn);
            self.now = (s * dc + c * ds, c * dc - s * ds);
        }
        self.now
    }
}

/// Frequency of the most power within `half_width_hz` of `near_hz`, to a sixth of the resolution of the whole series: of the sums of blocks
/// that were turned back by `near_hz`, which hold everything within a few of their own bins.
fn coarse(rates: &[f64], dt_s: f64, near_hz: f64, half_width_hz: f64) -> f64 {
    let block = ((1.0 / (BLOCKS * half_width_hz * dt_s)) as usize).clamp(1, rates.len());
    let middle = middle(rates.len());
    let mut phasor = Phasor::new(TAU * near_hz * dt_s);
    let mut sums = vec![(0.0, 0.0); rates.len().div_ceil(block)];
    let mean = rates.iter().sum::<f64>() / rates.len() as f64;
    for (i, rate) in rates.iter().enumerate() {
        let (sin, cos) = phasor.at(i, middle);
        let sum: &mut (f64, f64) = &mut sums[i / block];
        sum.0 += (rate - mean) * cos;
        sum.1 -= (rate - mean) * sin;
    }
    let power = |offset_hz: f64| {
        let angle = -TAU * offset_hz * dt_s * block as f64;
        let mut total = (0.0, 0.0);
        for (k, (re, im)) in sums.iter().enumerate() {
            let (s, c) = (angle * k as f64).sin_cos();
            total.0 += re * c - im * s;
            total.1 += re * s + im * c;
        }
        total.0 * total.0 + total.1 * total.1
    };
    let resolution = 1.0 / (rates.len() as f64 * dt_s);
    let steps = (half_width_hz / resolution * 3.0).ceil() as i64;
    let offsets = (-steps..=steps).map(|k| half_width_hz * k as f64 / steps as f64);
    let best = offsets.max_by(|a, b| power(*a).total_cmp(&power(*b)));
    near_hz + best.unwrap_or(0.0)
}
