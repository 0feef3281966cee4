//! The errors that remain because a format cannot store a part of the calibration.
//!
//! Each error is computed over the temperatures of the calibration, for inputs up to 100 deg/s or 1 g, or without input. An error that was never
//! measured is unknown, not zero.

use mimu::calibration::bias_cubic::BiasCubics;
use mimu::calibration::{Calibration, compensator};
use mimu::quantity::Sensor;
use mimu::readable;
use mimu::triad::Forward;
use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::compensator::Compensator;
use mimu_core::effects::{Effects, REFERENCE_C};
use mimu_core::stored::NODES;
use mimu_recording::error::Result;
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

/// Parts of a calibration that a format can store. Every format stores scale factors and biases at one temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Places {
    /// Misalignment and non-orthogonality.
    pub cross_terms: bool,
    /// All curves over temperature, and the lags of the dies.
    pub temperature: bool,
    /// Effects.
    pub effects: bool,
}

impl Remaining {
    fn new(sensor: Sensor, source: &str, condition: &str, errors: &[Vector3<f64>]) -> Self {
        let squares: f64 = errors.iter().map(Vector3::norm_squared).sum();
        Self {
            sensor,
            source: source.into(),
            condition: condition.into(),
            unit: sensor.unit(),
            rms: Some((squares / (3 * errors.len().max(1)) as f64).sqrt()),
            max: Some(errors.iter().map(|e| e.amax()).fold(0.0, f64::max)),
        }
    }

    /// An error that nothing measured.
    pub(crate) fn unknown(sensor: Sensor, source: &str, condition: &str) -> Self {
        Self {
            sensor,
            source: source.into(),
            condition: condition.into(),
            unit: sensor.unit(),
            rms: None,
            max: None,
        }
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
        let errors: Vec<_> = inputs(sensor).map(|x| matrix * x - x).collect();
        Self::new(
            sensor,
            "scale factors and cross terms",
            at_input(sensor),
            &errors,
        )
    }

    /// The bias of readings that a program uses uncorrected, SI.
    pub fn of_bias(sensor: Sensor, bias: &Vector3<f64>) -> Self {
        Self::new(sensor, "bias", "without input", &[*bias])
    }

    /// Rounding to multiples of `step`, SI. The error is taken as uniform between half a step below and above.
    pub fn of_rounding(sensor: Sensor, step: f64) -> Self {
        Self {
            sensor,
            source: "rounding of the file's numbers".into(),
            condition: "constant".into(),
            unit: sensor.unit(),
            rms: Some(step / f64::sqrt(12.0)),
            max: Some(0.5 * step),
        }
    }

    /// The Earth's rate in the bias of a gyro that was calibrated at rest in an unknown attitude.
    pub fn of_earth_rate() -> Self {
        let rate = mimu::estimate::earth::RATE;
        Self {
            sensor: Sensor::Gyro,
            source: "Earth's rate in the bias".into(),
            condition: "in other attitudes than that of the recording".into(),
            unit: Sensor::Gyro.unit(),
            // As part of the bias, it is wrong once the unit is turned: by twice the rate if the unit points the other way.
            rms: Some(rate * f64::sqrt(2.0 / 3.0)),
            max: Some(2.0 * rate),
        }
    }

    /// One line, in readable units.
    pub fn line(&self) -> String {
        let readable = readable::parameter(self.unit);
        let (sensor, source, condition) = (self.sensor, &self.source, &self.condition);
        match (self.rms, self.max) {
            (Some(rms), Some(max)) => format!(
                "{sensor}: {source}, {condition}: rms {}, at most {}",
                readable.write(rms),
                readable.write(max)
            ),
            (Some(rms), None) => {
                format!(
                    "{sensor}: {source}, {condition}: rms {}",
                    readable.write(rms)
                )
            }
            (None, _) => format!("{sensor}: {source}: unknown, {condition}"),
        }
    }
}

/// The errors of cubics of the biases.
pub fn of_cubics(cubics: &BiasCubics) -> Vec<Remaining> {
    let each = cubics.remains.iter().map(|r| Remaining {
        sensor: cubics.sensor,
        source: r.source.into(),
        condition: r.condition.into(),
        unit: cubics.unit,
        rms: r.rms,
        max: r.max,
    });
    each.collect()
}

