//! Biases that move with time.

use super::effect::{DPS, Effect, MG, NonlinearParameter, Role, each};
use super::quantity::Quantity::{SessionTime, Time};
use super::regressor::Regressor;
use crate::quantity::Sensor;

const HOUR_S: f64 = 3600.0;

/// A die of some tens of milliwatts and its package settle within minutes.
///
/// The beginning of a settling that takes far longer than the recording is a straight line.
const fn settling(line: &'static str) -> Option<NonlinearParameter> {
    Some(NonlinearParameter {
        name: "time_constant_s",
        from: 20.0,
        to: 1200.0,
        role: Role::Scale,
        limit: Some(line),
    })
}

/// Time counts from the middle of the session, and no calibration stores the drift, because nobody knows how far a line continues. With a drift of 3
/// deg/s/h counted from power-on, a session an hour away had 5.5 times the error that it had without.
const LINEAR: Regressor = Regressor::linear(SessionTime);
const SETTLED: Regressor = Regressor::Decay(Time);

const DRIFTS: &str = "the same inputs again half an hour later";
const SETTLES: &str = "a cold start: switch on and record at once, for half an hour";

pub(super) const EFFECTS: &[Effect] = &[
    Effect {
        id: "gyro_bias_drift",
        sensor: Sensor::Gyro,
        about: "the bias drifts linearly in time",
        coefficients: &each(LINEAR, 0.3 * DPS / HOUR_S),
        parameter: None,
        size: "0.3 deg/s/h (assumed)",
        needs: DRIFTS,
        taken_for: "random walk, warm-up",
    },
    Effect {
        id: "accel_bias_drift",
        sensor: Sensor::Accel,
        about: "the bias drifts linearly in time",
        coefficients: &each(LINEAR, 3.0 * MG / HOUR_S),
        parameter: None,
        size: "3 mg/h (assumed)",
        needs: DRIFTS,
        taken_for: "random walk, warm-up",
    },
    Effect {
        id: "gyro_warm_up",
        sensor: Sensor::Gyro,
        about: "the bias settles exponentially since power-on",
        coefficients: &each(SETTLED, 0.5 * DPS),
        parameter: settling("gyro_bias_drift"),
        size: "0.5 deg/s (assumed)",
        needs: SETTLES,
        taken_for: "drift, thermal bias",
    },
    Effect {
        id: "accel_warm_up",
        sensor: Sensor::Accel,
        about: "the bias settles exponentially since power-on",
        coefficients: &each(SETTLED, 5.0 * MG),
        parameter: settling("accel_bias_drift"),
        size: "5 mg (assumed)",
        needs: SETTLES,
        taken_for: "drift, thermal bias",
    },
];
