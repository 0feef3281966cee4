//! Errors that depend on the temperature.

use super::effect::{Coefficient, DPS, Effect, MG, NonlinearParameter, Role, Scope, each, times};
use super::quantity::Quantity::{
    self, Force, Input, Rate, RecordingTime, Temperature, TemperatureLag,
};
use super::regressor::Regressor;
use crate::quantity::Sensor;

/// Slope and curvature of the bias.
const fn bias(slope: f64, curvature: f64) -> [Coefficient; 6] {
    let [x, y, z] = each(Regressor::linear(Temperature), slope);
    let squared = Regressor::power(Temperature, 2);
    [
        x,
        y,
        z,
        Coefficient::of(0, "x squared", squared, curvature),
        Coefficient::of(1, "y squared", squared, curvature),
        Coefficient::of(2, "z squared", squared, curvature),
    ]
}

/// Products of the temperature with the components of the input across each axis: `x`, `y`, `z` are the components.
const fn tilt(x: Quantity, y: Quantity, z: Quantity) -> [Coefficient; 6] {
    let typical = 2e-5;
    [
        Coefficient::of(0, "xy", times(Temperature, y), typical),
        Coefficient::of(0, "xz", times(Temperature, z), typical),
        Coefficient::of(1, "yx", times(Temperature, x), typical),
        Coefficient::of(1, "yz", times(Temperature, z), typical),
        Coefficient::of(2, "zx", times(Temperature, x), typical),
        Coefficient::of(2, "zy", times(Temperature, y), typical),
    ]
}

/// Lag of each axis, and how far it still was behind when the recording began. The die is elsewhere than the thermometer, and after power-on each
/// heats itself. Their difference at the start decays with the lag.
const fn behind(slope: f64, at_start: f64) -> [Coefficient; 6] {
    let [x, y, z] = each(Regressor::linear(TemperatureLag), slope);
    let left = Regressor::Decay(RecordingTime);
    [
        x,
        y,
        z,
        Coefficient::of(0, "x at start", left, at_start).scoped(Scope::Recording),
        Coefficient::of(1, "y at start", left, at_start).scoped(Scope::Recording),
        Coefficient::of(2, "z at start", left, at_start).scoped(Scope::Recording),
    ]
}

const SCALE: [Coefficient; 3] = each(times(Temperature, Input), 3e-4);

/// A temperature that lags by far more than the recording lasts is constant, so its difference from the thermometer's is that of the thermal bias.
const fn lag(bias: &'static str) -> Option<NonlinearParameter> {
    Some(NonlinearParameter {
        name: "lag_s",
        from: 5.0,
        to: 600.0,
        role: Role::Lag,
        limit: Some(bias),
    })
}

const SWEEP: &str = "temp_c, and the dwells at temperatures 20 °C apart";
const RAMP: &str = "temp_c, and a ramp up and down at some °C a minute";
const ONE_WAY: &str = "drift, on a one-way sweep";

pub(super) const EFFECTS: &[Effect] = &[
    Effect {
        id: "gyro_thermal_bias",
        sensor: Sensor::Gyro,
        about: "the bias follows the temperature",
        // ADXRS300: 40 deg/s between the ends of its range at most; a sixth of it.
        coefficients: &bias(0.1 * DPS, 1e-3 * DPS),
        parameter: None,
        size: "0.1 deg/s/K and 0.001 deg/s/K² (ADXRS300: 40 deg/s over its range at most; a sixth)",
        needs: SWEEP,
        taken_for: ONE_WAY,
    },
    Effect {
        id: "accel_thermal_bias",
        sensor: Sensor::Accel,
        about: "the bias follows the temperature",
        coefficients: &bias(2.0 * MG, 2e-2 * MG),
        parameter: None,
        size: "2 mg/K and 0.02 mg/K² (MMA7260QT)",
        needs: SWEEP,
        taken_for: ONE_WAY,
    },
    Effect {
        id: "gyro_thermal_scale",
        sensor: Sensor::Gyro,
        about: "the scale factor follows the temperature",
        coefficients: &SCALE,
        parameter: None,
        size: "300 ppm/K (MMA7260QT; ADXRS300: 1300 at most)",
        needs: SWEEP,
        taken_for: "",
    },
    Effect {
        id: "accel_thermal_scale",
        sensor: Sensor::Accel,
        about: "the scale factor follows the temperature",
        coefficients: &SCALE,
        parameter: None,
        size: "300 ppm/K (MMA7260QT)",
        needs: SWEEP,
        taken_for: "",
    },
    Effect {
        id: "gyro_thermal_misalignment",
        sensor: Sensor::Gyro,
        about: "solder and board bend: the sensitive directions rotate with temperature",
        coefficients: &tilt(Rate(0), Rate(1), Rate(2)),
        parameter: None,
        size: "20 µrad/K (assumed)",
        needs: SWEEP,
        taken_for: "",
    },
    Effect {
        id: "accel_thermal_misalignment",
        sensor: Sensor::Accel,
        about: "solder and board bend: the sensitive directions rotate with temperature",
        coefficients: &tilt(Force(0), Force(1), Force(2)),
        parameter: None,
        size: "20 µrad/K (assumed)",
        needs: SWEEP,
        taken_for: "",
    },
    Effect {
        id: "gyro_thermal_lag",
        sensor: Sensor::Gyro,
        about: "die and package lag behind the thermometer: a loop on ramps",
        // At the start: some kelvins of self-heating.
        coefficients: &behind(0.1 * DPS, 0.3 * DPS),
        parameter: lag("gyro_thermal_bias"),
        size: "as the thermal bias; at the start 0.3 deg/s",
        needs: RAMP,
        taken_for: "thermal bias, on a one-way ramp",
    },
    Effect {
        id: "accel_thermal_lag",
        sensor: Sensor::Accel,
        about: "die and package lag behind the thermometer: a loop on ramps",
        coefficients: &behind(2.0 * MG, 6.0 * MG),
        parameter: lag("accel_thermal_bias"),
        size: "as the thermal bias; at the start 6 mg",
        needs: RAMP,
        taken_for: "thermal bias, on a one-way ramp",
    },
];
