//! Errors caused by the supply.

use super::{DPS, Spec, read_out, scalar};
use crate::rotation::norm;

pub(super) const SPECS: &[Spec] = &[
    // The slip rings carry the motor's return current past the unit's ground. Size assumed.
    Spec {
        id: "x_supply_coupling",
        about: "the converter's reference falls by size · rate / 100 deg/s, whatever the direction",
        parameters: &[scalar("ppm_per_100dps", 300.0)],
        build: |b| {
            let size = 1e-6 * b.number("ppm_per_100dps") / (100.0 * DPS);
            read_out(move |at, pins| {
                pins.converter_reference_v *= 1.0 - size * norm(at.motion.rate);
            })
        },
    },
];
