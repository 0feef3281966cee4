//! An effect: what the affine model lacks, as a sum of regressors with unknown coefficients.

use nalgebra::Vector3;

use crate::dwell::Sensor;

/// Temperature that warmth counts from, °C.
pub const REFERENCE_C: f64 = 25.0;

/// What a unit undergoes over a short stretch of time, in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Index of its recording.
    pub session: usize,
    /// Middle of the stretch, s since the recording began.
    pub t_s: f64,
    /// Its length, s.
    pub duration_s: f64,
    /// Rate, rad/s.
    pub rate: Vector3<f64>,
    /// Specific force, m/s².
    pub force: Vector3<f64>,
    /// Angular acceleration, rad/s²; zero within a dwell.
    pub angular_acceleration: Vector3<f64>,
    /// The sensor's own input along its three sensitive directions, rad/s or m/s².
    pub sensed: Vector3<f64>,
    /// Temperature above [`REFERENCE_C`], °C; not a number where it was not recorded.
    pub warm_c: f64,
    /// The same behind a first-order lag with the time constant of the effect, if it has one of this kind.
    pub late_c: f64,
}

/// A nonlinear constant of an effect, searched between two values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Form {
    /// Name, with the unit.
    pub name: &'static str,
    /// Smallest value that is looked at.
    pub from: f64,
    /// Largest.
    pub to: f64,
    /// Whether it is the lag of [`Moment::late_c`].
    pub lags: bool,
}

/// One coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coefficient {
    /// Name.
    pub name: &'static str,
    /// Axis of the sensor whose reading it is added to.
    pub axis: usize,
    /// Unit.
    pub unit: &'static str,
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
    /// Its coefficients.
    pub coefficients: &'static [Coefficient],
    /// Size of a coefficient in data sheets, in its unit: an experiment that could not see it has not excited the effect.
    pub typical: &'static [f64],
    /// Its nonlinear constant.
    pub form: Option<Form>,
    /// The regressors at a moment, one for each coefficient; the number is that of the form.
    pub regressors: fn(&Moment, f64, &mut [f64]),
    /// What an experiment has to have for it to be seen.
    pub needs: &'static str,
}
