//! Gyro errors that depend on the motion alone.

use super::{DPS, G, Spec, axes, input, matrix};
use crate::rotation::dot;

/// Rate at which the nonlinearities are specified, rad/s: full scale of an ADXRS300.
const FULL: f64 = 300.0 * DPS;

pub(super) const SPECS: &[Spec] = &[
    // The proof mass sags under force and the sense comb reads the sag as rate. ADXRS300: linear acceleration
    // effect 0.2 deg/s/g, any axis.
    Spec {
        id: "gyro_g_sensitivity",
        about: "bias linear in specific force: error = matrix · force (body axes)",
        parameters: &[matrix("matrix_dps_per_g", 0.2)],
        build: |b| {
            let m = b
                .matrix("matrix_dps_per_g")
                .map(|row| row.map(|x| x * DPS / G));
            input(move |at, add| {
                for i in 0..3 {
                    add.gyro[i] += dot(m[i], at.motion.force);
                }
            })
        },
    },
    // Springs that are stiffer in one direction rectify a force, leaving its square. Size assumed: a quarter of the g-sensitivity per g.
    Spec {
        id: "gyro_g_squared",
        about: "rectification: error = matrix · (fx², fy², fz²) (body axes)",
        parameters: &[matrix("matrix_dps_per_g2", 0.05)],
        build: |b| {
            let m = b
                .matrix("matrix_dps_per_g2")
                .map(|row| row.map(|x| x * DPS / (G * G)));
            input(move |at, add| {
                for i in 0..3 {
                    add.gyro[i] += dot(m[i], at.motion.force.map(|f| f * f));
                }
            })
        },
    },
    // Nonlinearity of the ADXRS300: 0.1 % of full scale, which is 0.3 deg/s, best straight line.
    Spec {
        id: "gyro_scale_quadratic",
        about: "error = size · (rate / 300 deg/s)²",
        parameters: &[axes("dps_at_300dps", 0.3)],
        build: |b| scale(b.list("dps_at_300dps"), |x| x * x),
    },
    Spec {
        id: "gyro_scale_cubic",
        about: "error = size · (rate / 300 deg/s)³",
        parameters: &[axes("dps_at_300dps", 0.3)],
        build: |b| scale(b.list("dps_at_300dps"), |x| x * x * x),
    },
    // As large as the nonlinearity: the demodulator's two half-waves differ in gain.
    Spec {
        id: "gyro_scale_asymmetry",
        about: "scale factors of the two directions differ: error = size · |rate| / 300 deg/s",
        parameters: &[axes("dps_at_300dps", 0.3)],
        build: |b| scale(b.list("dps_at_300dps"), f64::abs),
    },
];

fn scale(size_dps: [f64; 3], shape: fn(f64) -> f64) -> super::Active {
    let size = size_dps.map(|s| s * DPS);
    input(move |at, add| {
        for i in 0..3 {
            add.gyro[i] += size[i] * shape(at.gyro[i] / FULL);
        }
    })
}
