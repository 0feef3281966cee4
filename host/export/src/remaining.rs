//! The errors that remain because a format cannot store a part of the calibration.
//!
//! Each error is computed over the temperatures of the calibration, for inputs up to 100 deg/s or 1 g, or without input. An error that was never
//! measured is unknown, not zero.

use mimu::calibration::bias_cubic::BiasCubics;
use mimu::calibration::{Calibration, compensator};
use mimu::{FittedEffect, Forward, Sensor, readable};
use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::compensator::Compensator;
use mimu_core::effects::{Effects, REFERENCE_C};
use mimu_core::stored::NODES;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// Number of temperatures at which curves are compared with one model.
const TEMPERATURES: usize = 101;
/// Number of inputs along an axis at which effects are evaluated.
const INPUTS: usize = 97;
/// Times since power-on at which effects are evaluated, s.
const AFTER_S: [f64; 2] = [0.0, 3600.0];

/// An error that a format leaves.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Remaining {
    /// Triad whose output errs.
    #[schemars(with = "String", extend("enum" = ["gyro", "accel"]))]
    pub sensor: Sensor,
    /// Where it comes from.
    pub source: String,
    /// For which input or state it holds.
    pub condition: String,
    /// Unit of `rms` and `max`.
    pub unit: &'static str,
    /// Root of the mean square; `None` where it is not known.
    pub rms: Option<f64>,
    /// Largest size; `None` where it is not known, as for an rms of unseen data.
    pub max: Option<f64>,
}

/// How much of a calibration a format can store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Places {
    /// A factor and an offset for each axis, at one temperature.
    Axes,
    /// C and o at one temperature.
    Matrix,
    /// All curves over temperature, and the lags of the dies.
    Curves,
    /// The effects too.
    Effects,
}

impl Remaining {
    /// An error with these figures, in the unit of `sensor`.
    pub(crate) fn of(
        sensor: Sensor,
        source: impl Into<String>,
        condition: impl Into<String>,
        rms: Option<f64>,
        max: Option<f64>,
    ) -> Self {
        Self {
            sensor,
            source: source.into(),
            condition: condition.into(),
            unit: sensor.unit(),
            rms,
            max,
        }
    }

    fn new(sensor: Sensor, source: &str, condition: &str, errors: &[Vector3<f64>]) -> Self {
        let squares: f64 = errors.iter().map(Vector3::norm_squared).sum();
        let rms = (squares / (3 * errors.len().max(1)) as f64).sqrt();
        let max = errors.iter().map(|e| e.amax()).fold(0.0, f64::max);
        Self::of(sensor, source, condition, Some(rms), Some(max))
    }

    /// An error that nothing measured.
    pub(crate) fn unknown(sensor: Sensor, source: &str, condition: &str) -> Self {
        Self::of(sensor, source, condition, None, None)
    }

    /// This error, or `rms` if that is larger.
    fn at_least(mut self, rms: Option<f64>) -> Self {
        for figure in [&mut self.rms, &mut self.max] {
            *figure = figure.map(|own| own.max(rms.unwrap_or(0.0)));
        }
        self
    }

    /// Scale factors and cross terms of readings that a program uses uncorrected; `matrix` maps the input to them, SI to SI.
    pub fn of_readings(sensor: Sensor, matrix: &Matrix3<f64>) -> Self {
        at_inputs(sensor, "scale factors and cross terms", |x| matrix * x - x)
    }

    /// The bias of readings that a program uses uncorrected, SI.
    pub fn of_bias(sensor: Sensor, bias: &Vector3<f64>) -> Self {
        Self::new(sensor, "bias", "without input", &[*bias])
    }

    /// Rounding to multiples of `step`, SI. The error is taken as uniform between half a step below and above.
    pub fn of_rounding(sensor: Sensor, step: f64) -> Self {
        let (source, rms) = ("rounding of the file's numbers", step / f64::sqrt(12.0));
        Self::of(sensor, source, "constant", Some(rms), Some(0.5 * step))
    }

    /// The Earth's rate in the bias of a gyro that was calibrated at rest in an unknown attitude.
    pub fn of_earth_rate() -> Self {
        let rate = mimu::estimate::earth::RATE;
        // As part of the bias, it is wrong once the unit is turned: by twice the rate if the unit points the other way.
        let (rms, max) = (rate * f64::sqrt(2.0 / 3.0), 2.0 * rate);
        let condition = "in other attitudes than that of the recording";
        let source = "Earth's rate in the bias";
        Self::of(Sensor::Gyro, source, condition, Some(rms), Some(max))
    }

