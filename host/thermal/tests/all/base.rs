//! Biases over temperature from rest, added to a calibration at one temperature.

use mimu::calibration::Calibration;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_thermal::base;
use mimu_thermal::fit::{ThermalFit, fit};
use nalgebra::Vector3;

use crate::at_rest::{JOINT, at_rest};
use crate::says;
use crate::session;
use crate::simulation::{Experiment, GRAVITY, truth};

const CREATED: &str = "2026-01-01T00:00:00Z";

/// The calibration at `temp_c` that an hour on a table gives.
fn at_one_temperature(temp_c: f64) -> Calibration {
    let room = Experiment {
        corners: vec![(0.0, temp_c), (3600.0, temp_c)],
        ..Experiment::ramp(60.0, false)
    };
    let (manifest, samples) = room.record(8);
    let prepared = Prepared::of(manifest, &samples, STILL_FACTOR).unwrap();
    let found = mimu::fit::fit(prepared, mimu::fit::Options::default()).unwrap();
    Calibration::of(&found, &[], CREATED).unwrap()
}

fn fitted(recording: (mimu::Manifest, mimu::Samples)) -> ThermalFit {
    fit(vec![session(recording).unwrap()], &[], JOINT).unwrap()
}

/// Compensated readings of `sensor` with z up minus the truth, every 5 K from -5 to 60 °C.
fn errors(calibration: &Calibration, sensor: Sensor) -> Vec<(f64, Vector3<f64>)> {
    let temps = (0..14).map(|k| -5.0 + 5.0 * f64::from(k));
    let error = |t: f64| {
        let (matrix, bias) = truth(sensor as usize, t);
        let input = Vector3::z() * [0.0, GRAVITY][sensor as usize];
        let model = calibration.inverse_at(sensor, t).unwrap();
        model.apply(&(matrix * input + bias)) - input
    };
    temps.map(|t| (t, error(t))).collect()
}

fn rms(errors: &[(f64, Vector3<f64>)]) -> f64 {
    let squares = errors.iter().map(|(_, e)| e.norm_squared() / 3.0);
    (squares.sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn a_rest_ramp_gives_a_calibration_over_temperature_that_is_as_good_as_its_intervals_in_that_pose()
{
    let base = at_one_temperature(25.0);
    let found = fitted(at_rest(&Experiment::ramp(60.0, true), 3));
    let curves = base::calibration(&found, &base, CREATED).unwrap();
    let curves = Calibration::parse(&curves.to_toml(), "again").unwrap();
    assert_eq!(curves.format, "mimu-calibration/2");
    let over = curves.temperature.as_ref().unwrap();
    let lag = over.dies.gyro.lag_s.unwrap();
    assert!((lag - 60.0).abs() < 6.0, "{lag} s");
    for sensor in Sensor::BOTH {
        let (with, without) = (errors(&curves, sensor), errors(&base, sensor));
        let [with_rms, without_rms] = [rms(&with), rms(&without)];
        assert!(
            with_rms < 0.1 * without_rms,
            "{sensor}: {with_rms}, {without_rms}"
        );
        for (t, error) in with {
            let off = |n: &&mimu::calibration::TemperatureNode| (1e6 * (n.temp_c - t).abs()) as u64;
            let node = over.nodes.iter().min_by_key(off).unwrap();
            let table = node.table(sensor).unwrap();
            for axis in 0..3 {
                let by_gravity = [0.0, GRAVITY][sensor as usize] * table.sigma_C.unwrap()[axis][2];
                let sigma = table.sigma_o.unwrap()[axis].hypot(by_gravity);
                assert!(
                    error[axis].abs() < 4.0 * sigma,
                    "{sensor} {axis} at {t}: {error} {sigma}"
                );
            }
        }
    }
}

#[test]
fn a_base_that_the_curves_cannot_be_added_to_is_refused() {
    let base = at_one_temperature(25.0);
    let found = fitted(at_rest(&Experiment::ramp(60.0, true), 3));
    let refused = |base: &Calibration| {
        base::calibration(&found, base, CREATED)
            .unwrap_err()
            .to_string()
    };
    let cold = refused(&at_one_temperature(-30.0));
    says(&cold, &["it is valid at -30.0 °C, but the dies were at"]);
    let mut other = base.clone();
    other.device = "another".into();
    let other = refused(&other);
    says(&other, &["the calibration belongs to \"another\""]);
    let mut unknown = base.clone();
    unknown.recording.temp_c = None;
    let unknown = refused(&unknown);
    assert!(unknown.contains("temperature at which"), "{unknown}");
    let twice = refused(&base::calibration(&found, &base, CREATED).unwrap());
    assert!(twice.contains("curves over temperature already"), "{twice}");

    let known = fitted(Experiment::ramp(60.0, true).record(1));
    let known = base::calibration(&known, &base, CREATED)
        .unwrap_err()
        .to_string();
    assert!(known.contains("leave the base out"), "{known}");
}
