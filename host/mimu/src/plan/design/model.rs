//! Regressors of the affine calibration model, its parameters and units.
//!
//! Effects beyond the affine model have recipes instead ([`crate::plan::next_experiment`]).

use std::borrow::Cow;

use nalgebra::Vector3;

use crate::observation::{LOWER, free, place, slope};
use crate::quantity::{AXES, Sensor};
use crate::readable;
use mimu_recording::Reference;

/// Standard gravity, m/s²: magnitude of the specific force at rest. Local gravity differs by parts in a
/// thousand, which changes no design.
pub const GRAVITY: f64 = readable::STANDARD_GRAVITY;

/// Input of one dwell: an attitude and, on a turntable, a rate about the vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Direction in the body frame that points up, of length 1. Specific force at rest is along it.
    pub up: Vector3<f64>,
    /// Rate about the upward vertical, rad/s, right-hand rule; in the body frame `rate * up`.
    pub rate: f64,
}

impl Setting {
    /// At rest with `up` (any length) pointing up.
    pub fn at_rest(up: Vector3<f64>) -> Self {
        Self {
            up: up.normalize(),
            rate: 0.0,
        }
    }
}

/// A parameter and its units.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `b_x`, `P_xy`, `C_yx`, ...
    pub name: String,
    /// Unit in SI; "1" for a ratio.
    pub unit: &'static str,
    /// Parameter in SI over its normalised value, which is in the sensor's SI unit at full input.
    pub si: f64,
    /// Unit for display.
    pub shown_unit: Cow<'static, str>,
    /// Parameter in that unit over its normalised value.
    pub shown: f64,
}

/// The affine model of one triad: which regressors a setting has.
///
/// Inputs are normalised by the full input, so that all regressors are of order one: that is what makes
/// determinants comparable with fang (22), r = 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Sensor.
    pub sensor: Sensor,
    /// Known input, forward form, fang (19): all three sensors have the same regressors. Or the magnitude of gravity only, linearised about a perfect
    /// triad.
    pub reference: Reference,
    /// Full input along x, y, z, SI: gravity, or the largest rate.
    pub span: Vector3<f64>,
}

impl Model {
    /// Of an accelerometer.
    pub fn accel(reference: Reference) -> Self {
        Self {
            sensor: Sensor::Accel,
            reference,
            span: Vector3::repeat(GRAVITY),
        }
    }

    /// Of a gyro triad on a turntable, with the largest rate along each axis, rad/s.
    pub fn gyro(span: Vector3<f64>) -> Self {
        Self {
            sensor: Sensor::Gyro,
            reference: Reference::Table,
            span,
        }
    }

    /// Number of regressors.
    pub fn width(&self) -> usize {
        match self.reference {
            Reference::Table => 4,
            Reference::Gravity | Reference::TurntableRate => LOWER.len(),
        }
    }

    /// Input of a setting over the full input.
    pub fn input(&self, setting: &Setting) -> Vector3<f64> {
        match self.sensor {
            Sensor::Accel => setting.up,
            Sensor::Gyro => (setting.up * setting.rate).component_div(&self.span),
        }
    }

    /// Appends the regressors of `setting`.
    pub fn regressors(&self, setting: &Setting, row: &mut Vec<f64>) {
        let x = self.input(setting);
        match self.reference {
            Reference::Table => row.extend([1.0, x.x, x.y, x.z]),
            Reference::Gravity | Reference::TurntableRate => {
                row.extend(&free(&slope(&setting.up, &x), &LOWER));
            }
        }
    }

    /// Parameters of the triad, in the order of the regressors: with a known input those of x, of y, of z.
    pub fn parameters(&self) -> Vec<Parameter> {
        let span = self.span;
        let matrix = |letter: char, i: usize, j: usize| Parameter {
            name: format!("{letter}_{}{}", AXES[i], AXES[j]),
            unit: "1",
            si: 1.0 / span[j],
            shown_unit: if i == j { "ppm" } else { "µrad" }.into(),
            shown: 1e6 / span[j],
        };
        let bias = |letter: char, i: usize| {
            let unit = self.sensor.unit();
            let shown = readable::parameter(unit);
            Parameter {
                name: format!("{letter}_{}", AXES[i]),
                unit,
                si: 1.0,
                shown_unit: shown.unit,
                shown: shown.factor,
            }
        };
        match self.reference {
            Reference::Table => (0..3)
                .flat_map(|i| {
                    let row = [0, 1, 2].map(|j| matrix('P', i, j));
                    std::iter::once(bias('b', i)).chain(row)
                })
                .collect(),
            Reference::Gravity | Reference::TurntableRate => LOWER
                .map(|k| match place(k) {
                    (i, Some(j)) => matrix('C', i, j),
                    (i, None) => bias('o', i),
                })
                .into(),
        }
    }
}
