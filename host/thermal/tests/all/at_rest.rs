//! Recordings at rest without a table: biases of the gyro, and the information that one pose gives about the accelerometer.

use mimu::calibration::thermal_biases::ThermalBiases;
use mimu::quantity::Sensor;
use mimu::{Manifest, RawUnit, Reference, Samples};
use mimu_thermal::fit::{FitVerdict, Options, ThermalFit, fit};
use mimu_thermal::result::ThermalResult;
use mimu_thermal::warning::Warning;
use nalgebra::Vector3;

use crate::says;
use crate::session;
use crate::simulation::{Experiment, GAIN, GRAVITY, RATE_HZ, Random, WHITE, truth};

pub const JOINT: Options = Options {
    lag_s: None,
    range_c: None,
};

/// The unit flat on a table while the temperature follows `experiment`.
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
    assert_eq!(result.verdict, FitVerdict::Fitted);
    let lag = result.sensors.gyro.as_ref().unwrap().lag_s.unwrap();
    assert!(lag.lower < 66.0 && lag.upper > 54.0, "{lag:?}");
    let accel = result.sensors.accel.as_ref().unwrap();
    says(accel.inseparable.unwrap(), &["scale factor times gravity"]);
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
    a_file_keeps_the_biases(&found);
}

/// The accelerometer's readings include gravity along z, times its scale factor at that temperature.
fn a_file_keeps_the_biases(found: &ThermalFit) {
    assert!(found.is_biases_only());
    let written = found.biases("2026-01-01T00:00:00Z").unwrap();
    let biases = ThermalBiases::parse(&written.to_toml(), "again").unwrap();
    assert_eq!(biases, written);
    let lag = biases.dies.gyro.lag_s.unwrap();
    assert!((lag - 60.0).abs() < 6.0, "{lag} s");
    let curves = biases.curves().unwrap();
    let result = ThermalResult::of(found);
    for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
        let hysteresis = biases.dies[sensor].hysteresis.unwrap();
        assert!(hysteresis[0].iter().all(|h| *h > 0.0), "{hysteresis:?}");
        for t in [-8.0, 11.0, 40.0, 66.0] {
            let (matrix, bias) = truth(k, t);
            let truth = bias + matrix * Vector3::z() * [0.0, GRAVITY][k];
            let off = curves.reading(sensor, t) - truth;
            // White noise of a session of 80 minutes at an end of a cubic.
            let sigma = GAIN[k] * WHITE[k] / f64::sqrt(4800.0) * 4.0;
            assert!(off.amax() < 3.5 * sigma, "{sensor} {t} °C: {off}, {sigma}");
        }
        // Pieces between the nodes keep the curves that the fit reports.
        for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
            let all = result.curves.iter().filter(|c| c.sensor == sensor);
            let curve = all.rev().find(|c| c.of.axis() == *letter).unwrap();
            for (k, t) in curve.temp_c.iter().enumerate() {
                let half = curve.upper[k] - curve.value[k];
                let off = curves.reading(sensor, *t)[axis] - curve.value[k];
                assert!(off.abs() < 0.05 * half, "{} {t} °C: {off}", curve.name);
            }
        }
    }
}

/// A unit that warms up by 15 K, with a bias of the accelerometer's z that bends by `bend` m/s² between the ends and the middle.
fn warmed_by_little(seed: u64, bend: f64) -> (Manifest, Samples) {
    let [from, to] = [12.0, 27.0];
    let little = Experiment {
        corners: vec![(0.0, from), (900.0, to)],
        ..Experiment::ramp(0.0, false)
    };
    let (manifest, mut samples) = at_rest(&little, seed);
    for k in 0..samples.len() {
        let x = 2.0 * samples.t_s[k] / 900.0 - 1.0;
        samples.raw[5][k] += GAIN[1] * bend * (1.0 - x * x);
    }
    (manifest, samples)
}

#[test]
fn a_small_span_has_curves_only_if_the_data_show_that_lines_do_not_do() {
    let of = |bend| {
        let recording = session(warmed_by_little(8, bend)).unwrap();
        ThermalResult::of(&fit(vec![recording], &[], JOINT).unwrap())
    };
    let lines = |result: &ThermalResult| {
        let mut warnings = result.warnings.iter();
        warnings.any(|w| matches!(w, Warning::StraightLines { .. }))
    };
    let (straight, bent) = (of(0.0), of(0.2));
    assert!(lines(&straight) && !lines(&bent), "{:?}", bent.warnings);
    for result in [&straight, &bent] {
        assert_eq!(result.verdict, FitVerdict::OneWay);
        let accel = result.sensors.accel.as_ref().unwrap();
        let noise = accel.noise_floor.unwrap();
        let [ratio, held_out] = [accel.rms, accel.held_out_rms].map(|rms| rms.unwrap() / noise);
        assert!((0.8..1.3).contains(&ratio), "{ratio} of the noise");
        // A bent curve is extrapolated to the end that is held out.
        assert!(held_out < 3.0, "{held_out} of the noise");
    }
}

