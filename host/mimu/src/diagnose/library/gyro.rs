//! Gyro errors that depend on the motion.

use super::{all_axes, each, matrix, per_axis};
use crate::diagnose::effect::{Coefficient, Effect, Scope};
use crate::quantity::Sensor;

/// 1 deg/s, rad/s.
const DPS: f64 = std::f64::consts::PI / 180.0;
const G: f64 = 9.80665;
/// Full scale of an ADXRS300, rad/s: where its nonlinearity is stated.
const FULL: f64 = 300.0 * DPS;

const G_SENSITIVITY: [Coefficient; 9] = matrix("rad/s/(m/s^2)");
const QUADRATIC: [Coefficient; 3] = each("1/(rad/s)");
const CUBIC: [Coefficient; 3] = each("1/(rad/s)^2");
const ASYMMETRY: [Coefficient; 3] = each("1");

const EARTH: [Coefficient; 1] = [Coefficient {
    scope: Scope::Place,
    ..all_axes("vertical", "rad/s")
}];

pub(super) const EFFECTS: [Effect; 5] = [
    // The vertical part alone: about the level one nothing is known where nothing says which way is north.
    Effect {
        id: "earth_rate",
        sensor: Sensor::Gyro,
        about: "the Earth turns, and a gyro at rest reads it: its rate times the sine of the latitude, about the vertical",
        coefficients: &EARTH,
        // 7.292e-5 rad/s at 45 degrees.
        typical: &[5.2e-5],
        form: None,
        regressors: |at, _, out| {
            let size = at.force.norm();
            per_axis(out, |i| at.force[i] / size);
        },
        needs: "rest with each axis up and down, long enough to see 0.003 deg/s",
    },
    Effect {
        id: "gyro_g_sensitivity",
        sensor: Sensor::Gyro,
        about: "the proof mass sags under force, and the sag is read as rate",
        coefficients: &G_SENSITIVITY,
        // ADXRS300: 0.2 deg/s/g.
        typical: &[0.2 * DPS / G; 9],
        form: None,
        regressors: |at, _, out| per_axis(out, |k| at.force[k % 3]),
        needs: "rest with each axis up and down",
    },
    Effect {
        id: "gyro_scale_quadratic",
        sensor: Sensor::Gyro,
        about: "the response bends: error by the square of the rate along the axis",
        coefficients: &QUADRATIC,
        // ADXRS300: 0.1 % of full scale, best straight line.
        typical: &[1e-3 / FULL; 3],
        form: None,
        regressors: |at, _, out| per_axis(out, |i| at.sensed[i].powi(2)),
        needs: "three rates and more about each axis, both directions",
    },
    Effect {
        id: "gyro_scale_cubic",
        sensor: Sensor::Gyro,
        about: "the response saturates: error by the cube of the rate along the axis",
        coefficients: &CUBIC,
        typical: &[1e-3 / (FULL * FULL); 3],
        form: None,
        regressors: |at, _, out| per_axis(out, |i| at.sensed[i].powi(3)),
        needs: "two sizes of rate and more about each axis, both directions",
    },
    Effect {
        id: "gyro_scale_asymmetry",
        sensor: Sensor::Gyro,
        about: "the two half-waves of the demodulator differ: another scale factor each way",
        coefficients: &ASYMMETRY,
        typical: &[1e-3; 3],
        form: None,
        regressors: |at, _, out| per_axis(out, |i| at.sensed[i].abs()),
        needs: "three rates and more about each axis, both directions",
    },
];
