//! Gyro errors that depend on the motion.

use super::effect::{Coefficient, DPS, Effect, G, Scope, each, force, matrix};
use super::quantity::Quantity::{Input, Up};
use super::regressor::Regressor;
use crate::quantity::Sensor;

/// Full scale of an ADXRS300, rad/s, at which its nonlinearity is specified.
const FULL: f64 = 300.0 * DPS;

const EARTH: [Coefficient; 1] = {
    // 7.292e-5 rad/s at 45 degrees.
    let vertical = Coefficient::of_all("vertical", Regressor::linear(Up), 5.2e-5);
    [vertical.scoped(Scope::Place)]
};

pub(super) const EFFECTS: &[Effect] = &[
    // Only the vertical part: the level part depends on the heading, which is unknown.
    Effect {
        id: "earth_rate",
        sensor: Sensor::Gyro,
        about: "the Earth turns, and a gyro at rest reads it: its rate times the sine of the latitude, about the vertical",
        coefficients: &EARTH,
        parameter: None,
        size: "0.003 deg/s at 45°",
        needs: "rest with each axis up and down, long enough to see 0.003 deg/s",
        taken_for: "g-sensitivity that is the same along all axes",
    },
    Effect {
        id: "gyro_g_sensitivity",
        sensor: Sensor::Gyro,
        about: "specific force deflects the proof mass, and the deflection is read as rate",
        coefficients: &matrix(force(1), 0.2 * DPS / G),
        parameter: None,
        size: "0.2 deg/s/g (ADXRS300)",
        needs: "rest with each axis up and down",
        taken_for: "magnetic sensitivity, if the heading is always the same; Earth rate",
    },
    // At rest the three squares add up to a constant, which acts as a bias. So the differences within each row are seen; the sum is separated from
    // the bias only if the magnitude of the force changes.
    Effect {
        id: "gyro_g_squared",
        sensor: Sensor::Gyro,
        about: "unequal stiffness rectifies force: error proportional to the squares of the force",
        coefficients: &matrix(force(2), 0.05 * DPS / (G * G)),
        parameter: None,
        size: "0.05 deg/s/g² (assumed)",
        needs: "rest with each axis up, down and level; a centrifuge or shaker for the sum of each row, which at rest looks like bias",
        taken_for: "bias, in the sum of each row; g-sensitivity, if each axis points one way only",
    },
    Effect {
        id: "gyro_scale_quadratic",
        sensor: Sensor::Gyro,
        about: "the response bends: error proportional to the square of the rate along the axis",
        coefficients: &each(Regressor::power(Input, 2), 1e-3 / FULL),
        parameter: None,
        size: "0.1 % of full scale at 300 deg/s, best straight line (ADXRS300)",
        needs: "three rates and more about each axis, both directions",
        taken_for: "asymmetry",
    },
    Effect {
        id: "gyro_scale_cubic",
        sensor: Sensor::Gyro,
        about: "the response saturates: error proportional to the cube of the rate along the axis",
        coefficients: &each(Regressor::power(Input, 3), 1e-3 / (FULL * FULL)),
        parameter: None,
        size: "0.1 % of full scale at 300 deg/s, best straight line (ADXRS300)",
        needs: "two sizes of rate and more about each axis, both directions",
        taken_for: "dead zone",
    },
    Effect {
        id: "gyro_scale_asymmetry",
        sensor: Sensor::Gyro,
        about: "the two half-waves of the demodulator differ: the scale factors of the two directions differ",
        coefficients: &each(Regressor::Absolute(Input), 1e-3),
        parameter: None,
        size: "0.1 % (assumed)",
        needs: "three rates and more about each axis, both directions",
        taken_for: "quadratic",
    },
];
