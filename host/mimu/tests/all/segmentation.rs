//! Dwells found in simulated logs that are hard to segment, and faults of logs that rests show.

use mimu::fit::{Options, fit, fit_or_faces};
use mimu::judgement::{Judgement, JudgementKind};
use mimu::quantity::Sensor;
use mimu::recording_problem::RecordingProblem;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::triad::Angles;
use mimu::turntable::RatedDwells;
use mimu::warning::Warning;
use mimu::{Manifest, Prepared, RawUnit, Reference, Samples};
use mimu_recording::health::Fault;
use mimu_recording::{Turntable, TurntableRate};
use mimu_rig::random::Random;
use nalgebra::{Matrix3, Rotation3, Vector3};

const G: f64 = 9.80665;
const RATE_HZ: f64 = 100.0;
/// Counts per g and per rad/s, as of an MPU-6050.
const PER_G: f64 = 16384.0;
const PER_RATE: f64 = 131.0 * 57.29578;
/// Standard deviations of a sample, counts.
const NOISE: [f64; 2] = [45.0, 7.0];
/// Bias of the gyro, counts.
const BIAS: [f64; 3] = [261.0, 157.0, 366.0];

/// A unit in the hands of somebody, and what it has recorded.
struct Log {
    attitude: Rotation3<f64>,
    random: Random,
    samples: Samples,
}

impl Log {
    fn new(seed: u64) -> Self {
        Self {
            attitude: Rotation3::identity(),
            random: Random::new(seed, "log"),
            samples: Samples::default(),
        }
    }

    fn unit_vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.random.normal()).normalize()
    }

    /// Records one sample while the body turns at `rate`, rad/s, and accelerates by `motion`, m/s², both in its own axes.
    fn sample(&mut self, rate: Vector3<f64>, motion: Vector3<f64>) {
        let force = self.attitude.inverse() * Vector3::new(0.0, 0.0, G) + motion;
        let gyro = Vector3::from(BIAS) + PER_RATE * rate;
        let accel = Vector3::new(-340.0, 170.0, -195.0) + PER_G / G * force;
        let t_s = self.samples.t_s.len() as f64 / RATE_HZ;
        self.samples.t_s.push(t_s);
        for k in 0..3 {
            let noise = [NOISE[1], NOISE[0]].map(|sigma| sigma * self.random.normal());
            self.samples.raw[k].push((gyro[k] + noise[0]).round());
            self.samples.raw[3 + k].push((accel[k] + noise[1]).round());
        }
        self.attitude *= Rotation3::new(rate / RATE_HZ);
    }

    fn rest(&mut self, s: f64) {
        for _ in 0..(s * RATE_HZ) as usize {
            self.sample(Vector3::zeros(), Vector3::zeros());
        }
    }

    /// A turn by `angle` about a random axis that begins and ends gently.
    fn turn(&mut self, angle: f64, s: f64) {
        let axis = self.unit_vector();
        let n = (s * RATE_HZ) as usize;
        for i in 0..n {
            let phase = std::f64::consts::TAU * (i as f64 + 0.5) / n as f64;
            self.sample(axis * (angle / s * (1.0 - phase.cos())), Vector3::zeros());
        }
    }

    /// Rests in `poses` poses, with turns between them.
    fn session(mut self, poses: usize) -> Samples {
        self.rest(4.0);
        for _ in 1..poses {
            let angle = 1.0 + self.random.uniform();
            self.turn(angle, 1.3);
            self.rest(2.6);
        }
        self.samples
    }
}

fn by_hand(samples: &Samples) -> mimu_recording::error::Result<Prepared> {
    let manifest = Manifest::new("u", RATE_HZ, G, RawUnit::Count, Reference::Gravity);
    Prepared::of(manifest, samples, STILL_FACTOR)
}

fn first_rows(samples: &Samples, rows: usize) -> Samples {
    kept(samples, |row| row < rows)
}

/// The rows that `keep` takes.
fn kept(samples: &Samples, keep: impl Fn(usize) -> bool) -> Samples {
    let of = |column: &Vec<f64>| {
        let each = column.iter().enumerate().filter(|(row, _)| keep(*row));
        each.map(|(_, value)| *value).collect()
    };
    Samples {
        t_s: of(&samples.t_s),
        raw: samples.raw.each_ref().map(of),
        ..Samples::default()
    }
}

fn used(prepared: &Prepared) -> usize {
    let list = prepared.dwells.list.iter();
    list.filter(|d| Sensor::BOTH.iter().all(|s| d.faults[*s].is_none()))
        .count()
}

