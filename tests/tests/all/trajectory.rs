//! Units beside a trajectory that was computed from the same curves as their readings.

use mimu::in_use::{Pose, Trajectory};
use mimu::quantity::Sensor;
use mimu::triad::{Angles, Estimate};
use mimu_body::trajectory::ByTrajectories;
use mimu_body::{Body, ByTrajectory};
use mimu_recording::Recording;
use mimu_rig::random::Random;
use mimu_tests::flight::Flight;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// A flight of a unit with errors of a percent, mounted and timed anyhow.
fn flight(seed: u64) -> Flight {
    let mut random = Random::new(seed, "unit");
    let mut vector = |size: f64| Vector3::from_fn(|_, _| size * random.normal());
    let [gyro, accel] = [0, 1].map(|_| Matrix3::from_columns(&[0, 1, 2].map(|_| vector(0.01))));
    Flight {
        duration_s: 180.0,
        error: [gyro, accel],
        bias: [vector(0.01), vector(0.1)],
        mounting: vector(0.5),
        lever_m: vector(0.05),
        late_s: vector(0.1).x,
        reference: [1e-3, 5e-4],
        white: [1.0, 1.0],
        ..Flight::default()
    }
}

/// Errors in units of half a 95 % interval, with their names.
fn errors(seed: u64) -> (ByTrajectory, Vec<(String, f64, f64)>) {
    let flight = flight(seed);
    let (recording, trajectory) = flight.flown(seed);
    let found = ByTrajectory::of(&recording, &trajectory).unwrap();
    let mut errors = Vec::new();
    let mut add = |name: &str, value: f64, half: f64, truth: f64| {
        errors.push((name.to_string(), value - truth, half))
    };
    for (s, sensor) in Sensor::BOTH.into_iter().enumerate() {
        let of = &found.body.triads[s];
        assert_eq!(of.name.to_string(), sensor.to_string());
        let physical = of.triad.physical(Angles::Exact);
        let forward = Matrix3::identity() + flight.error[s];
        for k in 0..3 {
            let scale = &physical.scale[k];
            add(
                &format!("{sensor} scale"),
                scale.value,
                scale.interval,
                forward.row(k).norm(),
            );
            let bias = &physical.bias[k];
            add(
                &format!("{sensor} bias"),
                bias.value,
                bias.interval,
                flight.bias[s][k],
            );
        }
        let delay = of.delay_ms.as_ref().unwrap();
        add(
            &format!("{sensor} delay"),
            delay.value,
            delay.interval,
            -1e3 * flight.late_s,
        );
    }
    let accel = &found.body.triads[1];
    let arm = nalgebra::Rotation3::from_scaled_axis(flight.mounting).inverse() * -flight.lever_m;
    for (k, found) in accel.lever_arm_mm.as_ref().unwrap().iter().enumerate() {
        add("arm", found.value, found.interval, 1e3 * arm[k]);
    }
    (found, errors)
}

#[test]
fn a_unit_by_a_trajectory_is_what_it_is_within_its_intervals() {
    let mut by_kind: std::collections::BTreeMap<String, Vec<(f64, f64)>> = Default::default();
    for seed in 0..8 {
        let (found, errors) = errors(seed);
        let noise = [
            found.attitude_noise_deg.to_radians(),
            found.position_noise_mm.unwrap() / 1e3,
        ];
        println!(
            "{seed}: {}, noise of the instrument {noise:?}",
            found.body.judgement()
        );
        assert!(found.body.judgement().is_good());
        for (found, truth) in noise.iter().zip(flight(seed).reference) {
            assert!((found / truth - 1.0).abs() < 0.25, "{found} {truth}");
        }
        for (name, error, half) in errors {
            by_kind.entry(name).or_default().push((error, half));
        }
    }
    let (mut inside, mut all) = (0, 0);
    for (name, of) in by_kind {
        let rms = (of.iter().map(|(e, _)| e * e).sum::<f64>() / of.len() as f64).sqrt();
        let own = of.iter().filter(|(e, half)| e.abs() < *half).count();
        println!(
            "{name}: rms {rms:.3e}, half {:.3e}, {own} of {}",
            of[0].1,
            of.len()
        );
        inside += own;
        all += of.len();
    }
    let share = inside as f64 / all as f64;
    assert!((0.9..=0.99).contains(&share), "{share}");
}

