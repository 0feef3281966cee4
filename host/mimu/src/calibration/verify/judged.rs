//! The judgement of a verification.

use nalgebra::DMatrix;

use super::causes::{Causes, INTERVAL};
use super::{PowerOn, SensorVerification, Verification};
use crate::calibration::Calibration;
use crate::estimate::earth_shared;
use crate::estimate::least_squares::root;
use crate::fit::by_rate::magnitudes;
use crate::fit::predicted::{self, Both};
use crate::judge::errors::{self, ErrorFigures};
use crate::judge::input;
use crate::judgement::{Judgement, JudgementKind};
use crate::observation::vector;
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::{Figure, Sensor, plural};
use crate::recording_problem::RecordingProblem;
use crate::sessions::class::PartClass;
use crate::triad::{Covariance, Forward};
use crate::turntable::RatedDwells;
use crate::unseen::{Test, Unseen, limit};
use crate::warning::Warning;
use mimu_core::compensation::Affine;
use mimu_recording::Reference;

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
        readable: s.figure.readable(sensor),
        error: s.rms,
        unseen,
        input: input_size(prepared, sensor, s.figure),
        test: s.test,
        cause: s.causes.as_ref().map(Causes::words),
        too_few: (!s.bias_moved.is_empty()).then(|| {
            let restarts = plural(s.bias_moved.len() as u64, "other power-on");
            format!("the biases of {restarts} leave too few errors to judge by: record more poses")
        }),
    }
}

/// How the errors of `sensor` in this recording compare with the noise and with what the calibration's parameters are known to err by. `None` if the noise is
/// unknown, or if nothing judges the sensor. A change of the biases has a test for itself too: three numbers show little among the errors of many dwells. `taken`: degrees
/// of freedom that the biases of other power-ons took.
pub(super) fn test(
    prepared: &Prepared,
    sensor: Sensor,
    calibration: &Calibration,
    (power_on, taken, causes): (PowerOn, f64, Option<&Causes>),
) -> Option<Test> {
    let covariance = covariance(prepared, sensor, calibration, power_on);
    let of_errors = of_errors(
        prepared,
        sensor,
        calibration,
        (power_on, taken, &covariance),
    )?;
    // Within a power-on the errors have all that the noise predicts of the biases already.
    let causes = causes.filter(|_| power_on == PowerOn::Another);
    let of_biases = causes.and_then(|causes| of_biases(causes, &covariance));
    Some(match of_biases {
        Some(test) if test.fails() && !of_errors.fails() => Test {
            predicted: of_errors.predicted,
            noise: of_errors.noise,
            ..test
        },
        _ => of_errors,
    })
}

/// The changes of the biases over what is predicted of them. `None` if the recording does not show them.
fn of_biases(causes: &Causes, covariance: &Covariance) -> Option<Test> {
    let squares = (0..3).filter_map(|k| {
        let shown = causes.bias_change_interval[k] / INTERVAL;
        let square = causes.bias_change[k].powi(2) / (covariance[(9 + k, 9 + k)] + shown * shown);
        square.is_finite().then_some(square)
    });
    let squares: Vec<f64> = squares.collect();
    let count = squares.len();
    let ratio = (squares.iter().sum::<f64>() / count as f64).sqrt();
    (count > 0).then(|| Test::of_ratio(ratio, limit(count as f64), count))
}

fn of_errors(
    prepared: &Prepared,
    sensor: Sensor,
    calibration: &Calibration,
    (power_on, taken, covariance): (PowerOn, f64, &Covariance),
) -> Option<Test> {
    let model = calibration.inverse(sensor)?;
    let known = |s: &Sensor| prepared.noise.is_known(*s);
    let by_turns = prepared.manifest.reference == Reference::Gravity && sensor == Sensor::Gyro;
    let of = if by_turns {
        &Sensor::BOTH[..]
    } else {
        std::slice::from_ref(&sensor)
    };
    if !of.iter().all(known) {
        return None;
    }
    let own = [(sensor, &model)];
    let factor = root(&covariance.resize(12, 12, 0.0));
    let unseen = match (prepared.manifest.reference, sensor) {
        (Reference::Table, _) => inputs(prepared, sensor, &model, &factor)?,
        (Reference::Gravity | Reference::TurntableRate, Sensor::Accel) => {
            predicted::unseen(&prepared.magnitudes(&model), &own, &factor)
        }
        (Reference::TurntableRate, Sensor::Gyro) => {
            let dwells = RatedDwells::of(prepared).ok()?;
            predicted::unseen(&magnitudes(&dwells, &model), &own, &factor)
        }
        (Reference::Gravity, Sensor::Gyro) => {
            let accel = calibration
                .inverse(Sensor::Accel)
                .unwrap_or_else(Affine::identity);
            let both = Both {
                gyro: *covariance,
                accel: self::covariance(prepared, Sensor::Accel, calibration, power_on),
                follows: Covariance::zeros(),
            };
            predicted::directions(&prepared.turns(&accel).0, [&model, &accel], &both)
        }
    };
    Test::of(&[unseen], (f64::INFINITY, 0.0), taken)
}

