//! Biases that move with time.

use super::{Active, Build, DPS, G, Spec, axes, form, input};

const MG: f64 = 1e-3 * G;

pub(super) const SPECS: &[Spec] = &[
    // Sizes assumed: no data sheet of these parts gives ageing within hours.
    Spec {
        id: "gyro_bias_drift",
        about: "bias linear in the recording's time",
        parameters: &[axes("dps_per_hour", 0.3)],
        build: |b| drift(b.list("dps_per_hour"), DPS, gyro),
    },
    Spec {
        id: "accel_bias_drift",
        about: "bias linear in the recording's time",
        parameters: &[axes("mg_per_hour", 3.0)],
        build: |b| drift(b.list("mg_per_hour"), MG, accel),
    },
    // Size and times assumed: the order of magnitude in which a die of some tens of milliwatts and its package settle.
    Spec {
        id: "gyro_warm_up",
        about: "bias size · exp(-t / time constant) since power-on, whatever the temperature",
        parameters: &[axes("dps", 0.5), form("time_constant_s", 60.0, 600.0)],
        build: |b| warm_up(b, "dps", DPS, gyro),
    },
    Spec {
        id: "accel_warm_up",
        about: "bias size · exp(-t / time constant) since power-on, whatever the temperature",
        parameters: &[axes("mg", 5.0), form("time_constant_s", 60.0, 600.0)],
        build: |b| warm_up(b, "mg", MG, accel),
    },
];

/// Selects the triad to which an error is added.
type Triad = fn(&mut super::Disturbance) -> &mut [f64; 3];

fn gyro(add: &mut super::Disturbance) -> &mut [f64; 3] {
    &mut add.gyro
}

fn accel(add: &mut super::Disturbance) -> &mut [f64; 3] {
    &mut add.accel
}

fn drift(per_hour: [f64; 3], unit: f64, triad: Triad) -> Active {
    input(move |at, add| {
        let hours = at.motion.t_s / 3600.0;
        for (error, size) in triad(add).iter_mut().zip(per_hour) {
            *error += size * unit * hours;
        }
    })
}

fn warm_up(b: &Build, key: &str, unit: f64, triad: Triad) -> Active {
    let size = b.list::<3>(key);
    let time_constant_s = b.number("time_constant_s");
    input(move |at, add| {
        let left = (-at.on_s / time_constant_s).exp();
        for (error, size) in triad(add).iter_mut().zip(size) {
            *error += size * unit * left;
        }
    })
}
