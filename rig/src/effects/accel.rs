//! Accelerometer errors that depend on the motion alone.

use super::{G, Spec, axes, input, matrix};
use crate::rotation::{add as sum, cross, dot, scale};

const MG: f64 = 1e-3 * G;

pub(super) const SPECS: &[Spec] = &[
    // Nonlinearity of the MMA7260QT: 1 % of full scale at most, 15 mg at 1.5 g. A third of it at 1 g.
    Spec {
        id: "accel_scale_quadratic",
        about: "error = size · force²",
        parameters: &[axes("mg_per_g2", 5.0)],
        build: |b| power(b.list("mg_per_g2"), |f| f * f),
    },
    Spec {
        id: "accel_scale_cubic",
        about: "error = size · force³",
        parameters: &[axes("mg_per_g3", 5.0)],
        build: |b| power(b.list("mg_per_g3"), |f| f * f * f),
    },
    // Force across the axis pulls the comb aside and changes the gap of the sense capacitors. Assumed as large as the nonlinearity.
    Spec {
        id: "accel_cross_axis_product",
        about: "error = row of matrix · (fx fy, fy fz, fz fx) of the forces along the axes",
        parameters: &[matrix("matrix_mg_per_g2", 3.0)],
        build: |b| {
            let m = b.matrix("matrix_mg_per_g2");
            input(move |at, add| {
                let f = at.accel.map(|f| f / G);
                let products = [f[0] * f[1], f[1] * f[2], f[2] * f[0]];
                for i in 0..3 {
                    add.accel[i] += MG * dot(m[i], products);
                }
            })
        },
    },
    // The three g-cells are not at the board's origin: millimetres within a package, centimetres on a board.
    Spec {
        id: "accel_size_effect",
        about: "each axis has its own point r: error = direction · (α×r + ω×(ω×r))",
        parameters: &[matrix("arms_mm", 5.0)],
        build: |b| {
            let arms = b.matrix("arms_mm").map(|row| row.map(|x| 1e-3 * x));
            let directions = b.sensors.accel.axes.each_ref().map(|a| a.direction);
            input(move |at, add| {
                let (w, alpha) = (at.motion.rate, at.motion.angular_acceleration);
                for i in 0..3 {
                    // ω×(ω×r) = ω (ω·r) - r ω².
                    let r = arms[i];
                    let inward = sum(scale(dot(w, r), w), scale(-dot(w, w), r));
                    add.accel[i] += dot(directions[i], sum(cross(alpha, r), inward));
                }
            })
        },
    },
];

fn power(size_mg: [f64; 3], shape: fn(f64) -> f64) -> super::Active {
    input(move |at, add| {
        for i in 0..3 {
            add.accel[i] += MG * size_mg[i] * shape(at.accel[i] / G);
        }
    })
}
