//! Sensors by their data sheets: `catalog/*.toml`, with typical values and the tolerances within which a seed draws.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::converter::RawUnit;

/// What a sensor measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MeasuredQuantity {
    /// Angular rate; the catalog's input unit is deg/s.
    Gyro,
    /// Specific force; the catalog's input unit is g.
    Accel,
    /// Magnetic field, µT everywhere.
    Mag,
}

impl MeasuredQuantity {
    /// The unit of its input in models (rad/s, m/s², µT) in one input unit of the catalog.
    pub fn si(self) -> f64 {
        match self {
            Self::Gyro => crate::effects::DPS,
            Self::Accel => crate::effects::G,
            Self::Mag => 1.0,
        }
    }

    /// The unit of its input in models.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Gyro => "rad/s",
            Self::Accel => "m/s^2",
            Self::Mag => "uT",
        }
    }

    /// The triad relative to which a further one of its kind is described.
    pub fn reference(self) -> &'static str {
        match self {
            Self::Gyro | Self::Mag => "gyro",
            Self::Accel => "accel",
        }
    }
}

/// One type of sensor. "raw" is V or counts, "input" is deg/s, g or µT.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Name in rig files.
    pub name: String,
    /// What it measures.
    pub kind: MeasuredQuantity,
    /// Unit of the output.
    pub output: RawUnit,
    /// Number of packages for three axes: each is rotated on the board separately.
    pub packages: u32,
    /// Output in proportion to the supply.
    pub ratiometric: bool,
    /// Raw per input.
    pub sensitivity: f64,
    /// Relative tolerance, ±.
    pub sensitivity_tolerance: f64,
    /// Raw without input.
    pub null: f64,
    /// Raw tolerance, ±.
    pub null_tolerance: f64,
    /// Lowest output, raw.
    pub low: f64,
    /// Highest output, raw.
    pub high: f64,
    /// -3 dB of the part's low-pass, per axis, Hz.
    pub bandwidth_hz: [f64; 3],
    /// -3 dB of the external filter, Hz.
    pub rc_hz: f64,
    /// One-sided noise density, input/√Hz: √2 times the coefficient N of the Allan deviation.
    pub noise_density: f64,
    /// Coefficient B, input.
    pub instability: f64,
    /// Coefficient K, input/√s.
    pub walk: f64,
    /// Standard deviation of a package's rotation on the board about each axis, degrees.
    pub misalignment_deg: f64,
    /// Sensitivity to the other axes of a package, relative, ±.
    pub cross_axis: f64,
    /// Rise of the die over the board by self-heating, K.
    pub heating_c: f64,
    /// Nominal supply, V.
    pub supply_v: f64,
    /// Reference pin, V, if there is one.
    pub reference_v: Option<f64>,
    /// Tolerance of the reference pin, V, ±.
    pub reference_tolerance_v: Option<f64>,
}

/// Sensors that a rig file can name.
pub fn sensors() -> &'static [Sensor] {
    static SENSORS: LazyLock<Vec<Sensor>> = LazyLock::new(|| {
        [
            include_str!("catalog/adxrs300.toml"),
            include_str!("catalog/mma7260qt.toml"),
            include_str!("catalog/mpu6050_gyro.toml"),
            include_str!("catalog/mpu6050_accel.toml"),
            include_str!("catalog/icm42688p_gyro.toml"),
            include_str!("catalog/icm42688p_accel.toml"),
            include_str!("catalog/msg7100d_300.toml"),
            include_str!("catalog/msg7100d_3600.toml"),
            include_str!("catalog/msa6000d_50.toml"),
            include_str!("catalog/ak8963.toml"),
        ]
        .iter()
        .map(|text| toml::from_str(text).expect("the catalog is read by a test"))
        .collect()
    });
    &SENSORS
}

/// The sensor of this kind and name.
pub fn sensor(kind: MeasuredQuantity, name: &str) -> Option<&'static Sensor> {
    sensors().iter().find(|s| s.kind == kind && s.name == name)
}
