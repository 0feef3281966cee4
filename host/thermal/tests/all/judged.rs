//! The whole path of `mimu thermal fit`: verdicts, held-out errors, and the calibration file.

use mimu::calibration::Calibration;
use mimu::quantity::Sensor;
use mimu_thermal::fit::{FitVerdict, Options, ThermalFit, fit};
use mimu_thermal::judge::rms;
use mimu_thermal::result::ThermalResult;
use nalgebra::Vector3;

use crate::classic::{Classic, estimate};
use crate::session;
use crate::simulation::{Experiment, GAIN, truth};

const JOINT: Options = Options {
    lag_s: None,
    range_c: None,
};

fn fitted(experiment: &Experiment, seed: u64, options: Options) -> ThermalFit {
    fit(
        vec![session(experiment.record(seed)).unwrap()],
        &[],
        options,
    )
    .unwrap()
}

/// Error of the input that `calibration` gives for the unit's reading at `temp_c` of the die.
fn error_at(calibration: &Calibration, sensor: Sensor, temp_c: f64, input: &Vector3<f64>) -> f64 {
    let (matrix, bias) = truth(sensor as usize, temp_c);
    let inverse = calibration.inverse_at(sensor, temp_c).unwrap();
    (inverse.apply(&(matrix * input + bias)) - input).norm()
}

#[test]
fn a_whole_cycle_is_fitted_and_its_file_compensates_the_unit_at_all_temperatures() {
    let whole = fitted(&Experiment::ramp(60.0, true), 11, JOINT);
    let result = ThermalResult::of(&whole);
    assert_eq!(result.verdict, FitVerdict::Fitted);
    for sensor in [&result.sensors.gyro, &result.sensors.accel] {
        let sensor = sensor.as_ref().unwrap();
        let (held_out, floor) = (sensor.held_out_rms.unwrap(), sensor.noise_floor.unwrap());
        assert!(
            (0.9..1.25).contains(&(held_out / floor)),
            "{held_out} {floor}"
        );
        let lag = sensor.lag_s.unwrap();
        assert!(lag.lower < 63.0 && lag.upper > 57.0, "{lag:?}");
        for h in sensor.hysteresis.as_ref().unwrap() {
            assert!(h.value.abs() < 2.0 * h.half_width, "{h:?}");
        }
    }
    assert_eq!(result.curves.len(), 48);
    let names = [
        "gyro_C_xx",
        "accel_o_z",
        "gyro_scale_y",
        "accel_bias_x",
        "accel_non_orthogonality_zx",
    ];
    assert!(names.iter().all(|n| result.curve(n).is_some()));

    let text = whole.calibration("2026-01-01T00:00:00Z").unwrap().to_toml();
    assert!(text.contains("format = \"mimu-calibration/2\""), "{text}");
    let file = Calibration::parse(&text, "cal.toml").unwrap();
    let temperature = file.temperature.as_ref().unwrap();
    assert!(temperature.nodes.len() <= 16);
    assert!((temperature.dies.gyro.lag_s.unwrap() - 60.0).abs() < 5.0);
    for temp_c in [-4.0, 7.3, 31.0, 55.5, 66.0] {
        // Bias and 10 deg/s with 0.04 % of scale factor; 1 g with 40 µg and 40 ppm.
        let rate = Vector3::new(0.1, -0.1, 0.1);
        let gyro = error_at(&file, Sensor::Gyro, temp_c, &rate);
        assert!(gyro < 4e-4, "{temp_c}: {gyro}");
        let accel = error_at(&file, Sensor::Accel, temp_c, &Vector3::new(5.0, -5.0, 5.0));
        assert!(accel < 1.5e-3, "{temp_c}: {accel}");
    }
}