/// Poses of `rows` samples of an accelerometer alone, in counts, one directly after another; every other one is `near` (rad) to the one
/// before.
fn abutting(seed: u64, poses: usize, rows: usize, near: f64) -> Samples {
    let mut log = Log::new(seed);
    for pose in 0..poses {
        let turn = match pose % 2 {
            // About a level axis: a turn about the vertical is none for an accelerometer.
            1 => {
                let up = log.attitude.inverse() * Vector3::z();
                let level = log.unit_vector().cross(&up).normalize();
                Rotation3::new(near * level)
            }
            _ => Rotation3::new(log.unit_vector() * (0.5 + 2.0 * log.random.uniform())),
        };
        log.attitude *= turn;
        log.rest(rows as f64 / RATE_HZ);
    }
    let Samples { t_s, mut raw, .. } = log.samples;
    raw[..3].iter_mut().for_each(Vec::clear);
    Samples {
        t_s,
        raw,
        ..Samples::default()
    }
}

#[test]
fn poses_that_follow_one_another_without_a_pause_are_dwells_of_their_own_down_to_two_degrees() {
    for (rows, seed) in [(240, 1), (243, 2)] {
        let samples = abutting(seed, 24, rows, 2f64.to_radians());
        let found = by_hand(&samples).unwrap().dwells.list;
        assert_eq!(found.len(), 24, "{rows} rows each");
        for (k, dwell) in found.iter().enumerate() {
            let pose = (k * rows) as u64..((k + 1) * rows) as u64;
            let inside = pose.contains(&dwell.first_row)
                && pose.contains(&(dwell.first_row + dwell.rows - 1));
            assert!(inside, "{rows} rows each, dwell {k}: {dwell:?}");
        }
    }
}

#[test]
fn a_rest_that_creeps_or_whose_bias_drifts_is_one_dwell() {
    let mut log = Log::new(4);
    for _ in 0..30 {
        log.turn(1.5, 1.3);
        // Ten seconds, in which a hand sinks by two degrees.
        let level = (log.attitude.inverse() * Vector3::z()).cross(&log.unit_vector());
        let creep = level.normalize() * 2f64.to_radians() / 10.0;
        for _ in 0..1000 {
            log.sample(creep, Vector3::zeros());
        }
    }
    let found = by_hand(&log.samples).unwrap().dwells.list;
    assert_eq!(found.len(), 30);
}

#[test]
fn a_walk_without_a_rest_has_no_dwell() {
    for seed in 1..=4 {
        let mut log = Log::new(seed);
        // Two steps a second. Heading, roll and pitch swing with the stride, the body bounces with each step, and each heel strike rings.
        let heading = |i: usize| 0.3 * (i as f64 / 700.0).sin();
        for i in 0..12_000 {
            let stride = std::f64::consts::TAU * i as f64 / RATE_HZ;
            let swing = 1.0 + 0.2 * log.random.normal();
            let rate = Vector3::new(
                0.8 * stride.sin() + 0.3 * (2.0 * stride).cos(),
                0.5 * (2.0 * stride + 0.4).sin(),
                heading(i) + 0.4 * stride.cos(),
            ) * swing;
            let heel = (-((i % 50) as f64) / 4.0).exp();
            let bounce = Vector3::new(
                0.8 * (2.0 * stride).sin(),
                0.6 * stride.sin(),
                2.0 * (2.0 * stride).cos() + 4.0 * heel,
            );
            // Posture swings about the upright.
            log.attitude =
                Rotation3::from_euler_angles(0.13 * stride.cos(), 0.05 * (2.0 * stride).cos(), 0.0);
            log.sample(rate, bounce);
        }
        let found = by_hand(&log.samples).map(|p| p.dwells.list.len());
        assert!(found.is_err(), "{seed}: {found:?}");
    }
}

#[test]
fn the_row_in_which_the_accelerometers_range_changes_is_named_and_neither_part_is_fitted_as_the_whole()
 {
    for (seed, factor) in [(6, 2.0), (7, 0.5), (8, 4.0)] {
        let mut samples = Log::new(seed).session(30);
        // In a turn, and in a rest.
        let row = [6000, 5210][seed as usize % 2];
        for column in &mut samples.raw[3..] {
            column[row..]
                .iter_mut()
                .for_each(|u| *u = (*u * factor).round());
        }
        let prepared = by_hand(&samples).unwrap();
        let fault = prepared.dwells.fault.expect("a fault");
        assert_eq!(
            (fault.rows.first, fault.fault),
            (Some(row as u64 + 1), Fault::RangeChanged { ratio: factor })
        );
        let problems = RecordingProblem::without_fit(&prepared);
        assert!(problems.iter().any(|p| p.id() == "range_change"));
        let refused = fit(prepared, Options::default()).expect_err("two ranges");
        assert!(
            refused.to_string().contains(&format!("row {}", row + 1)),
            "{refused}"
        );
        let part = by_hand(&first_rows(&samples, row)).unwrap();
        assert_eq!(part.dwells.fault, None);
        assert!(fit(part, Options::default()).is_ok());
    }
}

