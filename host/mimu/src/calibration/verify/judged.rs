//! The judgement of a verification.

use super::causes::Causes;
use super::{SensorVerification, Verification};
use crate::calibration::Calibration;
use crate::judge::errors::{self, BEYOND_NOISE, ErrorFigures};
use crate::judge::input;
use crate::judgement::Judgement;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use crate::recording_problem::RecordingProblem;
use crate::warning::Warning;

/// Gravity of two files that differs by less, m/s², is the same: four decimals are usual.
const SAME_GRAVITY: f64 = 5e-5;

impl Causes {
    /// What explains the error, in a sentence fragment.
    pub fn words(&self) -> String {
        let share = |s: &super::Share| {
            let [value, lower, upper] = [s.value, s.lower, s.upper].map(|v| 100.0 * v);
            format!("{value:.0} % ({lower:.0} to {upper:.0})")
        };
        let accel = match &self.accel {
            Some(accel) => format!(", the accelerometer's directions {}", share(accel)),
            None => String::new(),
        };
        format!(
            "a changed bias explains {} of its square, the matrix {}{accel}",
            share(&self.bias),
            share(&self.matrix)
        )
    }
}

/// Size of the input of `sensor` that `figure` is compared with, in its unit. Infinite if the input is zero throughout.
fn input_size(prepared: &Prepared, sensor: Sensor, figure: Figure) -> f64 {
    let size = match figure {
        Figure::Direction => 1.0,
        Figure::GravityMagnitude => prepared.manifest.gravity_mps2,
        Figure::RateMagnitude => {
            let table = prepared.manifest.turntable.iter();
            let rates = table.flat_map(|t| &t.rates_dps);
            rates.fold(0.0, |most, rate| f64::max(most, rate.to_radians()))
        }
        Figure::Input => {
            let all = prepared.observations(sensor);
            let inputs = all.iter().map(|o| o.without_earth().input);
            let squares: f64 = inputs.map(|x| x.norm_squared()).sum();
            (squares / (3 * all.len().max(1)) as f64).sqrt()
        }
    };
    if size > 0.0 { size } else { f64::INFINITY }
}

fn figures(
    prepared: &Prepared,
    sensor: Sensor,
    s: &SensorVerification,
    unseen: bool,
) -> ErrorFigures {
    ErrorFigures {
        sensor,
        figure: s.figure,
        rms: s.rms,
        held_out_rms: unseen.then_some(s.rms),
        noise_floor: s.noise_floor,
        input: input_size(prepared, sensor, s.figure),
        // A calibration that errs by as much as it says is right.
        usual: BEYOND_NOISE.hypot(s.announced() / s.noise_floor),
        cause: s.causes.as_ref().map(Causes::words),
        few: None,
    }
}

/// The judgement of the figures of `prepared`; `warnings` are those of the verification.
pub(super) fn judgement(
    prepared: &Prepared,
    sensors: &[(Sensor, &SensorVerification)],
    warnings: &[Warning],
) -> Judgement {
    let problems = RecordingProblem::without_fit(prepared);
    let gravity = warnings.iter().find_map(|w| match w {
        Warning::OtherGravity { gravity_mps2: [ours, theirs], contradicted: true, .. } => Some(format!(
            "gravity is {ours} m/s² in the calibration and {theirs} in the recording, which the readings contradict"
        )),
        _ => None,
    });
    let unseen = !warnings.contains(&Warning::SameRecording);
    let figures: Vec<ErrorFigures> = sensors
        .iter()
        .map(|(sensor, s)| figures(prepared, *sensor, s, unseen))
        .map(|f| match (f.sensor, &gravity) {
            (Sensor::Accel, Some(gravity)) => ErrorFigures {
                cause: Some(gravity.clone()),
                ..f
            },
            _ => f,
        })
        .collect();
    let mut by_errors = errors::judge(&figures);
    let mut beyond = sensors
        .iter()
        .filter(|(_, s)| s.rms > BEYOND_NOISE * s.noise_floor)
        .peekable();
    if by_errors.is_good() && beyond.peek().is_some() {
        by_errors.reason += match beyond.any(|(_, s)| s.next_power_on.is_some()) {
            true => ", and within what the calibration announces for the next power-on",
            false => ", and within the uncertainty that the calibration states",
        };
    }
    let all = input::judgements(&problems, warnings);
    Judgement::worst(all.into_iter().chain([by_errors.clone()])).unwrap_or(by_errors)
}

/// Warns if the gravity of the calibration differs from that of the recording. At two places it may; but if the readings agree with the
/// calibration's, that of the recording is wrong.
pub(super) fn other_gravity(calibration: &Calibration, prepared: &Prepared) -> Option<Warning> {
    let ours = calibration.recording.gravity_mps2?;
    let theirs = prepared.manifest.gravity_mps2;
    if (ours - theirs).abs() < SAME_GRAVITY {
        return None;
    }
    let model = calibration.inverse(Sensor::Accel)?;
    let poses = prepared.observations(Sensor::Accel);
    let known_at_rest = |o: &crate::estimate::Observation| {
        // Inputs are unknown if only gravity is the reference.
        !o.input.iter().all(|x| x.is_finite()) || (o.input.norm() - theirs).abs() < 0.01 * theirs
    };
    let sizes = poses.iter().filter(|o| known_at_rest(o));
    let sizes: Vec<f64> = sizes.map(|o| model.apply(&o.raw).norm()).collect();
    if sizes.is_empty() {
        return None;
    }
    let mean = sizes.iter().sum::<f64>() / sizes.len() as f64;
    let contradicted = (mean - ours).abs() < (mean - theirs).abs();
    Some(Warning::OtherGravity {
        gravity_mps2: [ours, theirs],
        force_mps2: mean,
        contradicted,
    })
}

impl SensorVerification {
    /// What the calibration itself says that it may err by beside the noise, in [`Self::unit`]: at the next power-on, if it knows that.
    pub fn announced(&self) -> f64 {
        self.next_power_on
            .or(self.parameter_uncertainty)
            .unwrap_or(0.0)
    }
}

impl Verification {
    /// The sensor that errs by the largest multiple of its noise, with its figures.
    pub fn worst(&self) -> Option<(Sensor, &SensorVerification)> {
        let over = |s: &SensorVerification| s.rms / s.noise_floor;
        let all = self.sensors.present();
        all.max_by(|a, b| over(a.1).total_cmp(&over(b.1)))
    }
}
