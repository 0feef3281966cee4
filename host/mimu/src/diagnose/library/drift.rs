//! Biases that move with time.

use super::{each, per_axis};
use crate::diagnose::effect::{Coefficient, Effect, Form, FormKind, Moment};
use crate::quantity::Sensor;

const DPS: f64 = std::f64::consts::PI / 180.0;
const MG: f64 = 9.80665e-3;
const HOUR_S: f64 = 3600.0;

const GYRO_DRIFT: [Coefficient; 3] = each("rad/s^2");
const ACCEL_DRIFT: [Coefficient; 3] = each("m/s^3");
const GYRO_WARM_UP: [Coefficient; 3] = each("rad/s");
const ACCEL_WARM_UP: [Coefficient; 3] = each("m/s^2");

/// A die of some tens of milliwatts and its package settle within minutes.
const SETTLING: Option<Form> = Some(Form {
    name: "time_constant_s",
    from: 20.0,
    to: 1200.0,
    kind: FormKind::Free,
});

fn linear(at: &Moment, _: f64, out: &mut [f64]) {
    per_axis(out, |_| at.on_s);
}

fn settling(at: &Moment, time_constant_s: f64, out: &mut [f64]) {
    let left = (-at.on_s / time_constant_s).exp();
    per_axis(out, |_| left);
}

const DRIFTS: &str = "the same inputs again half an hour later";
const SETTLES: &str = "a cold start: switch on and record at once, for half an hour";

pub(super) const EFFECTS: [Effect; 4] = [
    Effect {
        id: "gyro_bias_drift",
        sensor: Sensor::Gyro,
        about: "the bias moves linearly in time",
        coefficients: &GYRO_DRIFT,
        typical: &[0.3 * DPS / HOUR_S; 3],
        form: None,
        regressors: linear,
        needs: DRIFTS,
    },
    Effect {
        id: "accel_bias_drift",
        sensor: Sensor::Accel,
        about: "the bias moves linearly in time",
        coefficients: &ACCEL_DRIFT,
        typical: &[3.0 * MG / HOUR_S; 3],
        form: None,
        regressors: linear,
        needs: DRIFTS,
    },
    Effect {
        id: "gyro_warm_up",
        sensor: Sensor::Gyro,
        about: "the bias settles exponentially since power-on",
        coefficients: &GYRO_WARM_UP,
        typical: &[0.5 * DPS; 3],
        form: SETTLING,
        regressors: settling,
        needs: SETTLES,
    },
    Effect {
        id: "accel_warm_up",
        sensor: Sensor::Accel,
        about: "the bias settles exponentially since power-on",
        coefficients: &ACCEL_WARM_UP,
        typical: &[5.0 * MG; 3],
        form: SETTLING,
        regressors: settling,
        needs: SETTLES,
    },
];
