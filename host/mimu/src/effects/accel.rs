//! Accelerometer errors that depend on the motion.

use super::effect::{Coefficient, Effect, G, MG, each, times};
use super::quantity::Quantity::{AngularAcceleration, Input, InputAlong, Rate};
use super::regressor::{Product, Regressor};
use crate::quantity::Sensor;

const PRODUCT: [Coefficient; 9] = {
    let [xy, yz, zx] = [
        times(InputAlong(0), InputAlong(1)),
        times(InputAlong(1), InputAlong(2)),
        times(InputAlong(2), InputAlong(0)),
    ];
    let typical = 3.0 * MG / (G * G);
    [
        Coefficient::of(0, "x xy", xy, typical),
        Coefficient::of(0, "x yz", yz, typical),
        Coefficient::of(0, "x zx", zx, typical),
        Coefficient::of(1, "y xy", xy, typical),
        Coefficient::of(1, "y yz", yz, typical),
        Coefficient::of(1, "y zx", zx, typical),
        Coefficient::of(2, "z xy", xy, typical),
        Coefficient::of(2, "z yz", yz, typical),
        Coefficient::of(2, "z zx", zx, typical),
    ]
};

/// The error of axis i is row i of `[α]× + [ω]×²` times the position, m, at which this axis senses.
const ARMS: [Coefficient; 9] = {
    const fn along(first: usize, second: usize) -> Regressor {
        Regressor::Sum(
            Product::power(Rate(first), 2).negative(),
            Product::power(Rate(second), 2).negative(),
        )
    }
    const fn across(first: usize, second: usize, turn: Product) -> Regressor {
        Regressor::Sum(Product::of(Rate(first), Rate(second)), turn)
    }
    let turn = [
        Product::power(AngularAcceleration(0), 1),
        Product::power(AngularAcceleration(1), 1),
        Product::power(AngularAcceleration(2), 1),
    ];
    // Millimetres within a package, centimetres on a board.
    let typical = 5e-3;
    [
        Coefficient::of(0, "xx", along(1, 2), typical),
        Coefficient::of(0, "xy", across(0, 1, turn[2].negative()), typical),
        Coefficient::of(0, "xz", across(0, 2, turn[1]), typical),
        Coefficient::of(1, "yx", across(0, 1, turn[2]), typical),
        Coefficient::of(1, "yy", along(0, 2), typical),
        Coefficient::of(1, "yz", across(1, 2, turn[0].negative()), typical),
        Coefficient::of(2, "zx", across(0, 2, turn[1].negative()), typical),
        Coefficient::of(2, "zy", across(1, 2, turn[0]), typical),
        Coefficient::of(2, "zz", along(0, 1), typical),
    ]
};

pub(super) const EFFECTS: &[Effect] = &[
    Effect {
        id: "accel_scale_quadratic",
        sensor: Sensor::Accel,
        about: "the gap of the sense capacitor changes: error proportional to the square of the force along the axis",
        // MMA7260QT: at most 1 % of full scale, which is 15 mg at 1.5 g. A third of it is taken at 1 g.
        coefficients: &each(Regressor::power(Input, 2), 5.0 * MG / (G * G)),
        parameter: None,
        size: "5 mg/g² (MMA7260QT: 15 mg at 1.5 g)",
        needs: "each axis up, down, level and slanted, against a table",
        taken_for: "size of the bias, without a table",
    },
    Effect {
        id: "accel_scale_cubic",
        sensor: Sensor::Accel,
        about: "the spring stiffens: error proportional to the cube of the force along the axis",
        coefficients: &each(Regressor::power(Input, 3), 5.0 * MG / (G * G * G)),
        parameter: None,
        size: "5 mg/g³ (MMA7260QT: 15 mg at 1.5 g)",
        needs: "each axis up, down, level and at two slants, against a table",
        taken_for: "scale factor, without a table",
    },
    Effect {
        id: "accel_cross_axis_product",
        sensor: Sensor::Accel,
        about: "a force across the axis pulls the comb aside: error proportional to products of the forces along two axes",
        coefficients: &PRODUCT,
        parameter: None,
        size: "3 mg/g² (assumed)",
        needs: "poses with two and three axes off the vertical, against a table",
        taken_for: "",
    },
    Effect {
        id: "accel_size_effect",
        sensor: Sensor::Accel,
        about: "each axis senses at a different point: centripetal and Euler acceleration",
        coefficients: &ARMS,
        parameter: None,
        size: "5 mm (a package; on a board centimetres)",
        needs: "fast turns about every axis while the force is known",
        taken_for: "a table's offset from the axis",
    },
];