/// Some parts have zeros of half a g (a log of `shenshikexmu/IMUCalibration-Gesture` has 0.42 and 0.50 g on two axes).
#[test]
fn a_bias_of_half_a_g_is_no_change_of_range() {
    for seed in 20..24 {
        let mut samples = Log::new(seed).session(30);
        let g = samples.raw[3..]
            .iter()
            .flatten()
            .fold(0.0, |most, u| f64::max(most, *u))
            / 1.1;
        for (column, bias) in samples.raw[3..].iter_mut().zip([0.02, 0.42, 0.5]) {
            column.iter_mut().for_each(|u| *u = (*u + bias * g).round());
        }
        let prepared = by_hand(&samples).unwrap();
        assert_eq!(prepared.dwells.fault, None, "{seed}");
    }
}

/// Every second second is missing: no turn is complete, and the calibration has no gyro.
#[test]
fn a_fit_whose_gyro_has_no_turns_is_not_good() {
    let samples = Log::new(6).session(30);
    let second = RATE_HZ as usize;
    let prepared = by_hand(&kept(&samples, |row| (row / second).is_multiple_of(2))).unwrap();
    let both = fit(prepared.clone(), Options::default()).unwrap();
    assert!(both.sensor(Sensor::Gyro).is_none());
    let judgement = Judgement::of_fit(&both);
    assert_eq!(judgement.kind, JudgementKind::Untested, "{judgement}");
    assert!(judgement.reason.contains("no turn connects"), "{judgement}");
    let only = Some(Sensor::Accel);
    let alone = fit(
        prepared,
        Options {
            only,
            ..Options::default()
        },
    )
    .unwrap();
    let judgement = Judgement::of_fit(&alone);
    assert!(
        !judgement.reason.contains("no turn connects"),
        "{judgement}"
    );
}

#[test]
fn sessions_without_a_fault_of_the_log_have_none() {
    for seed in 20..30 {
        let prepared = by_hand(&Log::new(seed).session(25)).unwrap();
        assert_eq!(prepared.dwells.fault, None);
        assert_eq!(used(&prepared), 25);
    }
}

/// A gyro in deg/s on a record player, in `orientations`: at rest, and at 200 and 270 deg/s, whose platter wobbles by 0.25 deg/s and
/// approaches its rate exponentially. Between them a hand lays it in another orientation.
fn on_a_record_player(seed: u64, orientations: usize) -> (Samples, Matrix3<f64>) {
    let mut random = Random::new(seed, "player");
    let scale = Matrix3::new(1.015, 0.0, 0.0, -0.010, 0.988, 0.0, 0.003, -0.009, 0.998);
    let mut samples = Samples::default();
    let mut put = |rate: Vector3<f64>, random: &mut Random| {
        let raw = scale * rate + Vector3::new(-0.8, 0.5, 2.1);
        samples.t_s.push(samples.t_s.len() as f64 / RATE_HZ);
        for k in 0..3 {
            let read = raw[k] + 0.06 * random.normal();
            samples.raw[k].push(((read / 0.07).round() * 0.07).to_radians());
        }
    };
    for rate in [0.0_f64, 200.0, 270.0] {
        for _ in 0..orientations {
            let up = Vector3::from_fn(|_, _| random.normal()).normalize();
            let side = up
                .cross(&Vector3::from_fn(|_, _| random.normal()))
                .normalize();
            for i in 0..300 {
                let t = i as f64 / RATE_HZ;
                let wobble = 0.25 * (rate.to_radians() * t).sin() * f64::from(u8::from(rate > 0.0));
                let turned = rate * (1.0 - (-t / 0.25f64).exp());
                put(up * turned + side * wobble, &mut random);
            }
            let mut hand = Vector3::zeros();
            for _ in 0..130 {
                hand = 0.9 * hand + 6.0 * Vector3::from_fn(|_, _| random.normal());
                put(hand, &mut random);
            }
        }
    }
    (samples, scale)
}

