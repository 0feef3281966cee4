//! Units beside a trajectory that was computed from the same curves as their readings.

use mimu::in_use::{Pose, Trajectory};
use mimu::quantity::Sensor;
use mimu::triad::Angles;
use mimu_body::ByTrajectory;
use mimu_rig::random::Random;
use mimu_tests::flight::Flight;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

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
        rests: false,
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
