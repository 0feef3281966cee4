//! Quantities on which an error can depend: the state and the surroundings of a unit.

use nalgebra::Vector3;

use crate::quantity::AXES;
use crate::quantity::Sensor;
use mimu_recording::units::STANDARD_GRAVITY;

/// Temperature from which temperature offsets count, °C.
pub const REFERENCE_C: f64 = 25.0;

/// Time constant of the filter for the rate of change of the temperature, s; unfiltered it would be noise.
pub const RATE_LAG_S: f64 = 30.0;

/// State and surroundings of a unit over a short segment of time, in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// Index of the recording.
    pub session: usize,
    /// Middle of the segment, s since the recording began.
    pub t_s: f64,
    /// The same since power-on, as the device counts it; if unknown, since the start of the recording.
    pub on_s: f64,
    /// The same since the middle of the dwells of the recording.
    pub from_middle_s: f64,
    /// Length of the segment, s.
    pub duration_s: f64,
    /// Rate, rad/s.
    pub rate: Vector3<f64>,
    /// Specific force, m/s².
    pub force: Vector3<f64>,
    /// Angular acceleration, rad/s²; zero within a dwell.
    pub angular_acceleration: Vector3<f64>,
    /// The sensor's own input along its three sensitive directions, rad/s or m/s².
    pub sensed: Vector3<f64>,
    /// Temperature above [`REFERENCE_C`], °C; not a number if it was not recorded.
    pub temperature_offset: f64,
    /// The same behind a first-order lag: that of the effect, or [`RATE_LAG_S`].
    pub lagged_temperature: f64,
}

/// A quantity that regressors are made of. The axis that errs is given with the regressor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Rate about a body axis, rad/s.
    Rate(usize),
    /// Specific force along a body axis, m/s².
    Force(usize),
    /// Temperature above [`REFERENCE_C`], K.
    Temperature,
    /// Its rate of change behind a lag of [`RATE_LAG_S`], K/s.
    TemperatureRate,
    /// Time since power-on or, if unknown, since the start of the recording, s.
    Time,
    /// Time since the middle of the dwells of a recording, s: a coefficient of it is specific to the session.
    SessionTime,
    /// Temperature behind a lag, which is the nonlinear parameter of the effect, minus the temperature, K.
    TemperatureLag,
    /// Time since the first recording began, s; infinite in the others.
    RecordingTime,
    /// Input of the sensor along the sensitive direction of the axis that errs, rad/s or m/s².
    Input,
    /// Input of the sensor along the sensitive direction of this axis.
    InputAlong(usize),
    /// Angular acceleration about a body axis, rad/s².
    AngularAcceleration(usize),
    /// Component of the vertical along the body axis of the same name as the axis that errs; the specific force at rest points up.
    Up,
    /// Magnitude of the rate, rad/s.
    RateMagnitude,
}

/// A quantity that may have to be known to remove an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Need {
    Rate,
    Force,
    Temperature,
}

impl Quantity {
    /// Its value in the error of sensor axis `axis`, SI.
    pub fn of(self, at: &Conditions, axis: usize) -> f64 {
        match self {
            Self::Rate(i) => at.rate[i],
            Self::Force(i) => at.force[i],
            Self::Temperature => at.temperature_offset,
            Self::TemperatureRate => (at.temperature_offset - at.lagged_temperature) / RATE_LAG_S,
            Self::Time => at.on_s,
            Self::SessionTime => at.from_middle_s,
            Self::TemperatureLag => at.lagged_temperature - at.temperature_offset,
            Self::RecordingTime => match at.session {
                0 => at.t_s,
                _ => f64::INFINITY,
            },
            Self::Input => at.sensed[axis],
            Self::InputAlong(i) => at.sensed[i],
            Self::AngularAcceleration(i) => at.angular_acceleration[i],
            Self::Up => at.force[axis] / at.force.norm(),
            Self::RateMagnitude => at.rate.norm(),
        }
    }

    /// Name in the id of a term; `None` if terms do not contain it.
    pub fn name(self) -> Option<String> {
        Some(match self {
            Self::Rate(i) => format!("rate_{}", AXES[i]),
            Self::Force(i) => format!("force_{}", AXES[i]),
            Self::Temperature => "temp".into(),
            Self::TemperatureRate => "temp_rate".into(),
            Self::Time => "time".into(),
            _ => return None,
        })
    }