    /// One line, in readable units.
    pub fn line(&self) -> String {
        let readable = readable::parameter(self.unit);
        let (sensor, source, condition) = (self.sensor, &self.source, &self.condition);
        let Some(rms) = self.rms.map(|rms| readable.write(rms)) else {
            return format!("{sensor}: {source}: unknown, {condition}");
        };
        let most = self.max.map(|max| readable.write(max));
        let most = most.map_or_else(String::new, |max| format!(", at most {max}"));
        format!("{sensor}: {source}, {condition}: rms {rms}{most}")
    }
}

/// The errors of cubics of the biases.
pub fn of_cubics(cubics: &BiasCubics) -> Vec<Remaining> {
    let each = cubics.remains.iter().map(|r| Remaining {
        unit: cubics.unit,
        ..Remaining::of(cubics.sensor, r.source, r.condition, r.rms, r.max)
    });
    each.collect()
}

/// The errors of a format with these `places`, and the uncertainty of the rest of `calibration`.
pub fn of(calibration: &Calibration, places: Places) -> Vec<Remaining> {
    let mut all = Vec::new();
    for sensor in Sensor::BOTH {
        let Some(model) = calibration.inverse(sensor) else {
            continue;
        };
        all.push(interval(calibration, sensor, &model));
        if places < Places::Matrix {
            all.push(cross_terms(sensor, &model));
        }
        all.extend(over_temperature(calibration, sensor, &model, places));
    }
    if places < Places::Effects {
        all.extend(effects(calibration));
    }
    all
}

/// Largest input that errors are given for, SI.
fn input(sensor: Sensor) -> f64 {
    BiasCubics::input(sensor)
}

fn at_input(sensor: Sensor) -> &'static str {
    sensor.pick("at 100 deg/s", "at 1 g")
}

/// Inputs along both directions of every axis.
fn inputs(sensor: Sensor) -> impl Iterator<Item = Vector3<f64>> {
    let size = input(sensor);
    (0..6).map(move |k| Vector3::ith(k / 2, if k % 2 == 0 { size } else { -size }))
}