/// The errors of a format with these `places`, and the uncertainty of the rest of `calibration`.
///
/// # Errors
///
/// This build cannot evaluate an effect.
pub fn of(calibration: &Calibration, places: Places) -> Result<Vec<Remaining>> {
    let mut all = Vec::new();
    for sensor in Sensor::BOTH {
        let Some(model) = calibration.inverse(sensor) else {
            continue;
        };
        all.push(interval(calibration, sensor, &model));
        if !places.cross_terms {
            all.push(cross_terms(sensor, &model));
        }
        all.extend(over_temperature(calibration, sensor, &model, places));
    }
    if !places.effects {
        all.extend(effects(calibration)?);
    }
    Ok(all)
}

/// Largest input that errors are given for, SI.
fn input(sensor: Sensor) -> f64 {
    BiasCubics::input(sensor)
}

fn at_input(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "at 100 deg/s",
        Sensor::Accel => "at 1 g",
    }
}

/// Inputs along both directions of every axis.
fn inputs(sensor: Sensor) -> impl Iterator<Item = Vector3<f64>> {
    let size = input(sensor);
    (0..6).map(move |k| Vector3::ith(k / 2, if k % 2 == 0 { size } else { -size }))
}

/// The error of the output of `sensor` that was measured on unseen data, SI; `None` if none was, or of another quantity.
fn held_out(calibration: &Calibration, sensor: Sensor) -> Option<f64> {
    let judged = calibration.table(sensor)?.judged.as_ref()?;
    judged.held_out_rms.filter(|_| judged.unit == sensor.unit())
}

/// Half of the 95 % interval of the calibrated output, from the covariance of C and o: at the next power-on, if the calibration is of several sessions. If
/// unseen data erred by more, that error: intervals include what the fit knew, and a misfit of another recording is none of that.
fn interval(calibration: &Calibration, sensor: Sensor, model: &Affine<f64>) -> Remaining {
    const SOURCE: &str = "95 % interval of the calibrated output";
    const TOMORROW: &str = "95 % interval of the calibrated output at the next power-on";
    let forward = Forward::of(model);
    let next = calibration.next_power_on(sensor);
    let source = if next.is_some() { TOMORROW } else { SOURCE };
    let of_fit = || {
        let table = calibration.table(sensor)?;
        Some((calibration.covariance(sensor)?, table.interval_sigmas()))
    };
    let (Some((covariance, sigmas)), Some(forward)) = (next.or_else(of_fit), forward) else {
        return Remaining::unknown(sensor, source, "the calibration has no intervals");
    };
    let half = inputs(sensor).map(|x| {
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
    });
    let interval = Remaining::new(sensor, source, at_input(sensor), &half.collect::<Vec<_>>());
    interval.at_least(held_out(calibration, sensor))
}

/// Error of a format without scale factors: a reading changes by `gain` with the input of its axis instead of by 1.
pub fn scale_factors(sensor: Sensor, gain: &Vector3<f64>) -> Remaining {
    let errors = inputs(sensor).map(|x| gain.component_mul(&x) - x);
    let errors: Vec<_> = errors.collect();
    Remaining::new(sensor, "scale factors", at_input(sensor), &errors)
}

/// Error of a format with one factor and one offset for each axis: cross-axis sensitivity remains.
fn cross_terms(sensor: Sensor, model: &Affine<f64>) -> Remaining {
    let Some(forward) = Forward::of(model) else {
        return Remaining::unknown(sensor, "cross terms", "C is singular");
    };
    let diagonal = forward.matrix.diagonal();
    let errors = inputs(sensor).map(|x| {
        let across = forward.matrix * x - diagonal.component_mul(&x);
        across.component_div(&diagonal)
    });
    let errors: Vec<_> = errors.collect();
    Remaining::new(sensor, "cross terms", at_input(sensor), &errors)
}

