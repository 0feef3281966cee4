//! Errors that depend on the temperature of the dies.

use super::{
    Active, Build, Condition, DPS, Disturbance, G, Parameter, REFERENCE_C, Shape, Spec, axes, form,
    input, sized,
};
use crate::filter::LowPass;
use crate::rotation::{Vector, dot};

const MG: f64 = 1e-3 * G;

/// The triad of an effect: its dies, its sensed inputs, the input of the board, and the destination of the errors.
#[derive(Clone, Copy)]
struct Triad {
    dies: [usize; 3],
    sensed: fn(&Condition) -> [f64; 3],
    vector: fn(&Condition) -> Vector,
    error: fn(&mut Disturbance) -> &mut [f64; 3],
    unit: f64,
}

const GYRO: Triad = Triad {
    dies: [0, 1, 2],
    sensed: |at| at.gyro,
    vector: |at| at.motion.rate,
    error: |add| &mut add.gyro,
    unit: DPS,
};

const ACCEL: Triad = Triad {
    dies: [3, 3, 3],
    sensed: |at| at.accel,
    vector: |at| at.motion.force,
    error: |add| &mut add.accel,
    unit: MG,
};

/// Tilt of the axes per kelvin, because boards bend and solder creeps. Assumed: 20 µrad/K is 70 arcseconds in 17 K.
const TILT: [Parameter; 1] = [sized("matrix_urad_per_c", Shape::Cross, 20.0)];

/// Curvature of the bias, relative, and the lags: assumed.
const CURVATURE: Parameter = form("curvature_per_c", 0.001, 0.01);
const LAG: Parameter = form("lag_s", 20.0, 120.0);

pub(super) const SPECS: &[Spec] = &[
    // ADXRS300: the null may change by 0.2 V, 40 deg/s, between -40 and 85 °C: 0.6 deg/s/K at most. A sixth of that.
    Spec {
        id: "gyro_thermal_bias",
        about: "bias = size · (ΔT + curvature · ΔT²), ΔT of its die from 25 °C",
        parameters: &[axes("dps_per_c", 0.1), CURVATURE],
        build: |b| bias(b, "dps_per_c", GYRO),
    },
    // MMA7260QT: ±2 mg/K.
    Spec {
        id: "accel_thermal_bias",
        about: "bias = size · (ΔT + curvature · ΔT²), ΔT of the die from 25 °C",
        parameters: &[axes("mg_per_c", 2.0), CURVATURE],
        build: |b| bias(b, "mg_per_c", ACCEL),
    },
    // ADXRS300: within 8 % over all temperatures, 1300 ppm/K at most. MMA7260QT: ±0.03 %/K.
    Spec {
        id: "gyro_thermal_scale",
        about: "error = size · ΔT · rate, ΔT of its die from 25 °C",
        parameters: &[axes("ppm_per_c", 300.0)],
        build: |b| scale(b, GYRO),
    },
    Spec {
        id: "accel_thermal_scale",
        about: "error = size · ΔT · force, ΔT of the die from 25 °C",
        parameters: &[axes("ppm_per_c", 300.0)],
        build: |b| scale(b, ACCEL),
    },
    Spec {
        id: "gyro_thermal_misalignment",
        about: "sensitive directions turn: error = row of matrix · rate · ΔT; the diagonal must be 0",
        parameters: &TILT,
        build: |b| misalignment(b, GYRO),
    },
    Spec {
        id: "accel_thermal_misalignment",
        about: "sensitive directions turn: error = row of matrix · force · ΔT; the diagonal must be 0",
        parameters: &TILT,
        build: |b| misalignment(b, ACCEL),
    },
    // The package follows the die with a lag and meanwhile strains it.
    Spec {
        id: "gyro_thermal_lag",
        about: "bias = size · (T one lag behind the die - T of the die): a loop on ramps",
        parameters: &[axes("dps_per_c", 0.1), LAG],
        build: |b| lag(b, "dps_per_c", GYRO),
    },
    Spec {
        id: "accel_thermal_lag",
        about: "bias = size · (T one lag behind the die - T of the die): a loop on ramps",
        parameters: &[axes("mg_per_c", 2.0), LAG],
        build: |b| lag(b, "mg_per_c", ACCEL),
    },
];

fn bias(b: &Build, key: &str, triad: Triad) -> Active {
    let size = b.list::<3>(key);
    let curvature = b.number("curvature_per_c");
    input(move |at, add| {
        for i in 0..3 {
            let warm = at.temperatures.die[triad.dies[i]] - REFERENCE_C;
            (triad.error)(add)[i] += triad.unit * size[i] * (warm + curvature * warm * warm);
        }
    })
}

fn scale(b: &Build, triad: Triad) -> Active {
    let size = b.list::<3>("ppm_per_c");
    input(move |at, add| {
        for i in 0..3 {
            let warm = at.temperatures.die[triad.dies[i]] - REFERENCE_C;
            (triad.error)(add)[i] += 1e-6 * size[i] * warm * (triad.sensed)(at)[i];
        }
    })
}

fn misalignment(b: &Build, triad: Triad) -> Active {
    let m = b.matrix("matrix_urad_per_c");
    input(move |at, add| {
        let vector = (triad.vector)(at);
        for i in 0..3 {
            let warm = at.temperatures.die[triad.dies[i]] - REFERENCE_C;
            (triad.error)(add)[i] += 1e-6 * warm * dot(m[i], vector);
        }
    })
}

fn lag(b: &Build, key: &str, triad: Triad) -> Active {
    let size = b.list::<3>(key);
    let mut late = [LowPass::new(b.number("lag_s"), b.dt_s, 0.0); 3];
    let mut started = false;
    input(move |at, add| {
        for i in 0..3 {
            let die = at.temperatures.die[triad.dies[i]];
            if !started {
                late[i].settle(die);
            }
            (triad.error)(add)[i] += triad.unit * size[i] * (late[i].step(die) - die);
        }
        started = true;
    })
}
