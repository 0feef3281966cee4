//! `mimu thermal fit` from memory: curves, judged.

use mimu::calibration::{Calibration, CurvesOfUnit, Origin, TriadOfCurves, reference_node};
use mimu::estimate::earth::RATE;
use mimu::quantity::{PerSensor, Sensor};
use mimu::signal::blocks::extent;
use mimu_recording::{Error, Reference, Result, are_two_units};
use serde::Serialize;

use crate::basis::{CURVATURE_SPAN, Shape};
use crate::coverage;
use crate::extrapolation;
use crate::joint::{Choice, Joint, estimate};
use crate::judge::{self, Bin, DwellError, Hysteresis, Judging, rms};
use crate::nodes;
use crate::reference_error::{self, CommonErrors};
use crate::session::Session;
use crate::thermometer::{Die, Start};
use crate::warning::Warning;

/// Options of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// A lag that is known, s; none to estimate it.
    pub lag_s: Option<f64>,
    /// Temperatures that the curves must cover, °C.
    pub range_c: Option<[f64; 2]>,
}

/// If the rms of the errors exceeds that from noise by this factor, the curves do not describe the readings. Bias wander, which all sensors
/// have, reaches 3 to 4 in the means of half a minute.
const MISFIT: f64 = 10.0;

/// Whether the recording distinguishes lag and slope, and the curves describe the readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, strum::IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum FitVerdict {
    /// Heating and cooling, or plateaus, distinguish lag and slope.
    Fitted,
    /// They cannot be distinguished: the temperature goes one way only.
    OneWay,
    /// The errors of the fitted dwells far exceed the noise.
    Misfit,
}