fn over_temperature(
    calibration: &Calibration,
    sensor: Sensor,
    model: &Affine<f64>,
    places: Places,
) -> Vec<Remaining> {
    const BIAS: &str = "bias over temperature";
    const GAIN: &str = "scale factors and cross terms over temperature";
    let over = calibration.temperature.as_ref().filter(|o| o.has(sensor));
    let (Some(over), Some(curves)) = (over, calibration.curves()) else {
        let why = "calibrated at one temperature";
        return [BIAS, GAIN]
            .map(|source| Remaining::unknown(sensor, source, why))
            .into();
    };
    let mut all = Vec::new();
    if over.biases_only {
        let why = "calibrated at one temperature";
        all.push(Remaining::unknown(sensor, GAIN, why));
    }
    if places.temperature {
        if over.lags_s().is_none() {
            let why = "not determined";
            all.push(Remaining::unknown(sensor, "lag of the dies", why));
        }
        return all;
    }
    let [from, to] = over.range_c;
    let step = (to - from) / (TEMPERATURES - 1) as f64;
    let models = (0..TEMPERATURES).filter_map(|k| curves.inverse(sensor, from + step * k as f64));
    let forwards: Vec<Forward> = models.filter_map(|m| Forward::of(&m)).collect();
    let error = |f: &Forward, x: &Vector3<f64>| model.apply(&(f.matrix * x + f.bias)) - x;
    let zero = Vector3::zeros();
    let biases: Vec<_> = forwards.iter().map(|f| error(f, &zero)).collect();
    let range = format!("{from:.0} to {to:.0} °C");
    all.push(Remaining::new(
        sensor,
        BIAS,
        &format!("{range}, without input"),
        &biases,
    ));
    if !over.biases_only {
        let gains = forwards
            .iter()
            .flat_map(|f| inputs(sensor).map(|x| error(f, &x) - error(f, &zero)));
        let condition = format!("{range}, {}", at_input(sensor));
        all.push(Remaining::new(
            sensor,
            GAIN,
            &condition,
            &gains.collect::<Vec<_>>(),
        ));
    }
    all
}

/// The error of each effect separately, as the device removes it.
fn effects(calibration: &Calibration) -> Result<Vec<Remaining>> {
    if calibration.effects().is_empty() {
        return Ok(Vec::new());
    }
    let models = Compensation::from_fn(|s| calibration.inverse(s).unwrap_or_else(Affine::identity));
    let limits = calibration.limits();
    let mut all = Vec::new();
    for effect in calibration.effects() {
        let unknown = || {
            let why = "this program cannot evaluate it";
            Remaining::unknown(effect.sensor(), &effect.id(), why)
        };
        let mut one = Effects::<f64, 8>::new(&models).map(|e| e.within(limits));
        let on_device = effect.on_device().ok();
        let pushed = one.as_mut().zip(on_device);
        let pushed = pushed.map(|(one, effect)| one.push(effect).is_ok());
        let (Some(one), Some(true)) = (one, pushed) else {
            all.push(unknown());
            continue;
        };
        let full: Compensator<f64, NODES, 8> = compensator(calibration, models, None, one);
        let errors = of_effect(&full, &models, effect.sensor(), limits);
        let condition = match effect.sensor() {
            Sensor::Gyro => "at up to 100 deg/s and 1 g",
            Sensor::Accel => "at up to 1 g",
        };
        all.push(Remaining::new(
            effect.sensor(),
            &effect.id(),
            condition,
            &errors,
        ));
    }
    Ok(all)
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
    let mut errors = Vec::new();
    for temp_c in temperatures {
        for after_s in AFTER_S {
            for (moved, axis) in [(Sensor::Gyro, 0), (Sensor::Gyro, 1), (Sensor::Gyro, 2)]
                .into_iter()
                .chain([0, 1, 2].map(|axis| (Sensor::Accel, axis)))
            {
                let mut state = full.state(100.0);
                full.follow(&mut state, 0.0, Some(temp_c));
                full.follow(&mut state, after_s, Some(temp_c));
                for k in 0..INPUTS {
                    let share = 2.0 * k as f64 / (INPUTS - 1) as f64 - 1.0;
                    let sample: Sample<f64> = Sample::from_fn(|s| {
                        let x = match s == moved {
                            true => Vector3::ith(axis, share * input(s)),
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
    }
    errors
}
