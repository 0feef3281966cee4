//! Parameters of autopilots, and their file layouts.

use std::fmt::Write as _;

use mimu::quantity::PerSensor;
use serde::Serialize;

use crate::driver;

/// A parameter of an autopilot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Name in the autopilot.
    pub name: String,
    /// Value, in single precision unless whole.
    pub value: f64,
    /// Its type in MAVLink: 2 is INT8, 6 INT32, 9 REAL32.
    #[serde(skip)]
    kind: u8,
}

impl Parameter {
    /// A value in single precision.
    pub fn real(name: String, value: f64) -> Self {
        let value = f64::from(value as f32);
        Self {
            name,
            value,
            kind: 9,
        }
    }

    /// An integer of 8 bits.
    pub fn int8(name: String, value: i8) -> Self {
        Self {
            name,
            value: value.into(),
            kind: 2,
        }
    }

    /// An integer of 32 bits.
    pub fn int32(name: String, value: i32) -> Self {
        Self {
            name,
            value: value.into(),
            kind: 6,
        }
    }

    /// The shortest decimal number without an exponent that equals the value in single precision.
    fn text(&self) -> String {
        match self.kind {
            9 => (self.value as f32).to_string(),
            _ => self.value.to_string(),
        }
    }
}

/// Options common to PX4 and ArduPilot.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Number of the inertial unit in the autopilot, from 1
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3)))]
    pub imu: u8,
    /// Device id of the gyro in the autopilot (CAL_GYROn_ID, INS_GYR_ID)
    #[cfg_attr(feature = "clap", arg(long, value_name = "ID"))]
    pub gyro_id: Option<u32>,
    /// Device id of the accelerometer in the autopilot (CAL_ACCn_ID, INS_ACC_ID)
    #[cfg_attr(feature = "clap", arg(long, value_name = "ID"))]
    pub accel_id: Option<u32>,
    /// File for QGroundControl, five columns with tabs; without it NAME,VALUE for MAVProxy and Mission Planner
    #[cfg_attr(feature = "clap", arg(long))]
    pub qgc: bool,
    /// The driver's conversion.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

impl Options {
    /// Device ids, as far as the user knows them. Autopilots store them bit by bit in signed parameters.
    pub fn ids(&self) -> PerSensor<Option<i32>> {
        PerSensor::from([self.gyro_id, self.accel_id]).map(|id| id.map(|id| id as i32))
    }

    /// Comments and parameters in the layout of the file.
    pub fn text(&self, comments: &str, parameters: &[Parameter]) -> String {
        let mut out = comments.to_owned();
        for parameter in parameters {
            let (name, value, kind) = (&parameter.name, parameter.text(), parameter.kind);
            let _ = match self.qgc {
                false => writeln!(out, "{name},{value}"),
                true => writeln!(out, "1\t1\t{name}\t{value}\t{kind}"),
            };
        }
        out
    }
}