#[test]
fn half_a_cycle_is_one_way_and_has_no_lag() {
    let half = fitted(&Experiment::ramp(60.0, false), 13, JOINT);
    let result = ThermalResult::of(&half);
    assert_eq!(result.verdict, FitVerdict::OneWay);
    let gyro = result.sensors.gyro.unwrap();
    assert!(gyro.lag_s.is_none() && gyro.lag_reason.unwrap().contains("one way"));
    let file = half.calibration("2026-01-01T00:00:00Z").unwrap();
    assert!(file.temperature.unwrap().lags_s().is_none());
    // Without a lag the curves describe the ramp by its thermometer; the intervals include how far the dies may differ from it.
    let mut normal = 0.0;
    for sensor in [0, 1] {
        let curves = half.joint.curves[Sensor::BOTH[sensor]].as_ref().unwrap();
        let covariance = curves.covariance(40.0);
        let (_, bias) = truth(sensor, 40.0);
        let [model, _] = curves.forward(40.0);
        for axis in 0..3 {
            let error = model.bias[axis] - bias[axis];
            normal += error * error / covariance[(9 + axis, 9 + axis)] / 6.0;
        }
    }
    assert!(normal < 4.0, "{normal}");
    for sensor in Sensor::BOTH {
        let judged = half.judged[sensor].as_ref().unwrap();
        let [own, floor] = rms(&judged.errors);
        assert!(own < 1.5 * floor, "{sensor}: {own} {floor}");
    }
    // A lag that is known by other means is applied and written to the file.
    let known = Options {
        lag_s: Some(60.0),
        ..JOINT
    };
    let known = fitted(&Experiment::ramp(60.0, false), 13, known);
    let file = known.calibration("2026-01-01T00:00:00Z").unwrap();
    let temperature = file.temperature.unwrap();
    for (_, dies) in temperature.dies {
        assert_eq!(dies.lag_s, Some(60.0));
        assert_eq!(dies.interval_lag_s, None);
    }
}

#[test]
fn a_sweep_at_another_rate_judges_and_shows_the_bias_of_its_session() {
    let slow = Experiment {
        corners: vec![(0.0, 70.0), (4800.0, -10.0)],
        offset: [0.001, 0.02],
        ..Experiment::ramp(60.0, true)
    };
    let sessions = vec![session(Experiment::ramp(60.0, true).record(14)).unwrap()];
    let verify = [session(slow.record(15)).unwrap()];
    let judged = fit(sessions, &verify, JOINT).unwrap();
    for (sensor, offset) in [(0, 0.001), (1, 0.02)] {
        let found = judged.judged[Sensor::BOTH[sensor]].as_ref().unwrap();
        let [raw, floor] = rms(found.held_out.as_ref().unwrap());
        assert!((raw / offset - 1.0).abs() < 0.15, "{sensor}: {raw}");
        let without = found.without_session_bias.unwrap();
        assert!(
            (0.9..1.3).contains(&(without / floor)),
            "{sensor}: {without} {floor}"
        );
    }
}

#[test]
fn a_soak_finds_all_parameters_and_as_printed_only_scale_factors_and_biases() {
    // Plateaus of half an hour, ten kelvins apart.
    let corners = (0..9).flat_map(|k| {
        let (t, temp) = (2400.0 * f64::from(k), -10.0 + 10.0 * f64::from(k));
        [(t, temp), (t + 2000.0, temp)]
    });
    let soak = Experiment {
        corners: corners.collect(),
        ..Experiment::ramp(60.0, true)
    };
    let full = estimate(&[session(soak.record(17)).unwrap()], Classic::Soak).unwrap();
    assert!(!full.one_way);
    let curves = full.curves.accel.as_ref().unwrap();
    for t in [0.0, 30.0, 60.0] {
        let [model, _] = curves.forward(t);
        let (matrix, bias) = truth(1, t);
        assert!((model.matrix - matrix).norm() < 2e-4 * GAIN[1], "{t}");
        assert!((model.bias - bias).norm() < 2e-3 * GAIN[1], "{t}");
    }
    let joint = fitted(&soak, 17, JOINT);
    assert!(
        (joint.joint.lag(Sensor::Gyro).unwrap().value - 60.0).abs() < 15.0,
        "{:?}",
        joint.joint.lag(Sensor::Gyro)
    );
}
