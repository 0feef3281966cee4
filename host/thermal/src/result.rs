//! `mimu-thermal/1`: what a fit over temperature found. SI and raw units throughout; what is not a number is null.

use mimu::parameter::{ParameterKind, TriadParameter, parameters};
use mimu::quantity::{PerSensor, Sensor, present, raw_unit};
use mimu::{Estimate, Judgement};
use mimu_recording::RawUnit;
use serde::Serialize;

use crate::coverage;
use crate::curves::TriadCurves;
use crate::fit::{FitVerdict, ThermalFit, range};
use crate::judge::{Bin, DwellError, Hysteresis, rms};
use crate::profile::{Lag, RANGE};
use crate::used::Used;
use crate::warning::Warning;

/// Temperatures that a curve is given at.
const COUNT: usize = 33;

/// Result of a fit over temperature.
#[derive(Debug, Clone, Serialize)]
pub struct ThermalResult {
    /// `mimu-thermal/1`.
    pub format: &'static str,
    /// Program and version.
    pub tool: &'static str,
    /// Unit that was recorded.
    pub device: String,
    /// Samples files, with their SHA-256.
    pub recordings: Vec<RecordingResult>,
    /// Whether it distinguishes lag and slope, and describes the readings.
    pub verdict: FitVerdict,
    /// The judgement.
    pub judgement: Judgement,
    /// Lowest and highest temperature of the dies, °C.
    pub range_c: [f64; 2],
    /// Figures of the triads.
    #[serde(serialize_with = "present")]
    pub sensors: PerSensor<Option<SensorResult>>,
    /// All parameters over the temperature of the die.
    pub curves: Vec<CurveResult>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

/// A recording that was fitted.
#[derive(Debug, Clone, Serialize)]
pub struct RecordingResult {
    /// Path of its samples.
    pub samples: String,
    /// SHA-256 of them.
    pub sha256: String,
    /// Biases of this power-on minus those of the first, gyro x, y, z, accelerometer x, y, z; raw.
    pub bias_offset_raw: [f64; 6],
}

/// Figures of one triad.
#[derive(Debug, Clone, Serialize)]
pub struct SensorResult {
    /// Unit of the figures: SI, or that of the readings if only biases are estimated.
    pub unit: String,
    /// The part of the recordings that is used.
    pub used: Option<Used>,
    /// Compensated dwell means minus known input, over dwells and axes, rms; null where the input is not known.
    pub rms: Option<f64>,
    /// The same of data that were held out; null where none were.
    pub held_out_rms: Option<f64>,
    /// The same minus the biases of the verifying recording; null without one.
    pub held_out_rms_without_session_bias: Option<f64>,
    /// Rms from noise alone, the slope over temperature removed; null where the input is not known.
    pub noise_floor: Option<f64>,
    /// Time constant of the die behind the thermometer, s, negative where it leads; null with [`Self::lag_reason`].
    pub lag_s: Option<Lag>,
    /// Why there is no lag; null where there is one.
    pub lag_reason: Option<String>,
    /// What is inseparable in the curves of this sensor; null where nothing is.
    pub inseparable: Option<&'static str>,
    /// The segments that errors belong to: `dwells`, or `pieces` of 30 s if only biases are estimated. Bins and errors call both dwells.
    pub judged_by: &'static str,
    /// Errors by temperature, of the held-out data where there are any.
    pub bins: Vec<Bin>,
    /// The dwells behind these errors, in the order of time.
    pub dwells: Vec<DwellError>,
    /// Difference between heating and cooling after the lag; null if they share no temperature.
    pub hysteresis: Option<Vec<Hysteresis>>,
}

/// A parameter over temperature.
#[derive(Debug, Clone, Serialize)]
pub struct CurveResult {
    /// Which parameter.
    #[serde(skip)]
    pub of: TriadParameter,
    /// Sensor and name of the parameter, as a fit at one temperature calls it: `gyro_C_xx`, `accel_bias_z`.
    pub name: String,
    /// Sensor.
    pub sensor: Sensor,
    /// Unit of values and bounds.
    pub unit: String,
    /// Temperatures of the die, °C.
    pub temp_c: Vec<f64>,
    /// Estimates.
    pub value: Vec<f64>,
    /// Lower ends of the 95 % intervals, those of the lag included.
    pub lower: Vec<f64>,
    /// Upper ends.
    pub upper: Vec<f64>,
}

impl ThermalResult {
    /// The result of `fit`.
    pub fn of(fit: &ThermalFit) -> Self {
        let raw = fit.sessions[0].raw_unit;
        let curves = Sensor::BOTH.into_iter().flat_map(|sensor| {
            let found = fit.joint.curves[sensor].as_ref();
            found.map(|c| curves_of(c, sensor, raw)).unwrap_or_default()
        });
        let of = |sensor| SensorResult::of(fit, sensor);
        Self {
            format: "mimu-thermal/1",
            tool: concat!("mimu ", env!("CARGO_PKG_VERSION")),
            device: fit.sessions[0].device.clone(),
            recordings: recordings(fit),
            verdict: fit.verdict,
            judgement: fit.judgement(),
            range_c: range(&fit.joint),
            sensors: PerSensor::from_fn(of),
            curves: curves.collect(),
            warnings: fit.warnings.clone(),
        }
    }

