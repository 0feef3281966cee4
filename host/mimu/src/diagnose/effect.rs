//! An effect: what the affine model lacks, as a sum of regressors with unknown coefficients.

use nalgebra::Vector3;

use super::library::readout::Converter;
use crate::blocks::{Block, Moments};
use crate::quantity::Sensor;

/// Temperature that warmth counts from, °C.
pub const REFERENCE_C: f64 = 25.0;

/// What a unit undergoes over a short stretch of time, in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Index of its recording.
    pub session: usize,
    /// Middle of the stretch, s since the recording began.
    pub t_s: f64,
    /// The same since the power came, as the device counts it; since the recording began where nobody knows.
    pub on_s: f64,
    /// Its length, s.
    pub duration_s: f64,
    /// Rate, rad/s.
    pub rate: Vector3<f64>,
    /// Specific force, m/s².
    pub force: Vector3<f64>,
    /// Angular acceleration, rad/s²; zero within a dwell.
    pub angular_acceleration: Vector3<f64>,
    /// The sensor's own input along its three sensitive directions, rad/s or m/s².
    pub sensed: Vector3<f64>,
    /// Temperature above [`REFERENCE_C`], °C; not a number where it was not recorded.
    pub warm_c: f64,
    /// The same behind a first-order lag with the time constant of the effect, if it has one of this kind.
    pub late_c: f64,
    /// What the sensor reads.
    pub reading: Reading,
}

impl Moment {
    /// One moment of several at the same input: the first, with the readings of all.
    pub(super) fn pooled(all: &[Self]) -> Self {
        let total: f64 = all.iter().map(|m| m.duration_s).sum();
        let mean = |of: &dyn Fn(&Self) -> Vector3<f64>| -> Vector3<f64> {
            all.iter().map(|m| of(m) * (m.duration_s / total)).sum()
        };
        let level = mean(&|m| m.reading.mean);
        let square = |v: Vector3<f64>| v.component_mul(&v);
        let variance = mean(&|m| square(m.reading.sd) + square(m.reading.mean - level));
        let mut pooled = all[0];
        pooled.duration_s = total;
        pooled.reading.mean = level;
        pooled.reading.sd = variance.map(f64::sqrt);
        pooled
    }

    /// The moment as the sensor would read it without `error` of its axes, SI.
    pub fn read_without(&self, error: &Vector3<f64>) -> Self {
        let mut clean = *self;
        clean.reading.mean -= self.reading.scale.component_mul(error);
        clean
    }

    /// The moment with readings in units of the first bit of the converters, from their codes 0; not a number on an axis without.
    pub(super) fn in_bits(&self, codes: &[Option<Converter>; 3]) -> Self {
        let mut out = *self;
        let Reading { mean, sd, scale } = &mut out.reading;
        for (i, converter) in codes.iter().enumerate() {
            let (weight, zero) = converter.map_or((f64::NAN, 0.0), |c| (c.weight, c.zero));
            mean[i] = (mean[i] - zero) / weight;
            sd[i] /= weight;
            scale[i] /= weight;
        }
        out
    }
}

/// The temperature that an effect goes by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Behind {
    /// Lag of [`Moment::late_c`], s, if it has one.
    pub lag_s: Option<f64>,
    /// Whether the thermometer is on another die, and what it warms up by itself after power-on not the sensor's.
    pub elsewhere: bool,
}

/// Middle of each block, s, and its temperature above [`REFERENCE_C`], °C: where there is none that of the block before, as
/// the device does it, and not a number before the first.
pub fn warmth(blocks: &[Block]) -> Vec<(f64, f64)> {
    let mut held = f64::NAN;
    let each = blocks.iter().map(|b| {
        if b.temp_c.mean.is_finite() {
            held = b.temp_c.mean - REFERENCE_C;
        }
        (0.5 * (b.start_s + b.last_s), held)
    });
    each.collect()
}

/// Raw readings of the three axes of a sensor over a stretch of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Their mean, raw.
    pub mean: Vector3<f64>,
    /// Standard deviation of a sample, raw.
    pub sd: Vector3<f64>,
    /// Scale factors, raw/SI, positive.
    pub scale: Vector3<f64>,
}

impl Reading {
    /// Of a moment that nobody has recorded, without noise, in SI.
    pub const NONE: Self = Self {
        mean: Vector3::new(0.0, 0.0, 0.0),
        sd: Vector3::new(0.0, 0.0, 0.0),
        scale: Vector3::new(1.0, 1.0, 1.0),
    };

    /// Of `moments` of the three axes.
    pub fn of(moments: &[Moments], scale: &Vector3<f64>) -> Self {
        let mean = |i: usize| moments[i].mean;
        let sd = |i: usize| match moments[i].n {
            0 | 1 => 0.0,
            n => (moments[i].m2 / f64::from(n - 1)).sqrt(),
        };
        Self {
            mean: Vector3::from_fn(|i, _| mean(i)),
            sd: Vector3::from_fn(|i, _| sd(i)),
            scale: *scale,
        }
    }
}

/// Where the value of a nonlinear constant comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FormKind {
    /// It is searched.
    Free,
    /// It is searched, and is the lag of [`Moment::late_c`].
    Lag,
}

/// A nonlinear constant of an effect, between two values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Form {
    /// Name, with the unit.
    pub name: &'static str,
    /// Smallest value that is looked at.
    pub from: f64,
    /// Largest.
    pub to: f64,
    /// Where it comes from.
    pub kind: FormKind,
}

/// One coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coefficient {
    /// Name.
    pub name: &'static str,
    /// Axis of the sensor whose reading it is added to; `None`: to all three, each with a regressor of its own.
    pub axis: Option<usize>,
    /// Unit.
    pub unit: &'static str,
    /// What it belongs to.
    pub scope: Scope,
}

/// What a coefficient belongs to. All are fitted and told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// The unit: it is an error, written and removed.
    Unit,
    /// The first recording: neither written nor removed elsewhere.
    Recording,
    /// The place: what the sensor reads is there. The calibration is found without it, and nothing takes it out of readings.
    Place,
}

/// One kind of effect. The error of sensor axis i is the sum over the coefficients of i of coefficient times regressor, in the
/// SI unit of the sensor, and is added to what the sensor should read.
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    /// Public, stable name.
    pub id: &'static str,
    /// Triad whose readings err.
    pub sensor: Sensor,
    /// Physics in a line.
    pub about: &'static str,
    /// Its coefficients.
    pub coefficients: &'static [Coefficient],
    /// Size of a coefficient in data sheets, in its unit: an experiment that could not see it has not excited the effect.
    pub typical: &'static [f64],
    /// Its nonlinear constant.
    pub form: Option<Form>,
    /// The regressors at a moment, one for each coefficient, or three in a row (x, y, z) for one of all axes; the number is that
    /// of the form.
    pub regressors: fn(&Moment, f64, &mut [f64]),
    /// What an experiment has to have for it to be seen.
    pub needs: &'static str,
}

impl Effect {
    /// Whether the readings err by it; else it is something that they should show.
    pub fn is_error(&self) -> bool {
        self.coefficients.iter().all(|c| c.scope != Scope::Place)
    }
}