/// A unit in a freezer for half an hour, whose gyro x jumps by 100 and back by 60 times the noise of a row of 2.5 s, as in a real
/// recording. `nudge`: change of the accelerometer at each jump, as a share of gravity.
fn in_freezer(seed: u64, nudge: f64) -> (Manifest, Samples) {
    let freezer = Experiment {
        corners: vec![
            (0.0, 40.0),
            (300.0, 16.0),
            (600.0, 9.0),
            (1000.0, 5.0),
            (1900.0, 3.6),
        ],
        ..Experiment::ramp(0.0, false)
    };
    let (manifest, mut samples) = at_rest(&freezer, seed);
    for k in 0..samples.len() {
        let [first, second] = [430.0, 523.0].map(|at| f64::from(u8::from(samples.t_s[k] >= at)));
        samples.raw[0][k] += JUMPS[0] * first + JUMPS[1] * second;
        samples.raw[4][k] += GAIN[1] * GRAVITY * nudge * (first - 0.2 * second);
        // A nudge separates dwells, as the search for stillness would.
        if nudge > 0.0 {
            samples.step[k] = (first + second) as i32;
        }
    }
    (manifest, samples)
}

/// Raw.
const JUMPS: [f64; 2] = [
    -100.0 * GAIN[0] * WHITE[0] / 1.58,
    60.0 * GAIN[0] * WHITE[0] / 1.58,
];

#[test]
fn jumps_of_a_gyros_bias_at_rest_are_named_and_their_samples_kept_in_intervals_that_hold_them() {
    for nudge in [0.0, 0.03] {
        for seed in 1..=3 {
            let recorded = session(in_freezer(seed, nudge)).unwrap();
            let [first, second] = recorded.bias_jumps[..] else {
                panic!("{nudge}, {seed}: {:?}", recorded.bias_jumps);
            };
            assert!((first.at_s - 430.0).abs() < 5.0 && (second.at_s - 523.0).abs() < 5.0);
            for (jump, size) in [first, second].iter().zip(JUMPS) {
                assert!((jump.change.x / size - 1.0).abs() < 0.1, "{jump:?}, {size}");
            }
            // For the gyro a nudge is not another pose.
            assert!(recorded.moved_s[0].is_empty());
            assert_eq!(recorded.moved_s[1].is_empty(), nudge == 0.0);
            let found = fit(vec![recorded], &[], JOINT).unwrap();
            let result = ThermalResult::of(&found);
            let said = |w: &Warning| {
                let w = w.to_string();
                w.contains("the gyro's bias jumps 2 times, by ") && w.contains(" V at 430 s")
            };
            assert!(result.warnings.iter().any(said), "{:?}", result.warnings);
            let curve = result.curve("gyro_bias_x").unwrap();
            let later = truth(0, curve.temp_c[0]).1[0] + JUMPS[0] + JUMPS[1];
            assert!(
                (curve.lower[0]..=curve.upper[0]).contains(&later),
                "{nudge}, {seed}: {later} in {} to {}",
                curve.lower[0],
                curve.upper[0]
            );
        }
    }
}

#[test]
fn no_jump_is_seen_in_a_bias_that_warms_up_or_wanders() {
    for seed in 1..=20 {
        let (manifest, mut samples) = at_rest(&Experiment::ramp(60.0, true), seed);
        let (mut random, mut walk) = (Random(1000 + seed), 0.0);
        for k in 0..samples.len() {
            walk += 0.3 * GAIN[0] * WHITE[0] * random.normal() / RATE_HZ;
            let power_on = 400.0 * GAIN[0] * WHITE[0] * (-samples.t_s[k] / 60.0).exp();
            samples.raw[1][k] += walk + power_on;
        }
        let recorded = session((manifest, samples)).unwrap();
        assert_eq!(recorded.bias_jumps, [], "{seed}");
    }
}

/// A chamber of the PAN cubesat, cooling only; see the data set's own description. The columns of the temperature are counts.
#[test]
fn a_cubesats_gyro_cooled_one_way_has_straight_lines() {
    let beside = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let all = std::env::var_os("MIMU_DATA").map_or(beside, Into::into);
    let Ok(text) = std::fs::read_to_string(all.join("pan_tvac_gyro/TVCtest3_7_20.csv")) else {
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
    assert_eq!(result.verdict, FitVerdict::OneWay);
    assert!(
        result
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::StraightLines { .. }))
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