/// The error that `of` gives at these inputs.
fn at_inputs(sensor: Sensor, source: &str, of: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Remaining {
    let errors: Vec<_> = inputs(sensor).map(of).collect();
    Remaining::new(sensor, source, at_input(sensor), &errors)
}

/// The error of the output of `sensor` that was measured on unseen data, SI; `None` if none was, or of another quantity.
fn held_out(calibration: &Calibration, sensor: Sensor) -> Option<f64> {
    let judged = calibration.table(sensor)?.judged.as_ref()?;
    judged.held_out_rms.filter(|_| judged.unit == sensor.unit())
}

/// Half of the 95 % interval of the calibrated output, from the covariance of C and o: at the next power-on, if the calibration is of several sessions. If
/// unseen data erred by more, that error: intervals include what the fit knew, and a misfit of another recording is none of that.
fn interval(calibration: &Calibration, sensor: Sensor, model: &Affine<f64>) -> Remaining {
    let forward = Forward::of(model);
    let next = calibration.next_power_on(sensor);
    let source = match next {
        Some(_) => "95 % interval of the calibrated output at the next power-on",
        None => "95 % interval of the calibrated output",
    };
    let of_fit = || {
        let table = calibration.table(sensor)?;
        Some((calibration.covariance(sensor)?, table.interval_sigmas()))
    };
    let (Some((covariance, sigmas)), Some(forward)) = (next.or_else(of_fit), forward) else {
        return Remaining::unknown(sensor, source, "the calibration has no intervals");
    };
    let half = |x: Vector3<f64>| {
        let raw = forward.matrix * x + forward.bias;
        Vector3::from_fn(|row, _| {
            let mut gradient = [0.0; 12];
            (0..3).for_each(|k| gradient[3 * row + k] = raw[k]);
            gradient[9 + row] = 1.0;
            let variance: f64 = (0..12)
                .flat_map(|i| (0..12).map(move |j| (i, j)))
                .map(|(i, j)| gradient[i] * covariance[(i, j)] * gradient[j])
                .sum();
            sigmas * variance.max(0.0).sqrt()
        })
    };
    at_inputs(sensor, source, half).at_least(held_out(calibration, sensor))
}

/// Error of a format without scale factors: a reading changes by `gain` with the input of its axis instead of by 1.
pub fn scale_factors(sensor: Sensor, gain: &Vector3<f64>) -> Remaining {
    at_inputs(sensor, "scale factors", |x| gain.component_mul(&x) - x)
}

/// Error of a format with one factor and one offset for each axis: cross-axis sensitivity remains.
fn cross_terms(sensor: Sensor, model: &Affine<f64>) -> Remaining {
    let Some(forward) = Forward::of(model) else {
        return Remaining::unknown(sensor, "cross terms", "C is singular");
    };
    let diagonal = forward.matrix.diagonal();
    at_inputs(sensor, "cross terms", |x| {
        let across = forward.matrix * x - diagonal.component_mul(&x);
        across.component_div(&diagonal)
    })
}

fn over_temperature(
    calibration: &Calibration,
    sensor: Sensor,
    model: &Affine<f64>,
    places: Places,
) -> Vec<Remaining> {
    const BIAS: &str = "bias over temperature";
    const GAIN: &str = "scale factors and cross terms over temperature";
    let unknown = |source| Remaining::unknown(sensor, source, "calibrated at one temperature");
    let over = calibration.temperature.as_ref().filter(|o| o.has(sensor));
    let (Some(over), Some(curves)) = (over, calibration.curves()) else {
        return [BIAS, GAIN].map(unknown).into();
    };
    let mut all = Vec::new();
    if over.biases_only {
        all.push(unknown(GAIN));
    }
    if places >= Places::Curves {
        if over.lags_s().is_none() {
            let lag = Remaining::unknown(sensor, "lag of the dies", "not determined");
            all.push(lag);
        }
        return all;
    }
    let [from, to] = over.range_c;
    let step = (to - from) / (TEMPERATURES - 1) as f64;
    let models = (0..TEMPERATURES).filter_map(|k| curves.inverse(sensor, from + step * k as f64));
    let forwards: Vec<Forward> = models.filter_map(|m| Forward::of(&m)).collect();
    let error = |f: &Forward, x: Vector3<f64>| model.apply(&(f.matrix * x + f.bias)) - x;
    let zero = |f: &Forward| error(f, Vector3::zeros());
    let range = format!("{from:.0} to {to:.0} °C");
    let condition = format!("{range}, without input");
    let biases: Vec<_> = forwards.iter().map(zero).collect();
    all.push(Remaining::new(sensor, BIAS, &condition, &biases));
    if !over.biases_only {
        let gains = |f| inputs(sensor).map(move |x| error(f, x) - zero(f));
        let gains: Vec<_> = forwards.iter().flat_map(gains).collect();
        let condition = format!("{range}, {}", at_input(sensor));
        all.push(Remaining::new(sensor, GAIN, &condition, &gains));
    }
    all
}

/// The error of each effect separately, as the device removes it.
pub(crate) fn effects(calibration: &Calibration) -> Vec<Remaining> {
    let models = Compensation::from_fn(|s| calibration.inverse(s).unwrap_or_else(Affine::identity));
    let limits = calibration.limits();
    let of = |effect: &FittedEffect| {
        let (sensor, id) = (effect.sensor(), effect.id());
        let alone = || {
            let mut one = Effects::<f64, 8>::new(&models)?.within(limits);
            one.push(effect.on_device().ok()?).ok()?;
            Some(compensator(calibration, models, None, one))
        };
        let Some(full) = alone() else {
            return Remaining::unknown(sensor, &id, "this program cannot evaluate it");
        };
        let condition = sensor.pick("at up to 100 deg/s and 1 g", "at up to 1 g");
        let errors = of_effect(&full, &models, sensor, limits);
        Remaining::new(sensor, &id, condition, &errors)
    };
    calibration.effects().iter().map(of).collect()
}

fn of_effect(
    full: &Compensator<f64, NODES, 8>,
    models: &Compensation<f64>,
    sensor: Sensor,
    limits: Option<[f64; 2]>,
) -> Vec<Vector3<f64>> {
    let forward = models.as_ref().map(Forward::of);
    let Some(raw) = forward.transpose() else {
        return Vec::new();
    };
    let temperatures = limits.map_or(vec![REFERENCE_C], |[a, b]| vec![a, 0.5 * (a + b), b]);
    let axes = Sensor::BOTH.map(|moved| [0, 1, 2].map(|axis| (moved, axis)));
    let mut errors = Vec::new();
    for temp_c in temperatures {
        for (after_s, (moved, axis)) in AFTER_S
            .iter()
            .flat_map(|s| axes.iter().flatten().map(move |a| (s, a)))
        {
            let mut state = full.state(100.0);
            full.follow(&mut state, 0.0, Some(temp_c));
            full.follow(&mut state, *after_s, Some(temp_c));
            for k in 0..INPUTS {
                let share = 2.0 * k as f64 / (INPUTS - 1) as f64 - 1.0;
                let sample: Sample<f64> = Sample::from_fn(|s| {
                    let x = match s == *moved {
                        true => Vector3::ith(*axis, share * input(s)),
                        // Gravity acts on the accelerometer also while the unit turns.
                        false if s == Sensor::Accel => Vector3::ith((axis + 1) % 3, input(s)),
                        false => Vector3::zeros(),
                    };
                    raw[s].matrix * x + raw[s].bias
                });
                // The conditions exclude angular acceleration, so the input must not appear to jump.
                state.gap();
                let with = full.apply(&mut state, &sample);
                errors.push(with[sensor] - models.apply(&sample)[sensor]);
            }
        }
    }
    errors
}
