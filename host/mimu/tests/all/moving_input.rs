//! Inputs that move within dwells, against physics written here: a platform that swings about a level axis.

use mimu::diagnose::rejected::Reason;
use mimu::diagnose::{Verdict, diagnose};
use mimu::quantity::Sensor;
use mimu::signal::dwell::Fault;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::{Fit, Manifest, Options, Prepared, RawUnit, Reference, Samples, fit};
use mimu_rig::random::Random;

const G: f64 = 9.8;
const RATE_HZ: f64 = 100.0;

/// A unit whose readings are `matrix · input + bias`, some milliseconds later.
struct Unit {
    matrix: [[f64; 3]; 3],
    bias: [f64; 3],
    /// Delay behind the input, s.
    delay: [f64; 3],
    /// Standard deviation of a sample.
    sigma: f64,
}

const GYRO: Unit = Unit {
    matrix: [
        [1.02, 0.013, -0.02],
        [0.008, 0.97, 0.011],
        [-0.017, 0.005, 1.01],
    ],
    bias: [0.02, -0.03, 0.01],
    delay: [4e-3, 3.5e-3, 4.2e-3],
    sigma: 2e-3,
};
const ACCEL: Unit = Unit {
    matrix: [
        [0.99, -0.015, 0.02],
        [0.012, 1.03, -0.007],
        [0.003, 0.021, 0.98],
    ],
    bias: [0.3, -0.2, 0.1],
    delay: [0.5e-3, 0.6e-3, 1.2e-3],
    sigma: 0.02,
};

/// Angle and rate about an axis at a time.
type Turn = fn(f64) -> [f64; 2];

/// Back and forth by half a turn, with a period of five seconds: up to 226 deg/s.
fn swing(t: f64) -> [f64; 2] {
    let w = 2.0 * std::f64::consts::PI * 0.2;
    let size = std::f64::consts::PI;
    [size * (w * t).sin(), size * w * (w * t).cos()]
}

/// Ninety degrees in every block.
fn whirl(t: f64) -> [f64; 2] {
    let rate = 900f64.to_radians();
    [rate * t, rate]
}

/// Rate and force in body axes, rotated about the level body axis `axis`; the next axis points up at first.
fn input(turn: Turn, axis: usize, t: f64) -> [[f64; 3]; 2] {
    let [angle, about] = turn(t);
    let (mut rate, mut force) = ([0.0; 3], [0.0; 3]);
    rate[axis] = about;
    // The body turns one way, so up turns the other way in it.
    force[(axis + 1) % 3] = G * angle.cos();
    force[(axis + 2) % 3] = -G * angle.sin();
    [rate, force]
}

/// Error of the accelerometer, m/s², as a function of rate and force.
type Error = fn([[f64; 3]; 2]) -> [f64; 3];

fn none(_: [[f64; 3]; 2]) -> [f64; 3] {
    [0.0; 3]
}

/// Six faces at rest, 3 s each, then two turns of 10 s about each axis. The reference is `pace` times as fast as the truth.
fn recorded(turn: Turn, error: Error, pace: f64, seed: u64) -> Prepared {
    let mut samples = Samples::default();
    let mut noise = Random::new(seed, "moving input");
    let mut add = |step: i32, count: usize, at: &dyn Fn(f64) -> [[f64; 3]; 2]| {
        for k in 0..count {
            let t = k as f64 / RATE_HZ;
            samples.t_s.push(samples.t_s.len() as f64 / RATE_HZ);
            samples.step.push(step);
            let stated = at(pace * t);
            for (s, unit) in [&GYRO, &ACCEL].into_iter().enumerate() {
                for axis in 0..3 {
                    let truth = at(t - unit.delay[axis]);
                    let mut reading = unit.bias[axis] + unit.sigma * noise.normal();
                    for (p, x) in unit.matrix[axis].iter().zip(truth[s]) {
                        reading += p * x;
                    }
                    if s == 1 {
                        reading += error(truth)[axis];
                    }
                    samples.raw[3 * s + axis].push(reading);
                    let degrees = [1f64.to_degrees(), 1.0][s];
                    samples.reference[3 * s + axis].push(degrees * stated[s][axis]);
                }
            }
        }
    };
    for face in 0..6 {
        let mut force = [0.0; 3];
        force[face / 2] = [G, -G][face % 2];
        add(face as i32, 300, &|_| [[0.0; 3], force]);
    }
    for k in 0..6 {
        add(6 + k as i32, 1000, &|t| input(turn, k % 3, t));
    }
    let manifest = Manifest::new("unit", RATE_HZ, G, RawUnit::Si, Reference::Table);
    Prepared::of(manifest, &samples, STILL_FACTOR).expect("readable")
}