/// The poses of `trajectory` as another instrument would write them.
fn written(trajectory: &Trajectory, each: impl Fn(&Pose) -> Pose) -> Trajectory {
    let rows = trajectory.poses().iter().map(|pose| {
        let Pose {
            t_s,
            attitude: q,
            position: p,
        } = each(pose);
        format!(
            "{t_s} {} {} {} {} {} {} {}",
            p.x, p.y, p.z, q.i, q.j, q.k, q.w
        )
    });
    Trajectory::parse(&rows.collect::<Vec<_>>().join("\n"), "written").unwrap()
}

#[test]
fn reversed_quaternions_and_another_axis_up_give_the_same_and_another_motion_is_refused() {
    let (recording, trajectory) = flight(1).flown(1);
    let scale = |trajectory: &Trajectory| {
        let found = ByTrajectory::of(&recording, trajectory).unwrap();
        let of = &found.body.triads[1].triad;
        (of.physical(Angles::Exact).scale[0].value, found)
    };
    let (expected, _) = scale(&trajectory);
    let (reversed, found) = scale(&written(&trajectory, |pose| Pose {
        attitude: pose.attitude.inverse(),
        ..*pose
    }));
    assert!(
        found.reversed && (reversed - expected).abs() < 1e-6,
        "{reversed}"
    );
    let level = UnitQuaternion::from_scaled_axis(-Vector3::x() * std::f64::consts::FRAC_PI_2);
    let (turned, found) = scale(&written(&trajectory, |pose| Pose {
        t_s: pose.t_s + 5.0,
        attitude: level * pose.attitude,
        position: level * pose.position,
    }));
    assert_eq!(found.up, Some("y"));
    assert!((turned - expected).abs() < 1e-6, "{turned} {expected}");
    let (_, other) = flight(2).flown(2);
    let refused = ByTrajectory::of(&recording, &other)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("not those of the recording"), "{refused}");
}

/// Error of the frame of the instrument, rms of an element: a calibration of cameras by a wand is good to a few millimetres in a metre.
const STRAIN: f64 = 3e-3;

/// Flights of one unit, each with its own mounting, arm, clock, biases and distortion of the instrument.
fn flights(unit: u64, count: u64, strain: f64) -> Vec<(Recording, Trajectory)> {
    let common = flight(unit);
    let each = (0..count).map(|k| {
        let seed = 1000 + 100 * unit + k;
        let mut random = Random::new(seed, "recording");
        let mut vector = |size: f64| Vector3::from_fn(|_, _| size * random.normal());
        let strain = Matrix3::from_columns(&[0, 1, 2].map(|_| vector(strain)));
        let bias = [common.bias[0] + vector(1e-3), common.bias[1] + vector(1e-2)];
        let of = Flight {
            strain,
            bias,
            ..flight(seed)
        };
        let error = common.error;
        Flight { error, ..of }.flown(seed)
    });
    each.collect()
}

/// The frame of a triad whose sensors have these directions, by rows: x along its x, y in the plane of its first two; as columns.
fn frame(forward: &Matrix3<f64>) -> Matrix3<f64> {
    let [x, y] = [0, 1].map(|k| forward.row(k).transpose());
    let x = x.normalize();
    let y = (y - x * x.dot(&y)).normalize();
    Matrix3::from_columns(&[x, y, x.cross(&y)])
}

/// Scale factors, non-orthogonalities, and the turn from `body` to its own frame, of sensors with these directions.
fn geometry(forward: &Matrix3<f64>, body: &Matrix3<f64>) -> Vec<f64> {
    let own = frame(forward);
    let unit = |k: usize| forward.row(k).transpose().normalize();
    let sine = |k: usize, axis: usize| unit(k).dot(&own.column(axis));
    let turn = Rotation3::from_matrix_unchecked(own.transpose() * body);
    let (x, y, z) = turn.euler_angles();
    let scales = (0..3).map(|k| forward.row(k).norm());
    let angles = [sine(1, 0).asin(), -sine(2, 0).asin(), sine(2, 1).asin()];
    scales.chain(angles).chain([x, y, z]).collect()
}

