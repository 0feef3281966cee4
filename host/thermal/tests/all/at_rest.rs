//! Recordings at rest without a table: biases of the gyro, and what one pose shows of the accelerometer.

use mimu::{Manifest, RawUnit, Reference, Samples};
use mimu_thermal::fit::{Estimator, Options, fit};
use mimu_thermal::result::ThermalResult;
use nalgebra::Vector3;

use crate::session;
use crate::simulation::{Experiment, GAIN, GRAVITY, RATE_HZ, Random, WHITE, truth};

pub const JOINT: Options = Options {
    estimator: Estimator::Joint,
    lag_s: None,
    range_c: None,
};

/// The unit flat on a table while the temperature does what `experiment` says.
pub fn at_rest(experiment: &Experiment, seed: u64) -> (Manifest, Samples) {
    in_poses(experiment, seed, &[Vector3::z()])
}

/// The same with each of the directions `up` for an equal part of the time.
pub fn in_poses(experiment: &Experiment, seed: u64, up: &[Vector3<f64>]) -> (Manifest, Samples) {
    let mut random = Random(seed);
    let mut out = Samples::default();
    let temperatures = experiment.temperatures();
    let count = temperatures.len();
    for (k, [thermometer, gyro_c, accel_c]) in temperatures.into_iter().enumerate() {
        let pose = k * up.len() / count;
        out.t_s.push(k as f64 / RATE_HZ);
        out.step.push(pose as i32);
        out.temp_c.push(thermometer + 0.02 * random.normal());
        for sensor in 0..2 {
            let (matrix, bias) = truth(sensor, [gyro_c, accel_c][sensor]);
            let input = if sensor == 0 { 0.0 } else { GRAVITY };
            let raw = matrix * (up[pose] * input) + bias;
            for axis in 0..3 {
                let noise = GAIN[sensor] * WHITE[sensor] * RATE_HZ.sqrt() * random.normal();
                out.raw[3 * sensor + axis].push(raw[axis] + noise);
            }
        }
    }
    let manifest = Manifest::new("mti-g", RATE_HZ, GRAVITY, RawUnit::Volt, Reference::Gravity);
    (manifest, out)
}

#[test]
fn there_and_back_shows_the_biases_of_the_gyro_and_names_what_is_inseparable() {
    let recording = at_rest(&Experiment::ramp(60.0, true), 3);
    let found = fit(vec![session(recording).unwrap()], &[], JOINT).unwrap();
    let result = ThermalResult::of(&found);
    assert_eq!(result.verdict, "fitted");
    let lag = result.sensors.gyro.as_ref().unwrap().lag_s.unwrap();
    assert!(lag.lower < 66.0 && lag.upper > 54.0, "{lag:?}");
    let accel = result.sensors.accel.as_ref().unwrap();
    assert!(
        accel
            .inseparable
            .unwrap()
            .contains("scale factor times gravity")
    );
    assert!(result.curve("gyro_scale_x").is_none());
    for sensor in [result.sensors.gyro.as_ref().unwrap(), accel] {
        assert_eq!(sensor.unit, "V");
        let ratio = sensor.held_out_rms.unwrap() / sensor.noise_floor.unwrap();
        assert!((0.9..1.15).contains(&ratio), "{ratio} of the noise");
        assert!(sensor.bins.len() >= 6, "{:?}", sensor.bins);
        let hysteresis = sensor.hysteresis.as_ref().unwrap();
        // Three axes of each sensor: an interval of 99.9 %.
        assert!(
            hysteresis
                .iter()
                .all(|h| h.value.abs() < 3.3 / 1.96 * h.half_width),
            "{hysteresis:?}"
        );
    }
    for (axis, name) in ["gyro_bias_x", "gyro_bias_y", "gyro_bias_z"]
        .iter()
        .enumerate()
    {
        let curve = result.curve(name).unwrap();
        let mut outside = 0;
        for (k, t) in curve.temp_c.iter().enumerate() {
            let true_bias = truth(0, *t).1[axis];
            outside += usize::from(!(curve.lower[k]..=curve.upper[k]).contains(&true_bias));
            let half = curve.upper[k] - curve.value[k];
            assert!(
                (true_bias - curve.value[k]).abs() < 3.0 * half,
                "{name} {t}"
            );
        }
        assert!(outside <= curve.temp_c.len() / 2, "{name}: {outside}");
    }
    let refused = found
        .calibration("2026-01-01T00:00:00Z")
        .unwrap_err()
        .to_string();
    assert!(refused.contains("only biases"), "{refused}");
}

#[test]
fn a_cold_start_goes_one_way() {
    let cold = Experiment {
        corners: vec![(0.0, -10.0), (1800.0, 40.0)],
        ..Experiment::ramp(60.0, false)
    };
    let found = fit(vec![session(at_rest(&cold, 4)).unwrap()], &[], JOINT).unwrap();
    let result = ThermalResult::of(&found);
    assert_eq!(result.verdict, "one-way");
    assert!(
        result
            .sensors
            .gyro
            .unwrap()
            .lag_reason
            .unwrap()
            .contains("one way")
    );
}

/// A chamber of the PAN cubesat, cooling only; see the data set's own description. The columns of the temperature are counts.
#[test]
fn a_cubesats_gyro_cooled_one_way_has_straight_lines() {
    let beside = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let all = std::env::var_os("MIMU_DATA").map_or(beside, Into::into);
    let Ok(text) = std::fs::read_to_string(all.join("pan_tvac_gyro/TVCtest3_7_20.csv")) else {
        println!("skipped: no recordings (set MIMU_DATA)");
        return;
    };
    let mut samples = Samples::default();
    for line in text.lines().skip(1) {
        let cells: Vec<f64> = line
            .split(',')
            .filter_map(|c| c.trim().parse().ok())
            .collect();
        let &[ms, _, _, _, x, y, z, counts] = cells.as_slice() else {
            continue;
        };
        let t_s = 1e-3 * ms;
        if samples.t_s.last().is_some_and(|last| t_s <= *last) {
            continue;
        }
        let gap = samples.t_s.last().is_none_or(|last| t_s - last > 10.0);
        let burst = samples.step.last().map_or(0, |s| s + i32::from(gap));
        samples.t_s.push(t_s);
        samples.step.push(burst);
        // Signed 16-bit counts, 172 of them a kelvin by the owner's fit; the driver's rates are twice the true ones.
        let signed = if counts > 32767.0 {
            counts - 65536.0
        } else {
            counts
        };
        samples.temp_c.push(25.0 + signed / 172.0);
        for (k, rate) in [x, y, z].into_iter().enumerate() {
            samples.raw[k].push(0.5 * rate);
        }
    }
    let manifest = Manifest::new("pan", 50.0, 9.80665, RawUnit::Si, Reference::Gravity);
    let found = fit(vec![session((manifest, samples)).unwrap()], &[], JOINT).unwrap();
    let result = ThermalResult::of(&found);
    println!(
        "{} to {} °C: {:?}",
        result.range_c[0], result.range_c[1], result.warnings
    );
    assert_eq!(result.verdict, "one-way");
    assert!(
        result
            .warnings
            .iter()
            .any(|w| w.contains("curvature needs 20 K"))
    );
    for name in ["gyro_bias_x", "gyro_bias_y", "gyro_bias_z"] {
        let curve = result.curve(name).unwrap();
        let v = &curve.value;
        let last = v.len() - 1;
        let bend = v[last / 2] - 0.5 * (v[0] + v[last]);
        assert!(
            bend.abs() < 1e-9 + 1e-6 * (v[last] - v[0]).abs(),
            "{name}: {bend}"
        );
    }
}
