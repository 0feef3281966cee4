//! An accelerometer off the axis of a table, against physics written here: the force that the reference lacks does not bias the parameters, and the
//! intervals contain the truth.

use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::warning::Warning;
use mimu::{
    Calibration, Fit, Manifest, Options, Prepared, RawUnit, Reference, Samples, fit, verify,
};
use mimu_rig::random::Random;

const G: f64 = 9.8;
const RATE_HZ: f64 = 50.0;
const MATRIX: [[f64; 3]; 3] = [
    [0.99, -0.015, 0.02],
    [0.012, 1.03, -0.007],
    [0.003, 0.021, 0.98],
];
const BIAS: [f64; 3] = [0.3, -0.2, 0.1];

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

/// Dwells of two seconds: all faces turned in both directions at 250 deg/s, and corners at rest. `arm`: from the axis to the sensor, m.
fn recording(arm: [f64; 3], seed: u64) -> Samples {
    let mut random = Random::new(seed, "lever arm");
    let mut steps = Vec::new();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let up = [0, 1, 2].map(|i| if i == axis { sign } else { 0.0 });
            steps.extend([(up, 250.0), (up, -250.0)]);
        }
    }
    for k in 0..8 {
        let up = [0, 1, 2].map(|i| (1.0 - 2.0 * f64::from(k >> i & 1)) / 3f64.sqrt());
        steps.push((up, 0.0));
    }
    let mut samples = Samples::default();
    for (number, (up, rate_dps)) in (0..).zip(steps) {
        for _ in 0..(2.0 * RATE_HZ) as usize {
            let rate = up.map(|u: f64| (u * rate_dps).to_radians());
            let squared = dot(rate, rate);
            let along = dot(rate, arm);
            // Up against gravity, and towards the axis: w (w r) - w² r.
            let force: [f64; 3] =
                std::array::from_fn(|i| G * up[i] + rate[i] * along - squared * arm[i]);
            samples.t_s.push(samples.t_s.len() as f64 / RATE_HZ);
            samples.step.push(number);
            samples.temp_c.push(25.0);
            for i in 0..3 {
                samples.raw[i].push(rate[i] + 2e-3 * random.normal());
                samples.raw[3 + i].push(dot(MATRIX[i], force) + BIAS[i] + 0.02 * random.normal());
                samples.reference[i].push(up[i] * rate_dps);
                samples.reference[3 + i].push(G * up[i]);
            }
        }
    }
    samples
}

fn prepared(samples: &Samples) -> Prepared {
    let manifest = Manifest::new("u", RATE_HZ, G, RawUnit::Si, Reference::Table);
    Prepared::of(manifest, samples, STILL_FACTOR).unwrap()
}

fn fitted(samples: &Samples) -> Fit {
    fit(prepared(samples), Options::default()).unwrap()
}

/// Largest error of a forward parameter, in halves of its interval, and of a bias, m/s².
fn off(fit: &Fit) -> (f64, f64) {
    let triad = &fit.sensor(Sensor::Accel).unwrap().estimated.triad;
    let truth = [MATRIX.concat(), BIAS.to_vec()].concat();
    let both = triad.forward_estimates().into_iter().zip(truth);
    both.enumerate()
        .fold((0.0, 0.0), |(worst, bias), (k, (found, truth))| {
            let error = (found.value - truth).abs();
            let bias = if k < 9 { bias } else { f64::max(bias, error) };
            (f64::max(worst, error / found.interval), bias)
        })
}

/// The place on the table of `warnings`, mm, with the halves of the 95 % intervals; `None` on the axis.
fn place(warnings: &[Warning]) -> Option<[[f64; 3]; 2]> {
    let mut all = warnings.iter().map(|w| match w {
        Warning::Of(_, warning) => warning,
        other => other,
    });
    all.find_map(|w| match w {
        Warning::BesideAxis {
            arm_mm,
            interval_mm,
        } => Some([*arm_mm, *interval_mm]),
        _ => None,
    })
}

fn is_at(warnings: &[Warning], arm_m: [f64; 3]) {
    let [found, half] = place(warnings).expect("a place on the table");
    for i in 0..3 {
        let error = (found[i] - 1e3 * arm_m[i]).abs();
        assert!(error < 2.0 * half[i] && half[i] < 0.5, "{found:?} {half:?}");
    }
}

#[test]
fn a_board_beside_the_axis_is_calibrated_as_well_as_one_on_it_and_its_place_is_reported() {
    const UNITS: u64 = 5;
    let (mut outside, mut bias) = (0, [0.0, 0.0]);
    for seed in 1..=UNITS {
        for (k, arm) in [[0.0; 3], [4e-3, -3e-3, 40e-3]].into_iter().enumerate() {
            let fit = fitted(&recording(arm, seed));
            let (worst, off) = off(&fit);
            outside += u32::from(worst > 1.5);
            bias[k] += off / UNITS as f64;
            // The arm's force is not counted as an error of the sensor.
            assert!(fit.sensor(Sensor::Accel).unwrap().rms() < 5e-3);
            match k {
                0 => assert_eq!(place(&fit.warnings), None),
                _ => is_at(&fit.warnings, arm),
            }
        }
    }
    println!("bias off by {bias:?} m/s² on and beside the axis; {outside} beyond 1.5 intervals");
    assert!(bias[1] < 3e-3 && bias[1] < 1.2 * bias[0], "{bias:?}");
    assert!(outside <= 1, "{outside}");
}

#[test]
fn a_calibration_is_verified_at_another_place_on_the_table() {
    let fit = fitted(&recording([4e-3, -3e-3, 40e-3], 1));
    let calibration = Calibration::of(&fit, &[], "2026-01-01T00:00:00Z").unwrap();
    let elsewhere = [-30e-3, 10e-3, 5e-3];
    let found = verify(&prepared(&recording(elsewhere, 2)), &calibration).unwrap();
    let accel = found.sensors.accel.as_ref().unwrap();
    assert!(accel.rms < 1.3 * accel.noise_floor, "{accel:?}");
    assert_eq!(accel.count, 20);
    is_at(&found.warnings, elsewhere);
}

#[test]
fn a_mounting_that_is_known_to_an_angle_widens_what_it_turns_and_no_bias() {
    let fit = fitted(&recording([0.0; 3], 1));
    let triad = fit.sensor(Sensor::Accel).unwrap().estimated.triad.clone();
    let wider = triad.clone().mounted(1e-2).forward_estimates();
    let (yaw, row) = (1e-2_f64, MATRIX[0]);
    // Rotated by an angle about z, x and y of the first sensor become these.
    let turned = [
        row[0] * yaw.cos() + row[1] * yaw.sin(),
        row[1] * yaw.cos() - row[0] * yaw.sin(),
    ];
    assert!((turned[1] - row[1]).abs() < 1.1 * wider[1].sigma && wider[1].sigma < 1.1e-2);
    for (before, after) in triad.forward_estimates().iter().zip(&wider).skip(9) {
        assert_eq!(before.sigma, after.sigma);
    }
}