    /// The curve `name`.
    pub fn curve(&self, name: &str) -> Option<&CurveResult> {
        self.curves.iter().find(|c| c.name == name)
    }
}

fn recordings(fit: &ThermalFit) -> Vec<RecordingResult> {
    let each = fit.sessions.iter().enumerate();
    each.map(|(k, s)| {
        let mut bias_offset_raw = [0.0; 6];
        for sensor in Sensor::BOTH {
            if let Some(curves) = &fit.joint.curves[sensor] {
                let offset = curves.session_offset(k);
                bias_offset_raw[sensor.channels()].copy_from_slice(offset.as_slice());
            }
        }
        RecordingResult {
            samples: s.place.clone(),
            sha256: s.sha256.clone(),
            bias_offset_raw,
        }
    })
    .collect()
}

impl SensorResult {
    fn of(fit: &ThermalFit, sensor: Sensor) -> Option<Self> {
        let curves = fit.joint.curves[sensor].as_ref()?;
        let judged = fit.judged[sensor].as_ref();
        let figures = judged.map(|j| rms(&j.errors));
        let held_out = judged.and_then(|j| j.held_out.as_ref());
        let lag = lag(fit, sensor);
        let gravity = curves.biases_only() && sensor == Sensor::Accel;
        Some(Self {
            unit: match curves.biases_only() {
                true => raw_unit(fit.sessions[0].raw_unit, sensor.unit()),
                false => sensor.unit().into(),
            },
            used: coverage::of(&fit.sessions, sensor),
            rms: figures.map(|f| f[0]),
            held_out_rms: held_out.map(|h| rms(h)[0]),
            held_out_rms_without_session_bias: judged.and_then(|j| j.without_session_bias),
            noise_floor: figures.map(|f| f[1]),
            lag_s: lag.as_ref().ok().copied(),
            lag_reason: lag.err(),
            inseparable: gravity.then_some(
                "in one pose only the sum of the bias along gravity and the scale factor times gravity is known: the curves are those of the sum",
            ),
            judged_by: if curves.biases_only() { "pieces" } else { "dwells" },
            bins: judged.map(|j| j.bins.clone()).unwrap_or_default(),
            dwells: judged.map_or(Vec::new(), |j| j.shown().to_vec()),
            hysteresis: judged.and_then(|j| j.hysteresis.clone()),
        })
    }
}

/// The lag of `sensor`, or why there is none.
fn lag(fit: &ThermalFit, sensor: Sensor) -> Result<Lag, String> {
    let profile = &fit.joint.profiles[sensor];
    let found = profile.lag;
    let Lag {
        value,
        lower,
        upper,
    } = found;
    if profile.is_given() {
        return Err(format!("it was given as {value} s"));
    }
    if fit.joint.one_way {
        return Err(
            "the temperature goes one way only: lag and slope cannot be distinguished".into(),
        );
    }
    if !found.is_determined() {
        return Err(format!(
            "not determined: its 95 % interval, {lower:.0} to {upper:.0} s, is wider than half the range from {:.0} to {:.0} s",
            RANGE[0], RANGE[1]
        ));
    }
    if let Some([from, to]) = fit.joint.contradicted[sensor] {
        return Err(format!(
            "not determined: the axes contradict each other. Separately their lags are {from:.0} to {to:.0} s; one lag for all would be {value:.1} s ({lower:.1} to {upper:.1} s)"
        ));
    }
    Ok(found)
}

/// Curves of one triad.
fn curves_of(curves: &TriadCurves, sensor: Sensor, raw: RawUnit) -> Vec<CurveResult> {
    let [from, to] = curves.range_c;
    let temps: Vec<f64> = (0..COUNT)
        .map(|k| from + (to - from) * k as f64 / (COUNT - 1) as f64)
        .collect();
    let mut out: Vec<CurveResult> = Vec::new();
    for &temp_c in &temps {
        for (k, (of, e, unit)) in at(curves, sensor, raw, temp_c).into_iter().enumerate() {
            if out.len() <= k {
                out.push(CurveResult {
                    name: format!("{sensor}_{of}"),
                    of,
                    sensor,
                    unit,
                    temp_c: Vec::new(),
                    value: Vec::new(),
                    lower: Vec::new(),
                    upper: Vec::new(),
                });
            }
            let curve = &mut out[k];
            curve.temp_c.push(temp_c);
            curve.value.push(e.value);
            curve.lower.push(e.value - e.interval);
            curve.upper.push(e.value + e.interval);
        }
    }
    out
}

/// Parameters at one temperature with their units.
fn at(
    curves: &TriadCurves,
    sensor: Sensor,
    raw: RawUnit,
    temp_c: f64,
) -> Vec<(TriadParameter, Estimate, String)> {
    match curves.triad(temp_c) {
        Some(triad) => parameters(&triad, sensor, raw),
        None => biases(curves, sensor, raw, temp_c),
    }
}

/// Biases, if nothing else is estimated; those of the accelerometer include the contribution of gravity in the one pose.
fn biases(
    curves: &TriadCurves,
    sensor: Sensor,
    raw: RawUnit,
    temp_c: f64,
) -> Vec<(TriadParameter, Estimate, String)> {
    let [model, _] = curves.forward(temp_c);
    let covariance = curves.covariance(temp_c);
    let kind = sensor.pick(ParameterKind::Bias, ParameterKind::BiasAndGravity);
    (0..3)
        .map(|k| {
            let sigma = covariance[(9 + k, 9 + k)].max(0.0).sqrt();
            let estimate = Estimate {
                value: model.bias[k],
                sigma,
                interval: 1.96 * sigma,
            };
            let unit = raw_unit(raw, sensor.unit());
            (TriadParameter(kind, k), estimate, unit)
        })
        .collect()
}
