//! Parameters of autopilots, and how files hold them.

use std::fmt::Write as _;

use mimu::calibration::bias_cubic::KnownConversion;
use mimu::quantity::PerSensor;
use serde::Serialize;

use crate::driver;

/// A parameter of an autopilot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// As the autopilot knows it.
    pub name: String,
    /// Value, in single precision unless whole.
    pub value: f64,
    /// MAVLink's type of it: 2 is INT8, 6 INT32, 9 REAL32.
    #[serde(skip)]
    kind: u8,
}

impl Parameter {
    /// In single precision.
    pub fn real(name: String, value: f64) -> Self {
        let value = f64::from(value as f32);
        Self {
            name,
            value,
            kind: 9,
        }
    }

    /// A whole number of 8 bits.
    pub fn int8(name: String, value: i8) -> Self {
        Self {
            name,
            value: value.into(),
            kind: 2,
        }
    }

    /// A whole number of 32 bits.
    pub fn int32(name: String, value: i32) -> Self {
        Self {
            name,
            value: value.into(),
            kind: 6,
        }
    }

    /// The shortest decimals, without an exponent, that are this number in single precision.
    fn text(&self) -> String {
        match self.kind {
            9 => (self.value as f32).to_string(),
            _ => self.value.to_string(),
        }
    }
}

/// What PX4 and ArduPilot both have to be told.
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
    /// How the driver converts.
    #[cfg_attr(feature = "clap", command(flatten))]
    pub driver: driver::Options,
}

impl Options {
    /// How the drivers convert, as far as a person knows it.
    pub fn conversions(&self) -> PerSensor<KnownConversion> {
        self.driver.conversions()
    }

    /// Device ids, as far as a person knows them. Autopilots keep them in signed parameters, bit by bit.
    pub fn ids(&self) -> PerSensor<Option<i32>> {
        PerSensor::from([self.gyro_id, self.accel_id]).map(|id| id.map(|id| id as i32))
    }

    /// `parameters` below `comments`, in the layout of the file.
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
