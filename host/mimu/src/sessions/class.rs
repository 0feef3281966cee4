//! How much the parameters of a class of parts usually change from one power-on to the next: the prior where one or two sessions cannot show it.

use serde::{Deserialize, Serialize};

use super::between::VariancePrior;
use crate::parameter::{ParameterKind, TriadParameter};
use crate::quantity::{PerSensor, Sensor};

/// A class of parts.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, strum::IntoStaticStr,
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum PartClass {
    /// Digital units of phones and drones.
    #[default]
    Consumer,
    /// Units of a few degrees per hour.
    Tactical,
}

/// Standard deviations between sessions.
struct Typical {
    /// Scale factors, relative.
    scale: f64,
    /// Angles, rad.
    angle: f64,
    /// Biases, SI.
    bias: f64,
}

impl PartClass {
    /// All.
    pub const ALL: [Self; 2] = [Self::Consumer, Self::Tactical];

    /// As in files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Where its figures come from.
    pub fn source(self) -> &'static str {
        match self {
            Self::Consumer => "eight MPU-9150 in nine sessions",
            Self::Tactical => {
                "a tenth of the consumer class; bias of the gyro 5 deg/h, of the accelerometer 0.5 mg"
            }
        }
    }

    /// Degrees of freedom of its variances: how alike parts and axes of the class are.
    fn dof(self) -> f64 {
        3.0
    }

    fn typical(self, sensor: Sensor) -> Typical {
        let consumer = PerSensor {
            gyro: Typical {
                scale: 1.2e-3,
                angle: 1e-3,
                bias: 1.4e-3,
            },
            accel: Typical {
                scale: 1e-4,
                angle: 4e-4,
                bias: 0.023,
            },
        };
        let typical = sensor.pick(consumer.gyro, consumer.accel);
        match self {
            Self::Consumer => typical,
            Self::Tactical => Typical {
                scale: 0.1 * typical.scale,
                angle: 0.1 * typical.angle,
                bias: sensor.pick(
                    5f64.to_radians() / 3600.0,
                    0.5e-3 * crate::readable::STANDARD_GRAVITY,
                ),
            },
        }
    }

    /// Standard deviation of the change of a bias of `sensor` from one power-on to the next, SI.
    pub fn bias_change(self, sensor: Sensor) -> f64 {
        self.typical(sensor).bias
    }

    /// The prior of a parameter of `sensor` whose axis has this scale factor, raw per SI.
    pub fn prior(self, sensor: Sensor, of: TriadParameter, scale: f64) -> VariancePrior {
        let typical = self.typical(sensor);
        let sigma = match of.0 {
            ParameterKind::Scale => typical.scale * scale,
            ParameterKind::Bias | ParameterKind::BiasAndGravity => typical.bias * scale,
            ParameterKind::Misalignment
            | ParameterKind::NonOrthogonality
            | ParameterKind::Inverse => typical.angle,
        };
        VariancePrior {
            dof: self.dof(),
            variance: sigma * sigma,
        }
    }
}
