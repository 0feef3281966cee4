//! Errors by temperature.

use super::{at_start, each, of, per_axis};
use crate::diagnose::effect::{Coefficient, Effect, Form, FormKind, Moment};
use crate::quantity::Sensor;

const DPS: f64 = std::f64::consts::PI / 180.0;
const MG: f64 = 9.80665e-3;

/// Line and bend.
const fn bias(line: &'static str, bend: &'static str) -> [Coefficient; 6] {
    [
        of(0, "x", line),
        of(1, "y", line),
        of(2, "z", line),
        of(0, "x squared", bend),
        of(1, "y squared", bend),
        of(2, "z squared", bend),
    ]
}

const GYRO_BIAS: [Coefficient; 6] = bias("rad/s/K", "rad/s/K^2");
const ACCEL_BIAS: [Coefficient; 6] = bias("m/s^2/K", "m/s^2/K^2");
const SCALE: [Coefficient; 3] = each("1/K");
const TILT: [Coefficient; 6] = [
    of(0, "xy", "rad/K"),
    of(0, "xz", "rad/K"),
    of(1, "yx", "rad/K"),
    of(1, "yz", "rad/K"),
    of(2, "zx", "rad/K"),
    of(2, "zy", "rad/K"),
];
/// Axis of the input that each coefficient of [`TILT`] is about.
const TILTED: [usize; 6] = [1, 2, 0, 2, 0, 1];
/// Lag of each axis, and what it was still behind by when the recording began.
const fn behind(unit: &'static str, error: &'static str) -> [Coefficient; 6] {
    let [x, y, z] = each(unit);
    [
        x,
        y,
        z,
        at_start(0, "x at start", error),
        at_start(1, "y at start", error),
        at_start(2, "z at start", error),
    ]
}

const GYRO_LAG: [Coefficient; 6] = behind("rad/s/K", "rad/s");
const ACCEL_LAG: [Coefficient; 6] = behind("m/s^2/K", "m/s^2");

const LAG: Option<Form> = Some(Form {
    name: "lag_s",
    from: 5.0,
    to: 600.0,
    kind: FormKind::Lag,
});

fn line_and_bend(at: &Moment, _: f64, out: &mut [f64]) {
    per_axis(out, |k| {
        if k < 3 {
            at.warm_c
        } else {
            at.warm_c * at.warm_c
        }
    });
}

fn scale(at: &Moment, _: f64, out: &mut [f64]) {
    per_axis(out, |i| at.warm_c * at.sensed[i]);
}

/// Where the die was when the recording began is not known: it sits elsewhere than the thermometer, and after power-on each warms up
/// by itself. What that differs from the thermometer dies away with the lag.
fn lag(at: &Moment, lag_s: f64, out: &mut [f64]) {
    let left = match at.session {
        0 => (-at.t_s / lag_s).exp(),
        _ => 0.0,
    };
    per_axis(out, |k| if k < 3 { at.late_c - at.warm_c } else { left });
}

const SWEEP: &str = "temp_c, and the dwells at temperatures 20 °C apart";
const RAMP: &str = "temp_c, and a ramp up and down at some °C a minute";

pub(super) const EFFECTS: [Effect; 8] = [
    Effect {
        id: "gyro_thermal_bias",
        sensor: Sensor::Gyro,
        about: "the bias follows the temperature",
        coefficients: &GYRO_BIAS,
        // ADXRS300: 40 deg/s between the ends of its range at most; a sixth of it.
        typical: &[
            0.1 * DPS,
            0.1 * DPS,
            0.1 * DPS,
            1e-3 * DPS,
            1e-3 * DPS,
            1e-3 * DPS,
        ],
        form: None,
        regressors: line_and_bend,
        needs: SWEEP,
    },
    Effect {
        id: "accel_thermal_bias",
        sensor: Sensor::Accel,
        about: "the bias follows the temperature",
        coefficients: &ACCEL_BIAS,
        // MMA7260QT: 2 mg/K.
        typical: &[
            2.0 * MG,
            2.0 * MG,
            2.0 * MG,
            2e-2 * MG,
            2e-2 * MG,
            2e-2 * MG,
        ],
        form: None,
        regressors: line_and_bend,
        needs: SWEEP,
    },
    Effect {
        id: "gyro_thermal_scale",
        sensor: Sensor::Gyro,
        about: "the scale factor follows the temperature",
        coefficients: &SCALE,
        typical: &[3e-4; 3],
        form: None,
        regressors: scale,
        needs: SWEEP,
    },
    Effect {
        id: "accel_thermal_scale",
        sensor: Sensor::Accel,
        about: "the scale factor follows the temperature",
        coefficients: &SCALE,
        typical: &[3e-4; 3],
        form: None,
        regressors: scale,
        needs: SWEEP,
    },
    Effect {
        id: "gyro_thermal_misalignment",
        sensor: Sensor::Gyro,
        about: "solder and board bend: the sensitive directions turn with the temperature",
        coefficients: &TILT,
        typical: &[2e-5; 6],
        form: None,
        regressors: |at, _, out| per_axis(out, |k| at.warm_c * at.rate[TILTED[k]]),
        needs: SWEEP,
    },
    Effect {
        id: "accel_thermal_misalignment",
        sensor: Sensor::Accel,
        about: "solder and board bend: the sensitive directions turn with the temperature",
        coefficients: &TILT,
        typical: &[2e-5; 6],
        form: None,
        regressors: |at, _, out| per_axis(out, |k| at.warm_c * at.force[TILTED[k]]),
        needs: SWEEP,
    },
    Effect {
        id: "gyro_thermal_lag",
        sensor: Sensor::Gyro,
        about: "die and package lag behind the temperature sensor: a loop on ramps",
        coefficients: &GYRO_LAG,
        // Beside the slope: some kelvins of self-heating.
        typical: &[
            0.1 * DPS,
            0.1 * DPS,
            0.1 * DPS,
            0.3 * DPS,
            0.3 * DPS,
            0.3 * DPS,
        ],
        form: LAG,
        regressors: lag,
        needs: RAMP,
    },
    Effect {
        id: "accel_thermal_lag",
        sensor: Sensor::Accel,
        about: "die and package lag behind the temperature sensor: a loop on ramps",
        coefficients: &ACCEL_LAG,
        typical: &[2.0 * MG, 2.0 * MG, 2.0 * MG, 6.0 * MG, 6.0 * MG, 6.0 * MG],
        form: LAG,
        regressors: lag,
        needs: RAMP,
    },
];