impl FitVerdict {
    /// As in files.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Figures of one triad.
#[derive(Debug, Clone)]
pub struct Judged {
    /// Errors of the dwells that the curves were fitted to.
    pub errors: Vec<DwellError>,
    /// Errors of dwells that were held out.
    pub held_out: Option<Vec<DwellError>>,
    /// Bins of the held-out errors if there are any, else of the fitted ones.
    pub bins: Vec<Bin>,
    /// Difference between heating and cooling after the lag.
    pub hysteresis: Option<Vec<Hysteresis>>,
    /// Rms of the held-out errors, minus the biases of a verifying session; none without one.
    pub without_session_bias: Option<f64>,
}

/// Curves over temperature, judged.
#[derive(Debug, Clone)]
pub struct ThermalFit {
    /// Curves, lag and noise.
    pub joint: Joint,
    /// The recordings.
    pub sessions: Vec<Session>,
    /// As requested.
    pub options: Options,
    /// Whether lag and slope are distinguished, and the curves describe the readings.
    pub verdict: FitVerdict,
    /// Figures of the triads: SI, raw where only biases are estimated.
    pub judged: PerSensor<Option<Judged>>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

/// Fits `sessions`; `verify` are recordings that are only compensated, whole sweeps or soaks.
///
/// # Errors
/// Those of [`estimate`]; a range that was not covered.
pub fn fit(sessions: Vec<Session>, verify: &[Session], options: Options) -> Result<ThermalFit> {
    let mut warnings: Vec<Warning> = sessions
        .iter()
        .chain(verify)
        .flat_map(|s| s.warnings.iter().cloned())
        .collect();
    check_verifying(&sessions, verify)?;
    coverage::check(&sessions, &mut warnings)?;
    reference_error::check(&sessions)?;
    let mut joint = smooth(&sessions, options, &mut warnings)?;
    for (sensor, curves) in joint.curves.as_mut() {
        if let Some(curves) = curves {
            curves.count(CommonErrors::of(&sessions, sensor));
        }
    }
    warnings.extend(joint.warnings.iter().cloned());
    if sessions.iter().all(|s| s.noise_at_rest == [None; 6]) {
        warnings.push(Warning::WithoutNoise);
    }
    check_range(&joint, options.range_c)?;
    warnings.extend(earth_in_intervals(&sessions, &joint));
    let judged = PerSensor::from_fn(|sensor| judge(&sessions, verify, &joint, sensor));
    let misfits = |j: &Judged| {
        let [own, floor] = rms(&j.errors);
        floor > 0.0 && own > MISFIT * floor
    };
    let verdict = match joint.one_way {
        _ if judged.present().any(|(_, j)| misfits(j)) => FitVerdict::Misfit,
        true => FitVerdict::OneWay,
        false => FitVerdict::Fitted,
    };
    Ok(ThermalFit {
        joint,
        sessions,
        options,
        verdict,
        judged,
        warnings,
    })
}

/// Over a small span, curvature must lower the error of held-out dwells to this share of that of straight lines. A cubesat's gyro that drifted while
/// it cooled by 12 K reached 0.86, and its curves extrapolated up to three times worse than lines.
const EVIDENT: f64 = 0.7;

/// The joint estimate. Over a small span, curvature is used only if held-out dwells show it; if the temperature goes one way only, only if it
/// extrapolates better than straight lines.
fn smooth(sessions: &[Session], options: Options, warnings: &mut Vec<Warning>) -> Result<Joint> {
    let choice = |shape| Choice {
        shape,
        lag_s: options.lag_s,
    };
    let joint = estimate(sessions, choice(Shape::Spline))?;
    let dies = Sensor::BOTH.map(|s| joint.dies(sessions, s));
    let spans = dies.iter().flatten().map(|d| d.range()[1] - d.range()[0]);
    let span = spans.fold(0.0, f64::max);
    let short = span < CURVATURE_SPAN;
    if !joint.one_way && !short {
        return Ok(joint);
    }
    if short {
        let line = estimate(sessions, choice(Shape::Line))?;
        let share = share_of_held_out(sessions, &joint, &line);
        if share.is_none_or(|share| share > EVIDENT) {
            warnings.push(Warning::StraightLines {
                span_k: span,
                held_out: share,
            });
            return Ok(line);
        }
    }
    match extrapolation::compare(sessions, options.lag_s).filter(|_| joint.one_way) {
        Some([line, curve]) if curve > line => {
            warnings.push(Warning::CurvatureRefused {
                times: curve / line,
            });
            estimate(sessions, choice(Shape::Line))
        }
        _ => Ok(joint),
    }
}

/// Error of held-out dwells by `curves` over that by `lines`, of the triad in which it is smaller: where a triad shows no curvature, its curves are
/// close to lines.
fn share_of_held_out(sessions: &[Session], curves: &Joint, lines: &Joint) -> Option<f64> {
    let error = |joint: &Joint, sensor| {
        let noise = joint.noise[sensor]?;
        let held_out = judge::held_out(sessions, joint, sensor, &noise)?;
        Some(rms(&held_out)[0]).filter(|error| *error > 0.0)
    };
    let both = Sensor::BOTH.map(|sensor| Some(error(curves, sensor)? / error(lines, sensor)?));
    both.into_iter().flatten().reduce(f64::min)
}

/// The warning that the Earth's rate is in the intervals of the gyro's biases: on a table without a latitude, unless the noise is larger.
fn earth_in_intervals(sessions: &[Session], joint: &Joint) -> Option<Warning> {
    let unknown = |s: &Session| s.reference == Reference::Table && s.latitude_deg.is_none();
    let curves = joint.curves[Sensor::Gyro].as_ref()?;
    let triad = curves.triad(0.5 * (curves.range_c[0] + curves.range_c[1]))?;
    let sigma = |axis: usize| triad.inverse_covariance[(9 + axis, 9 + axis)].sqrt();
    let matters = (0..3).any(|axis| sigma(axis) < RATE);
    let warned = matters && sessions.iter().any(unknown);
    warned.then_some(Warning::Recording(mimu::warning::Warning::NoLatitude))
}

fn check_verifying(sessions: &[Session], verify: &[Session]) -> Result<()> {
    let Some(first) = sessions.first() else {
        return Ok(());
    };
    for other in verify {
        if are_two_units(&other.device, &first.device) {
            let problem = format!(
                "this recording belongs to {:?}, not to {:?}",
                other.device, first.device
            );
            let remedy = "verify with a recording of the same unit";
            return Err(Error::new(&other.place, problem, remedy));
        }
    }
    Ok(())
}

fn check_range(joint: &Joint, wanted: Option<[f64; 2]>) -> Result<()> {
    let Some([from, to]) = wanted else {
        return Ok(());
    };
    let [low, high] = range(joint);
    if low <= from + 1.0 && high >= to - 1.0 {
        return Ok(());
    }
    let problem = format!(
        "the dies were at {low:.1} to {high:.1} °C, but the curves are to cover {from} to {to} °C"
    );
    let remedy = "heat and cool the unit through the whole range, with time for the dies to follow";
    Err(Error::undetermined("range", problem, remedy))
}

/// Temperatures of the dies, °C.
pub fn range(joint: &Joint) -> [f64; 2] {
    extent(joint.recorded().flat_map(|c| c.range_c))
}

fn judge(
    sessions: &[Session],
    verify: &[Session],
    joint: &Joint,
    sensor: Sensor,
) -> Option<Judged> {
    let curves = joint.curves[sensor].as_ref()?;
    let dies = joint.dies(sessions, sensor);
    let lag = joint.applied_s(sensor);
    let unseen = verify
        .iter()
        .map(|s| s.thermometer.die(lag, Start::Settled));
    let unseen: Vec<Die> = unseen.collect();
    let judging = |recording: usize, session, die, fitted| Judging {
        recording,
        session,
        sensor,
        die,
        curves,
        fitted,
    };
    let each = sessions.iter().zip(&dies).enumerate();
    let errors: Vec<DwellError> = each
        .flat_map(|(i, (session, die))| judging(i, session, die, true).errors())
        .collect();
    let mut without = None;
    let held_out = match verify {
        [] => {
            joint.noise[sensor].and_then(|noise| judge::held_out(sessions, joint, sensor, &noise))
        }
        _ => {
            let mut all = Vec::new();
            let mut centred = Vec::new();
            for (i, (session, die)) in verify.iter().zip(&unseen).enumerate() {
                let own = judging(i, session, die, false).errors();
                let mean = own.iter().map(|e| e.error).sum::<nalgebra::Vector3<f64>>()
                    / own.len().max(1) as f64;
                centred.extend(own.iter().map(|e| DwellError {
                    error: e.error - mean,
                    ..*e
                }));
                all.extend(own);
            }
            without = Some(rms(&centred)[0]);
            Some(all)
        }
    };
    let shown = held_out.as_ref().unwrap_or(&errors);
    Some(Judged {
        bins: judge::bins(shown),
        hysteresis: judge::hysteresis(&errors, curves),
        errors,
        held_out,
        without_session_bias: without,
    })
}

impl Judged {
    /// Errors of the held-out dwells if there are any, else of the fitted ones.
    pub fn shown(&self) -> &[DwellError] {
        self.held_out.as_ref().unwrap_or(&self.errors)
    }
}

impl ThermalFit {
    /// Rms and largest difference between heating and cooling, axis by axis, times `si`, as in a calibration file.
    pub(crate) fn hysteresis(&self, sensor: Sensor, si: [f64; 3]) -> Option<[[f64; 3]; 2]> {
        let judged = self.judged[sensor].as_ref()?;
        let all = judged.hysteresis.as_ref()?;
        let of = |size: fn(&Hysteresis) -> f64| {
            std::array::from_fn(|k| all.get(k).map_or(0.0, |h| (size(h) * si[k]).abs()))
        };
        Some([of(|h| h.rms), of(|h| h.largest)])
    }

