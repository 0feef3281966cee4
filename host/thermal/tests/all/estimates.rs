//! Estimates agree with the truth within their uncertainty.

use mimu::quantity::Sensor;
use mimu_allan::variance::AllanModel;
use mimu_thermal::joint::{Choice, Joint, estimate};

use crate::session;
use crate::simulation::{Experiment, GAIN, bounds, truth};

const TEMPS: [f64; 8] = [-4.0, 6.0, 16.0, 26.0, 36.0, 46.0, 56.0, 66.0];

/// Error and standard deviation of the twelve numbers of `sensor` at `temp_c`, over the gain.
fn errors(joint: &Joint, sensor: usize, temp_c: f64) -> [(f64, f64); 12] {
    let curves = joint.curves[Sensor::BOTH[sensor]].as_ref().unwrap();
    let (matrix, bias) = truth(sensor, temp_c);
    let [found, _] = curves.forward(temp_c);
    let error =
        mimu::triad::vector(&found.matrix, &found.bias) - mimu::triad::vector(&matrix, &bias);
    let covariance = curves.covariance(temp_c);
    std::array::from_fn(|k| {
        (
            error[k] / GAIN[sensor],
            covariance[(k, k)].sqrt() / GAIN[sensor],
        )
    })
}

/// Gyro and accelerometer are different packages in different places: the data decide whether one lag serves both.
#[test]
fn dies_that_lag_by_different_times_each_have_their_own_lag_and_dies_alike_have_one() {
    for (lags_s, seed) in [([60.0, 25.0], 4), ([20.0, 50.0], 5), ([40.0, 40.0], 6)] {
        let experiment = Experiment {
            accel_lag_s: Some(lags_s[1]),
            ..Experiment::ramp(lags_s[0], true)
        };
        let joint = estimate(&[session(experiment.record(seed)).unwrap()], Choice::JOINT).unwrap();
        assert_eq!(joint.apart.is_some(), lags_s[0] != lags_s[1], "{lags_s:?}");
        for (sensor, lag_s) in Sensor::BOTH.into_iter().zip(lags_s) {
            let lag = joint.lag(sensor).expect("a cycle determines the lag");
            let sigma = (lag.upper - lag.lower) / 3.92;
            assert!((lag.value - lag_s).abs() < 4.0 * sigma, "{sensor}: {lag:?}");
            let mut normal = 0.0;
            for temp_c in TEMPS {
                for (error, sigma) in errors(&joint, sensor as usize, temp_c) {
                    normal += (error / sigma).powi(2) / (12 * TEMPS.len()) as f64;
                }
            }
            assert!(normal < 3.0, "{lags_s:?} {sensor}: {normal}");
        }
    }
}

#[test]
fn curves_and_lag_of_a_whole_cycle_are_those_of_the_unit_as_nearly_as_they_say() {
    for (lag_s, seed) in [(60.0, 1), (-30.0, 2), (0.0, 3)] {
        let experiment = Experiment::ramp(lag_s, true);
        let joint = estimate(&[session(experiment.record(seed)).unwrap()], Choice::JOINT).unwrap();
        let lag = joint.lag(Sensor::Gyro).expect("a cycle determines the lag");
        let sigma = (lag.upper - lag.lower) / 3.92;
        assert!(
            (lag.value - lag_s).abs() < 4.0 * sigma && sigma < 4.0,
            "{lag:?}"
        );
        let bounds = bounds(&experiment, &TEMPS);
        for sensor in 0..2 {
            let (mut squared, mut bound, mut normal) = (0.0, 0.0, 0.0);
            for (t, temp_c) in TEMPS.iter().enumerate() {
                for (k, (error, sigma)) in errors(&joint, sensor, *temp_c).into_iter().enumerate() {
                    assert!(
                        error.abs() < 5.0 * sigma,
                        "{sensor} {k} {temp_c}: {error} {sigma}"
                    );
                    squared += (error / bounds[sensor][t][k]).powi(2);
                    bound += 1.0;
                    normal += (error / sigma).powi(2);
                }
            }
            // 96 numbers, some twenty of them independent: six sigmas of chi-square on either side.
            let (ratio, scatter) = ((squared / bound).sqrt(), (normal / bound).sqrt());
            assert!(
                (0.5..1.6).contains(&ratio),
                "{sensor}: {ratio} times the bound"
            );
            assert!((0.5..1.5).contains(&scatter), "{sensor}: {scatter} sigmas");
        }
    }
}

