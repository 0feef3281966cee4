//! An effect: an error that the affine model lacks, as a sum of regressors with unknown coefficients.

use super::quantity::Quantity;
use super::regressor::{Product, Regressor};
use crate::quantity::Sensor;

/// 1 deg/s, rad/s.
pub(super) const DPS: f64 = std::f64::consts::PI / 180.0;
/// 1 g, m/s².
pub(super) const G: f64 = crate::readable::STANDARD_GRAVITY;
/// 1 milli-g, m/s².
pub(super) const MG: f64 = 1e-3 * G;

/// Role of the nonlinear parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A time constant, or a scale of another quantity.
    Scale,
    /// The lag of [`Quantity::TemperatureLag`].
    Lag,
}

/// A parameter in which the error is nonlinear; it is searched between two values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearParameter {
    /// Name, with the unit.
    pub name: &'static str,
    /// Smallest value that is searched.
    pub from: f64,
    /// Largest.
    pub to: f64,
    /// Its role.
    pub role: Role,
    /// Id of the effect that this one becomes as the parameter grows without bound; `None` if there is none. If the rows leave the parameter open
    /// towards this limit, the limit is named: it explains them as well, with one number less.
    pub limit: Option<&'static str>,
}

/// One coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// Name.
    pub name: &'static str,
    /// Axis to whose reading it is added; `None`: all three, each with its own regressor.
    pub axis: Option<usize>,
    /// What the error is proportional to.
    pub regressor: Regressor,
    /// Size in data sheets, in the unit of the coefficient. An experiment that would not show this size does not excite the effect.
    pub typical: f64,
    /// What it belongs to.
    pub scope: Scope,
}

/// What a coefficient belongs to. All are fitted and reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// The unit: an error that is written and removed.
    Unit,
    /// The first recording: neither written nor removed elsewhere.
    Recording,
    /// The place: a true input, which the calibration excludes and nothing removes from readings.
    Place,
}

/// One kind of effect. The error of sensor axis i is the sum over the coefficients of i of coefficient times regressor, in the
/// SI unit of the sensor, and is added to what the sensor should read.
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    /// Public, stable name.
    pub id: &'static str,
    /// Triad whose readings err.
    pub sensor: Sensor,
    /// Physics in a line.
    pub about: &'static str,
    /// Its coefficients; those specific to a recording come last.
    pub coefficients: &'static [Coefficient],
    /// Its nonlinear parameter.
    pub parameter: Option<NonlinearParameter>,
    /// Source of the typical sizes, in words.
    pub size: &'static str,
    /// What an experiment needs to show it.
    pub needs: &'static str,
    /// What it may be mistaken for.
    pub taken_for: &'static str,
}

impl Coefficient {
    /// A coefficient of sensor axis `axis`.
    pub const fn of(axis: usize, name: &'static str, regressor: Regressor, typical: f64) -> Self {
        Self {
            name,
            axis: Some(axis),
            regressor,
            typical,
            scope: Scope::Unit,
        }
    }

    /// A coefficient common to all axes.
    pub const fn of_all(name: &'static str, regressor: Regressor, typical: f64) -> Self {
        Self {
            axis: None,
            ..Self::of(0, name, regressor, typical)
        }
    }

    /// The coefficient with another scope.
    pub const fn scoped(self, scope: Scope) -> Self {
        Self { scope, ..self }
    }

    /// The axes to whose readings it is added.
    pub fn axes(&self) -> std::ops::Range<usize> {
        self.axis.map_or(0..3, |axis| axis..axis + 1)
    }

    /// SI unit in an error of `sensor`.
    pub fn unit(&self, sensor: Sensor) -> String {
        self.regressor.unit(sensor)
    }
}

/// One coefficient for each axis, of the same regressor.
pub(super) const fn each(regressor: Regressor, typical: f64) -> [Coefficient; 3] {
    [
        Coefficient::of(0, "x", regressor, typical),
        Coefficient::of(1, "y", regressor, typical),
        Coefficient::of(2, "z", regressor, typical),
    ]
}

/// The coefficients of a matrix, by rows. Rows are the sensor's axes; the columns have these regressors.
pub(super) const fn matrix(columns: [Regressor; 3], typical: f64) -> [Coefficient; 9] {
    let [x, y, z] = columns;
    [
        Coefficient::of(0, "xx", x, typical),
        Coefficient::of(0, "xy", y, typical),
        Coefficient::of(0, "xz", z, typical),
        Coefficient::of(1, "yx", x, typical),
        Coefficient::of(1, "yy", y, typical),
        Coefficient::of(1, "yz", z, typical),
        Coefficient::of(2, "zx", x, typical),
        Coefficient::of(2, "zy", y, typical),
        Coefficient::of(2, "zz", z, typical),
    ]
}

/// The same power of the specific force along each body axis.
pub(super) const fn force(power: u8) -> [Regressor; 3] {
    [
        Regressor::power(Quantity::Force(0), power),
        Regressor::power(Quantity::Force(1), power),
        Regressor::power(Quantity::Force(2), power),
    ]
}

/// Two quantities multiplied.
pub(super) const fn times(first: Quantity, second: Quantity) -> Regressor {
    Regressor::Product(Product::of(first, second))
}

/// How the device removes an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnDevice {
    /// Never: it is a true input, or specific to a session.
    Never,
    /// With every sample.
    EverySample,
    /// Folded into a bias and a matrix, when temperature or time changes.
    Folded,
}

impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl Effect {
    /// Whether it is an error of the readings; otherwise it is a true input.
    pub fn is_error(&self) -> bool {
        self.coefficients.iter().all(|c| c.scope != Scope::Place)
    }

    /// Whether it is specific to a session: it is reported, but not stored in a calibration.
    pub fn is_of_session(&self) -> bool {
        let of_session = |c: &Coefficient| c.regressor.quantities() == [Quantity::SessionTime];
        self.coefficients.iter().all(of_session)
    }

    /// The coefficients that are written to a file and removed.
    pub fn of_unit(&self) -> impl Iterator<Item = &'static Coefficient> {
        self.coefficients.iter().filter(|c| c.scope == Scope::Unit)
    }

    /// How the device removes it. What cannot be folded runs with every sample.
    pub fn on_device(&self) -> OnDevice {
        match self {
            e if !e.is_error() || e.is_of_session() => OnDevice::Never,
            e if e.of_unit().all(|c| c.regressor.folds(e.sensor)) => OnDevice::Folded,
            _ => OnDevice::EverySample,
        }
    }
}