/// Scale factors and angles of a fit, without those that define the frame, in the order of [`geometry`], and by how much they err.
fn shape_errors(body: &Body, unit: u64) -> Vec<(Estimate, f64)> {
    let error = flight(unit).error;
    let forward = error.map(|error| Matrix3::identity() + error);
    let accel = frame(&forward[1]);
    let mut all = Vec::new();
    for (triad, forward) in body.triads.iter().zip(&forward) {
        let found = triad.triad.physical(Angles::Exact);
        let found = [found.scale, found.non_orthogonality, found.misalignment];
        let truth = geometry(forward, &accel);
        let both = found.into_iter().flatten().zip(truth);
        all.extend(both.map(|(found, truth)| (found, found.value - truth)));
    }
    // The accelerometer has no misalignment: it defines the frame.
    all.truncate(15);
    all
}

/// How many scale factors and angles of a body are within their intervals, and of how many.
fn inside(body: &Body, unit: u64) -> [f64; 2] {
    let all = shape_errors(body, unit);
    let inside = all
        .iter()
        .filter(|(found, error)| error.abs() < found.interval);
    [inside.count(), all.len()].map(|count| count as f64)
}

#[test]
fn several_recordings_show_what_an_instrument_errs_by_in_each() {
    let (mut together, mut alone) = ([0.0; 2], [0.0; 2]);
    for unit in 0..2 {
        let found = ByTrajectories::of(&flights(unit, 3, STRAIN)).unwrap();
        println!("unit {unit}: {}", found.body.judgement());
        let add = |sums: &mut [f64; 2], body: &Body| {
            let own = inside(body, unit);
            *sums = [sums[0] + own[0], sums[1] + own[1]];
        };
        add(&mut together, &found.body);
        found.each.iter().for_each(|one| add(&mut alone, &one.body));
        let held = found.held_out.iter().flat_map(|of| of.present());
        let held: Vec<_> = held.collect();
        assert_eq!(held.len(), 6);
        for (_, held) in held {
            // White noise is in both, so that their ratio says little: a person looks at the sign.
            assert!(held.by_others.rms < held.rms_without, "{held:?}");
        }
    }
    println!("together {together:?}, alone {alone:?}");
    // Of 30 values with a share of 95 %, 25 or fewer would be inside once in 60 times if they were independent; those of a unit are not.
    assert!(together[0] >= 0.8 * together[1], "{together:?}");
    assert!(alone[0] < 0.7 * alone[1], "{alone:?}");
}

#[test]
#[ignore = "72 flights, three minutes"]
fn intervals_of_several_recordings_hold_and_those_of_one_do_not() {
    let counts = [1, 2, 3, 6];
    let mut sums = [[0.0; 2]; 4];
    let mut good = 0;
    for unit in 0..12 {
        let fits = flights(unit, 6, STRAIN).into_iter();
        let fits = fits.map(|(recording, by)| ByTrajectory::of(&recording, &by).unwrap().body);
        let fits: Vec<Body> = fits.collect();
        good += fits
            .iter()
            .filter(|body| body.judgement().is_good())
            .count();
        for (sums, count) in sums.iter_mut().zip(counts) {
            for some in fits.chunks(count) {
                let own = inside(&Body::combined(some), unit);
                *sums = [sums[0] + own[0], sums[1] + own[1]];
            }
        }
        let shares = sums.map(|[inside, all]| inside / all);
        println!("after unit {unit}, {counts:?} recordings: {shares:?}, {good} judged good alone");
    }
    let shares = sums.map(|[inside, all]| inside / all);
    assert!(shares[0] < 0.7, "{shares:?}");
    // They are the intervals of a further recording with its own errors of the instrument, so they hold what is constant more often.
    assert!(shares[2..].iter().all(|share| *share >= 0.93), "{shares:?}");
}
