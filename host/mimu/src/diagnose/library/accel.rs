//! Accelerometer errors that depend on the motion.

use nalgebra::Vector3;

use super::{each, matrix, of, per_axis};
use crate::diagnose::effect::{Coefficient, Effect};
use crate::quantity::Sensor;

const G: f64 = 9.80665;
const MG: f64 = 1e-3 * G;

const QUADRATIC: [Coefficient; 3] = each("1/(m/s^2)");
const CUBIC: [Coefficient; 3] = each("1/(m/s^2)^2");
const PRODUCT: [Coefficient; 9] = [
    of(0, "x xy", "1/(m/s^2)"),
    of(0, "x yz", "1/(m/s^2)"),
    of(0, "x zx", "1/(m/s^2)"),
    of(1, "y xy", "1/(m/s^2)"),
    of(1, "y yz", "1/(m/s^2)"),
    of(1, "y zx", "1/(m/s^2)"),
    of(2, "z xy", "1/(m/s^2)"),
    of(2, "z yz", "1/(m/s^2)"),
    of(2, "z zx", "1/(m/s^2)"),
];
const ARMS: [Coefficient; 9] = matrix("m");

pub(super) const EFFECTS: [Effect; 4] = [
    Effect {
        id: "accel_scale_quadratic",
        sensor: Sensor::Accel,
        about: "the gap of the sense capacitor changes: error by the square of the force along the axis",
        coefficients: &QUADRATIC,
        // MMA7260QT: 1 % of full scale at most, 15 mg at 1.5 g; a third of it at 1 g.
        typical: &[5.0 * MG / (G * G); 3],
        form: None,
        regressors: |at, _, out| per_axis(out, |i| at.sensed[i].powi(2)),
        needs: "each axis up, down, level and slanted, against a table",
    },
    Effect {
        id: "accel_scale_cubic",
        sensor: Sensor::Accel,
        about: "the spring stiffens: error by the cube of the force along the axis",
        coefficients: &CUBIC,
        typical: &[5.0 * MG / (G * G * G); 3],
        form: None,
        regressors: |at, _, out| per_axis(out, |i| at.sensed[i].powi(3)),
        needs: "each axis up, down, level and at two slants, against a table",
    },
    Effect {
        id: "accel_cross_axis_product",
        sensor: Sensor::Accel,
        about: "force across pulls the comb aside: error by products of the forces along two axes",
        coefficients: &PRODUCT,
        typical: &[3.0 * MG / (G * G); 9],
        form: None,
        regressors: |at, _, out| {
            let s = at.sensed;
            let products = [s.x * s.y, s.y * s.z, s.z * s.x];
            per_axis(out, |k| products[k % 3]);
        },
        needs: "poses with two and three axes off the vertical, against a table",
    },
    Effect {
        id: "accel_size_effect",
        sensor: Sensor::Accel,
        about: "each axis senses at a point of its own: centripetal and Euler acceleration",
        coefficients: &ARMS,
        // Millimetres within a package, centimetres on a board.
        typical: &[5e-3; 9],
        form: None,
        regressors: |at, _, out| {
            let (w, alpha) = (at.rate, at.angular_acceleration);
            for i in 0..3 {
                for j in 0..3 {
                    let arm = Vector3::ith(j, 1.0);
                    out[3 * i + j] = (alpha.cross(&arm) + w.cross(&w.cross(&arm)))[i];
                }
            }
        },
        needs: "fast turns about every axis while the force is known",
    },
];