#[test]
fn a_further_session_has_its_own_biases_and_the_same_curves() {
    let first = Experiment::ramp(60.0, true);
    let second = Experiment {
        offset: [0.002, 0.03],
        ..first.clone()
    };
    let sessions = [
        session(first.record(5)).unwrap(),
        session(second.record(6)).unwrap(),
    ];
    let joint = estimate(&sessions, Choice::JOINT).unwrap();
    for (sensor, tolerance) in [(0, 1e-4), (1, 4e-4)] {
        let curves = joint.curves[Sensor::BOTH[sensor]].as_ref().unwrap();
        let offset = curves.session_offset(1) / GAIN[sensor];
        for axis in 0..3 {
            let error = offset[axis] - second.offset[sensor];
            assert!(error.abs() < tolerance, "{sensor} {axis}: {error}");
        }
        for (k, (error, sigma)) in errors(&joint, sensor, 31.0).into_iter().enumerate() {
            assert!(error.abs() < 5.0 * sigma, "{sensor} {k}: {error} {sigma}");
        }
    }
}

#[test]
fn biases_that_wander_widen_the_intervals_of_the_biases() {
    let still = Experiment::ramp(60.0, true);
    let walk = Experiment {
        walk: 0.05,
        ..still.clone()
    };
    let [still, walk] =
        [still, walk].map(|e| estimate(&[session(e.record(7)).unwrap()], Choice::JOINT).unwrap());
    for sensor in 0..2 {
        let wander = walk.noise[Sensor::BOTH[sensor]].unwrap();
        assert!(
            wander.iter().filter(|n| n.wander > 0.0).count() >= 2,
            "{wander:?}"
        );
        let [narrow, wide] = [&still, &walk].map(|j| errors(j, sensor, 31.0)[10].1);
        assert!(wide > 1.5 * narrow, "{sensor}: {wide} {narrow}");
    }
}

/// Wander slower than the recording shifts all of it, and only a longer record at rest shows how much.
#[test]
fn the_noise_at_rest_widens_the_intervals_of_the_biases_by_what_it_says_and_nothing_else() {
    let recorded = session(Experiment::ramp(60.0, true).record(9)).unwrap();
    let mut noise_at_rest = recorded.clone();
    // Bias instabilities B, SI: 60 deg/h, and 200 µg.
    let instability = [60.0 / 3600.0_f64.to_degrees(), 2e-4 * 9.80665];
    noise_at_rest.noise_at_rest = std::array::from_fn(|channel| {
        let b = instability[channel / 3] * GAIN[channel / 3];
        Some(AllanModel {
            white: 0.0,
            flicker: 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI * b * b,
            walk: 0.0,
        })
    });
    let [without, with] = [recorded, noise_at_rest].map(|s| estimate(&[s], Choice::JOINT).unwrap());
    for sensor in 0..2 {
        let [narrow, wide] = [&without, &with].map(|j| errors(j, sensor, 31.0));
        for axis in 9..12 {
            // Flicker noise from 40 to 10 000 s and longer has about this standard deviation, and no fit to 80 minutes of it averages it away.
            let sigma = wide[axis].1;
            let bounds = [0.7 * instability[sensor], 3.0 * instability[sensor]];
            assert!((bounds[0]..bounds[1]).contains(&sigma), "{sensor}: {sigma}");
            assert!(sigma > 3.0 * narrow[axis].1);
        }
        // Rates and turned poses determine these within minutes.
        for k in [0, 4, 8] {
            let ratio = wide[k].1 / narrow[k].1;
            assert!((0.8..2.0).contains(&ratio), "{sensor} {k}: {ratio}");
        }
    }
}
