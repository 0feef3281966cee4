//! Accelerometer errors that estimators do not know.

use super::{DPS, G, Spec, axes, form, input};

const MG: f64 = 1e-3 * G;

pub(super) const SPECS: &[Spec] = &[
    // The supply of the board sags with the rate of one gyro and changes the gain of another chip's amplifier. Size assumed.
    Spec {
        id: "x_accel_rotation_coupling",
        about: "axis i: error = size · rate of axis i+1 · force of axis i+2, body axes",
        parameters: &[axes("mg_per_100dps_g", 3.0)],
        build: |b| {
            let size = b
                .list::<3>("mg_per_100dps_g")
                .map(|s| MG * s / (100.0 * DPS * G));
            input(move |at, add| {
                for i in 0..3 {
                    add.accel[i] +=
                        size[i] * at.motion.rate[(i + 1) % 3] * at.motion.force[(i + 2) % 3];
                }
            })
        },
    },
    // Glue between die and package yields slightly under load and stays deformed: the play (backlash) operator. Size assumed.
    Spec {
        id: "x_accel_stress_hysteresis",
        about: "error of plus or minus the size, by the direction of the last change of force that exceeded twice the play",
        parameters: &[axes("mg", 3.0), form("play_g", 0.1, 0.5)],
        build: |b| {
            let size = b.list::<3>("mg");
            let play = G * b.number("play_g");
            let mut rest: Option<[f64; 3]> = None;
            input(move |at, add| {
                let rest = rest.get_or_insert(at.accel);
                for i in 0..3 {
                    let f = at.accel[i];
                    rest[i] = rest[i].clamp(f - play, f + play);
                    add.accel[i] += MG * size[i] * (f - rest[i]) / play;
                }
            })
        },
    },
    // The moulding compound relaxes with the logarithm of time. Size assumed.
    Spec {
        id: "x_accel_creep",
        about: "bias = size · log10(1 + t / onset) since power-on",
        parameters: &[axes("mg_per_decade", 2.0), form("onset_s", 10.0, 100.0)],
        build: |b| {
            let size = b.list::<3>("mg_per_decade");
            let onset_s = b.number("onset_s");
            input(move |at, add| {
                // For a unit that was always on, the creep is constant.
                let decades = if at.on_s.is_finite() {
                    (at.on_s / onset_s).ln_1p() / 10_f64.ln()
                } else {
                    0.0
                };
                for i in 0..3 {
                    add.accel[i] += MG * size[i] * decades;
                }
            })
        },
    },
];