#[test]
fn a_turning_platter_that_wobbles_has_a_dwell_in_each_orientation() {
    for seed in 1..=3 {
        let (samples, scale) = on_a_record_player(seed, 16);
        let mut manifest = Manifest::new("u", RATE_HZ, G, RawUnit::Si, Reference::TurntableRate);
        let rates: Vec<TurntableRate> = ["200", "270"].map(|r| r.parse().unwrap()).into();
        manifest.turntable = Some(Turntable::new(&rates, 1e-4));
        let prepared = Prepared::of(manifest, &samples, STILL_FACTOR).unwrap();
        let rated = RatedDwells::of(&prepared).unwrap();
        for rate in 0..2 {
            let found = rated.rate_of.iter().filter(|r| **r == rate).count();
            assert_eq!(found, 16, "{seed}: at rate {rate}");
        }
        assert!(rated.rests.len() >= 16, "{}", rated.rests.len());
        let fit = fit(prepared, Options::default()).unwrap();
        let gyro = fit.sensor(Sensor::Gyro).unwrap();
        let found = gyro.estimated.triad.forward.matrix;
        for k in 0..3 {
            let ratio = found.row(k).norm() / scale.row(k).norm();
            assert!((ratio - 1.0).abs() < 1e-3, "{seed}, axis {k}: {ratio}");
        }
    }
}

#[test]
fn a_table_about_one_level_axis_calibrates_that_axis_and_names_what_stays_open() {
    for seed in 1..=5 {
        let mut log = Log::new(seed);
        // The axis z lies level, so that gravity turns through x and y.
        log.attitude = Rotation3::new(Vector3::new(1.55, 0.02, 0.0));
        let axis = Vector3::new(0.02, -0.01, -1.0).normalize();
        let rates = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0];
        for dps in rates {
            log.rest(10.0);
            (0..(20.0 * RATE_HZ) as usize)
                .for_each(|_| log.sample(axis * f64::to_radians(dps), Vector3::zeros()));
        }
        log.rest(10.0);
        let mut manifest = Manifest::new("u", RATE_HZ, G, RawUnit::Count, Reference::TurntableRate);
        let rates = rates.map(|r| r.to_string().parse::<TurntableRate>().unwrap());
        manifest.turntable = Some(Turntable::new(&rates, 1e-3));
        let prepared = Prepared::of(manifest, &log.samples, STILL_FACTOR).unwrap();
        let fit = fit_or_faces(prepared, Options::default()).unwrap();
        assert_eq!(Judgement::of_fit(&fit).kind, JudgementKind::Untested);
        let gyro = fit.sensor(Sensor::Gyro).unwrap();
        let physical = gyro.estimated.triad.physical(Angles::Exact);
        let z = physical.scale[2];
        assert!(
            (z.value / PER_RATE - 1.0).abs() < z.interval / PER_RATE,
            "{z:?}"
        );
        assert!(z.interval < 2e-3 * PER_RATE, "{z:?}");
        assert!(physical.scale[0].interval > 0.02 * PER_RATE);
        for (bias, truth) in physical.bias.iter().zip(BIAS) {
            assert!(
                (bias.value - truth).abs() < bias.interval,
                "{bias:?} {truth}"
            );
        }
        let open = fit.all_warnings().find_map(|w| match w {
            Warning::Of(_, warning) => match &**warning {
                Warning::LeftOpen { parameters, .. } => Some(parameters.join(", ")),
                _ => None,
            },
            _ => None,
        });
        let open = open.unwrap();
        for (name, named) in [("factor x", true), ("factor y", true), ("factor z", false)] {
            assert_eq!(open.contains(name), named, "{open}");
        }
    }
}

#[test]
fn a_face_that_reads_differently_each_time_is_named() {
    for moves in [0.0, 100.0] {
        let mut log = Log::new(7);
        for dwell in 0..18 {
            let (x, y, half) = (Vector3::x(), Vector3::y(), std::f64::consts::FRAC_PI_2);
            let up = [
                x * 0.0,
                x * half,
                x * -half,
                y * half,
                y * -half,
                x * 2.0 * half,
            ];
            let tilt = log.unit_vector() * 0.02;
            log.attitude = Rotation3::new(tilt) * Rotation3::new(up[dwell % 6]);
            let from = log.samples.t_s.len();
            log.rest(3.0);
            let moved = moves * (dwell / 6) as f64;
            log.samples.raw[5][from..]
                .iter_mut()
                .for_each(|u| *u += moved);
        }
        log.samples.raw[..3].iter_mut().for_each(Vec::clear);
        let fit = fit_or_faces(by_hand(&log.samples).unwrap(), Options::default()).unwrap();
        let told: Vec<String> = fit.all_warnings().map(ToString::to_string).collect();
        let named = told
            .iter()
            .find(|w| w.contains("between dwells on one face"));
        assert_eq!(named.is_some(), moves > 0.0, "{told:?}");
        assert!(
            named.is_none_or(|w| w.starts_with("accel: z differs by up to 2")),
            "{named:?}"
        );
    }
}