fn fitted(prepared: Prepared) -> Fit {
    let options = Options {
        holdout_blocks: 0,
        ..Options::default()
    };
    fit(prepared, options).expect("it is determined")
}

/// Errors of all parameters and delays in sigmas.
fn errors(fit: &Fit) -> Vec<f64> {
    let mut all = Vec::new();
    for (sensor, unit) in [(Sensor::Gyro, &GYRO), (Sensor::Accel, &ACCEL)] {
        let found = &fit.sensor(sensor).expect("recorded").estimated;
        let truth = unit.matrix.iter().flatten().chain(&unit.bias);
        let parameters = found.triad.forward_estimates();
        all.extend(truth.zip(parameters).map(|(t, p)| (p.value - t) / p.sigma));
        let delays = found.delays.expect("inputs move");
        all.extend((0..3).map(|k| (delays.value[k] - unit.delay[k]) / delays.sigma[k]));
    }
    all
}

#[test]
fn a_unit_that_swings_about_level_axes_is_calibrated_by_the_reference_of_every_instant() {
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 1..9 {
        let fit = fitted(recorded(swing, none, 1.0, seed));
        for dwell in &fit.prepared.dwells.list {
            assert_eq!((dwell.faults.gyro, dwell.faults.accel), (None, None));
        }
        for error in errors(&fit) {
            assert!(error.abs() < 4.5, "seed {seed}: {error} sigma");
            sum += error * error;
            count += 1.0;
        }
    }
    // 240 errors determine an rms of one to 5 %.
    let rms = (sum / count).sqrt();
    assert!((0.8..1.2).contains(&rms), "rms error of {rms} sigma");
}

#[test]
fn a_dwell_whose_reading_does_not_follow_its_reference_is_not_still() {
    let prepared = recorded(swing, none, 0.7, 1);
    let swings = &prepared.dwells.list[6..];
    for dwell in swings {
        assert_eq!(dwell.faults.gyro, Some(Fault::NotStill));
    }
}

#[test]
fn an_input_that_turns_by_a_right_angle_in_a_block_is_too_fast_for_the_one_sensor_that_it_moves_for()
 {
    let prepared = recorded(whirl, none, 1.0, 1);
    for dwell in &prepared.dwells.list[6..] {
        assert_eq!(dwell.faults.accel, Some(Fault::TooFast));
        assert_eq!(dwell.faults.gyro, None);
    }
    let warned = prepared.dwells.warnings.iter().any(|w| {
        w.to_string().starts_with(
            "6 dwells (6, 7, 8, 9, 10, 11) are not used: the input of the accel moves too far",
        )
    });
    assert!(warned, "{:?}", prepared.dwells.warnings);
}

#[test]
fn a_force_that_is_read_with_the_rate_across_it_is_named() {
    let coupled: Error = |[rate, force]| [4e-3 * rate[1] * force[2], 0.0, 0.0];
    let options = Options {
        holdout_blocks: 0,
        ..Options::default()
    };
    let found =
        |error| diagnose(recorded(swing, error, 1.0, 3).into(), options).expect("diagnosed");
    assert_eq!(found(none).verdict, Verdict::Clean);
    let coupled = found(coupled);
    assert_eq!(coupled.verdict, Verdict::Unexplained);
    let accel = coupled.sensors.iter().find(|s| s.sensor == Sensor::Accel);
    let suggested = &accel.expect("recorded").decision.rejected[0];
    assert_eq!(suggested.id, "term:accel_x~rate_y*force_z", "{suggested:?}");
    assert!(
        matches!(suggested.reason, Reason::Suggestion(_)),
        "{suggested:?}"
    );
}