    /// The calibration file, made at `created` (RFC 3339).
    ///
    /// # Errors
    /// Curves of biases alone.
    pub fn calibration(&self, created: &str) -> Result<Calibration> {
        let mut temperature = nodes::over_temperature(&self.joint)?;
        for (sensor, dies) in temperature.dies.as_mut() {
            dies.hysteresis = self.hysteresis(sensor, [1.0; 3]);
        }
        let temps: Vec<f64> = temperature.nodes.iter().map(|n| n.temp_c).collect();
        let temp_c = reference_node(&temps).map_or(f64::NAN, |k| temps[k]);
        let first = &self.sessions[0];
        let triads = PerSensor::from_fn(|sensor| {
            let curves = self.joint.curves[sensor].as_ref()?;
            let judged = self.judged[sensor].as_ref()?;
            let [own, floor] = rms(&judged.errors);
            Some(TriadOfCurves {
                triad: curves.triad(temp_c)?,
                estimator: "joint",
                rms: own,
                held_out_rms: judged.held_out.as_ref().map(|h| rms(h)[0]),
                noise_floor: floor,
                dwells: judged.errors.len(),
                condition: curves.condition(temp_c),
            })
        });
        let unit = CurvesOfUnit {
            device: first.device.clone(),
            unit_id: first.unit_id.clone(),
            sensors: first.sensors.clone(),
            recording: Origin {
                temp_c: Some(temp_c),
                ..first.origin(temperature.range_c)
            },
            triads,
            temperature,
            judgement: self.judgement(),
        };
        Calibration::of_curves(unit, created)
    }
}