    /// The quantities that terms contain.
    pub const OF_TERMS: [Self; 9] = [
        Self::Rate(0),
        Self::Rate(1),
        Self::Rate(2),
        Self::Force(0),
        Self::Force(1),
        Self::Force(2),
        Self::Temperature,
        Self::TemperatureRate,
        Self::Time,
    ];

    /// Whether it changes only with temperature and time.
    pub fn is_slow(self) -> bool {
        matches!(
            self,
            Self::Temperature
                | Self::TemperatureRate
                | Self::Time
                | Self::SessionTime
                | Self::TemperatureLag
                | Self::RecordingTime
        )
    }

    /// Whether it depends on the temperature.
    pub fn is_thermal(self) -> bool {
        matches!(
            self,
            Self::Temperature | Self::TemperatureRate | Self::TemperatureLag
        )
    }

    /// Whether it is the input of `sensor`, or a part of it.
    pub fn is_input_of(self, sensor: Sensor) -> bool {
        match self {
            Self::Input | Self::InputAlong(_) => true,
            Self::Rate(_) | Self::RateMagnitude => sensor == Sensor::Gyro,
            Self::Force(_) => sensor == Sensor::Accel,
            _ => false,
        }
    }

    /// Whether `need` has to be known to compute it, in an error of `sensor`. An unknown angular acceleration is taken as zero.
    pub(crate) fn needs(self, need: Need, sensor: Sensor) -> bool {
        match (self, need) {
            (Self::Input | Self::InputAlong(_), Need::Rate) => sensor == Sensor::Gyro,
            (Self::Input | Self::InputAlong(_), Need::Force) => sensor == Sensor::Accel,
            (Self::Rate(_) | Self::RateMagnitude, Need::Rate) => true,
            (Self::Force(_) | Self::Up, Need::Force) => true,
            (_, Need::Temperature) => self.is_thermal(),
            _ => false,
        }
    }

    /// SI unit, in an error of `sensor`.
    pub fn unit(self, sensor: Sensor) -> &'static str {
        match self {
            Self::Rate(_) | Self::RateMagnitude => "rad/s",
            Self::Force(_) => "m/s^2",
            Self::Input | Self::InputAlong(_) => sensor.unit(),
            Self::AngularAcceleration(_) => "rad/s^2",
            Self::Temperature | Self::TemperatureLag => "K",
            Self::TemperatureRate => "K/s",
            Self::Time | Self::SessionTime | Self::RecordingTime => "s",
            Self::Up => "1",
        }
    }

    /// Name for people, in the error of axis `axis` of `sensor`.
    pub fn in_words(self, sensor: Sensor, axis: usize) -> String {
        let along = |i: usize| match sensor {
            Sensor::Gyro => format!("rate along gyro {}", AXES[i]),
            Sensor::Accel => format!("force along accel {}", AXES[i]),
        };
        match self {
            Self::Rate(i) => format!("rate {}", AXES[i]),
            Self::Force(i) => format!("force {}", AXES[i]),
            Self::Temperature => "temperature".into(),
            Self::TemperatureRate => "rate of change of the temperature".into(),
            Self::Time | Self::SessionTime => "time".into(),
            Self::TemperatureLag => "lagged temperature minus temperature".into(),
            Self::RecordingTime => "time in the first recording".into(),
            Self::Input => along(axis),
            Self::InputAlong(i) => along(i),
            Self::AngularAcceleration(i) => format!("angular acceleration {}", AXES[i]),
            Self::Up => format!("vertical {}", AXES[axis]),
            Self::RateMagnitude => "magnitude of the rate".into(),
        }
    }

    /// Factor from SI to the unit that people read, and that unit.
    pub fn readable(self, sensor: Sensor) -> (f64, &'static str) {
        let degrees = 1f64.to_degrees();
        match self.unit(sensor) {
            "rad/s" => (degrees, "deg/s"),
            "rad/s^2" => (degrees, "deg/s²"),
            "m/s^2" => (1.0 / STANDARD_GRAVITY, "g"),
            "s" => (1.0 / 60.0, "min"),
            "K/s" => (60.0, "K/min"),
            unit => (1.0, unit),
        }
    }
}
