//! One analog axis: sensed input → noise → low-pass → sensitivity and null → rails.

use crate::filter::LowPass;
use crate::noise::{Coefficients, Noise};
use crate::random::Random;
use crate::rotation::{Vector, dot, norm, scale};

/// Truth of an axis. "raw" is volts at the pin, or counts of a digital part; inputs are in rad/s or m/s².
#[derive(Debug, Clone, PartialEq)]
pub struct AxisTruth {
    /// Sensitive direction in body axes, unit length.
    pub direction: Vector,
    /// Raw per SI, at the nominal supply.
    pub sensitivity: f64,
    /// Raw at no input, at the nominal supply.
    pub null: f64,
    /// Output filter of the part, -3 dB, Hz. Infinity: none.
    pub bandwidth_hz: f64,
    /// External RC filter, -3 dB, Hz. Infinity: none.
    pub rc_hz: f64,
    /// Noise before the filters.
    pub noise: Coefficients,
    /// Noise of each reading after the filters, standard deviation, raw: for models that specify it this way.
    pub white_per_sample: f64,
    /// Lowest output, raw at the nominal supply.
    pub low: f64,
    /// Highest output, raw at the nominal supply.
    pub high: f64,
}

/// Three axes of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct TriadTruth {
    /// Axes x, y, z.
    pub axes: [AxisTruth; 3],
    /// Output in proportion to the supply.
    pub ratiometric: bool,
    /// Output in volts; otherwise in counts, on which dividers and references have no effect.
    pub analog: bool,
    /// Raw reading of the converter's lowest code at the nominal reference.
    pub code_low: f64,
    /// Raw readings from the lowest code to one beyond the highest, at the nominal reference.
    pub code_span: f64,
}

impl TriadTruth {
    /// Forward model `raw = matrix · input + bias` in raw per SI and raw; rows are axes, columns body
    /// directions.
    pub fn affine(&self) -> ([Vector; 3], Vector) {
        let rows = self
            .axes
            .each_ref()
            .map(|a| scale(a.sensitivity, a.direction));
        (rows, self.axes.each_ref().map(|a| a.null))
    }

    /// The same from a forward model: each row's length is a sensitivity, its direction a sensitive axis.
    pub fn set_affine(&mut self, matrix: &[Vector; 3], bias: &Vector) {
        for (i, axis) in self.axes.iter_mut().enumerate() {
            axis.sensitivity = norm(matrix[i]);
            axis.direction = scale(1.0 / axis.sensitivity, matrix[i]);
            axis.null = bias[i];
        }
    }

    /// Lag of its low-passes behind a slow input, mean of the axes, s.
    pub fn lag_s(&self) -> f64 {
        let per_hz = |hz: f64| 1.0 / (std::f64::consts::TAU * hz);
        let axes = self.axes.iter();
        axes.map(|a| per_hz(a.bandwidth_hz) + per_hz(a.rc_hz))
            .sum::<f64>()
            / 3.0
    }
}

/// State of one axis.
#[derive(Debug, Clone)]
pub struct Axis {
    truth: AxisTruth,
    ratiometric: bool,
    noise: Noise,
    filter: LowPass,
    rc: LowPass,
    reading_stream: Random,
    started: bool,
}

impl Axis {
    /// Axis `name` at steps of `dt_s`, its filters settled at the first input.
    pub fn new(truth: &AxisTruth, ratiometric: bool, name: &str, dt_s: f64, seed: u64) -> Self {
        Self {
            truth: truth.clone(),
            ratiometric,
            noise: Noise::new(&truth.noise, name, dt_s, seed),
            filter: LowPass::of_bandwidth(truth.bandwidth_hz, dt_s),
            rc: LowPass::of_bandwidth(truth.rc_hz, dt_s),
            reading_stream: Random::new(seed, &format!("{name} reading noise")),
            started: false,
        }
    }

    /// Component of a vector in body axes along the sensitive direction.
    #[inline]
    pub fn sensed(&self, vector: Vector) -> f64 {
        dot(self.truth.direction, vector)
    }

    /// Sets the noise of later readings, standard deviation, raw.
    pub(crate) fn set_reading_noise(&mut self, sigma: f64) {
        self.truth.white_per_sample = sigma;
    }

    /// Output after the next step, raw, for the input in SI along the axis and the supply relative to nominal.
    #[inline]
    pub fn step(&mut self, input: f64, supply: f64) -> f64 {
        if !self.started {
            self.started = true;
            self.filter.settle(input);
            self.rc.settle(input);
        }
        let felt = self.rc.step(self.filter.step(input + self.noise.step()));
        let truth = &self.truth;
        let mut output = truth.null + truth.sensitivity * felt;
        if truth.white_per_sample > 0.0 {
            output += truth.white_per_sample * self.reading_stream.normal();
        }
        output = output.clamp(truth.low, truth.high);
        if self.ratiometric {
            supply * output
        } else {
            output
        }
    }
}