/// Covariance of C by rows, then o, of `sensor` in this recording: what noise gives, and how biases change between sessions.
///
/// A calibration of one session does not say what a power-on changes. Without that, a bias that moved by a fraction of a milli-g would be an error of
/// the calibration on quiet units: 3.1 times the noise of a tactical unit by its wander alone.
fn covariance(
    prepared: &Prepared,
    sensor: Sensor,
    calibration: &Calibration,
    power_on: PowerOn,
) -> Covariance {
    let mut covariance = calibration.known_covariance(sensor);
    if let Some((next, sigmas)) = calibration.next_power_on(sensor) {
        // Few sessions show the variance between them roughly.
        covariance = next * (sigmas / INTERVAL).powi(2);
    }
    if let Some(model) = calibration.inverse(sensor) {
        covariance += prepared.noise.between_sessions(sensor, &model.matrix);
    }
    if power_on == PowerOn::Another && calibration.next_power_on(sensor).is_none() {
        let sigma = PartClass::default().bias_change(sensor);
        for k in 9..12 {
            covariance[(k, k)] += sigma * sigma;
        }
    }
    covariance
}

/// Errors at known inputs, three for each dwell.
fn inputs(
    prepared: &Prepared,
    sensor: Sensor,
    model: &Affine<f64>,
    factor: &DMatrix<f64>,
) -> Option<Unseen> {
    let forward = Forward::of(model)?;
    let all = earth_shared::likely(&prepared.observations(sensor), &forward.matrix);
    let blocks: Vec<_> = all
        .iter()
        .map(|o| vector::at(model, &o.raw, &o.input))
        .collect();
    let errors = blocks
        .iter()
        .flat_map(|b| <[f64; 3]>::from(b.residual))
        .collect::<Vec<f64>>();
    let noise = all
        .iter()
        .flat_map(|o| <[f64; 3]>::from(si_covariance(&model.matrix, &o.variance).diagonal()));
    let noise: Vec<f64> = noise.collect();
    let by = DMatrix::from_fn(errors.len(), 12, |i, j| blocks[i / 3].by[(i % 3, j)]);
    Some(Unseen::of(errors.into(), noise.into(), &by, factor))
}

/// The judgement of the figures of `prepared`; `warnings` are those of the verification.
pub(super) fn judgement(
    prepared: &Prepared,
    calibration: &Calibration,
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
    let by_errors = errors::judge(&figures);
    let all = input::judgements(&problems, warnings).into_iter();
    let all = all.chain([by_errors.clone()]).chain(of_file(calibration));
    Judgement::worst(all).unwrap_or(by_errors)
}

/// The judgement that the file itself states: the ceiling of what any data say of it. Only what its own data left untested, others can test.
fn of_file(calibration: &Calibration) -> Option<Judgement> {
    let own = calibration.judgement.as_ref()?;
    let reason = format!("the calibration itself is judged {own}");
    (own.kind > JudgementKind::Untested).then(|| Judgement::new(own.kind, reason))
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

impl Verification {
    /// The sensor that errs by the largest multiple of its noise, with its figures.
    pub fn worst(&self) -> Option<(Sensor, &SensorVerification)> {
        let over = |s: &SensorVerification| s.test.map_or(s.rms / s.noise_floor, |t| t.ratio);
        let all = self.sensors.present();
        all.max_by(|a, b| over(a.1).total_cmp(&over(b.1)))
    }
}
