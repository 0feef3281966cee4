//! RIG.toml: a unit, its converter, and the table or person that moves it, format "mimu-rig/1".
//!
//! Everything is optional. [`RigTruth::resolve`] draws the values that are not given from a seed, within the tolerances of the data sheets. Its
//! result is again such a file, with nothing left to draw: it is the truth of a recording, and reproduces it.
//!
//! "raw" in a key is V or counts, "si" is rad/s for gyros and m/s² for accelerometers.

mod check;
mod curves;
mod effect;
mod lines;
mod resolve;
mod triad;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::converter::RawUnit;
use crate::field::FieldTruth;
use crate::flaws::FlawsTruth;
use crate::hands::HandsTruth;
use crate::history::History;
use crate::located::Source;
use crate::rotation::Vector;
use crate::table::TableTruth;
use crate::unit::TemperatureSensor;

pub use curves::{AccelCurvesFile, CurvesFile, GyroCurvesFile};
pub use resolve::RigTruth;
pub use triad::TriadFile;

/// Required value of the key `format`.
pub const FORMAT: &str = "mimu-rig/1";

/// A rig file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigFile {
    /// "mimu-rig/1".
    pub format: String,
    /// Whether the Earth turns. Default: it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub earth_rate: Option<bool>,
    /// Number of effects in addition to the given ones, drawn by the seed from all effects. The truth contains the drawn effects instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub draw_effects: Option<usize>,
    /// The sensors.
    #[serde(default)]
    pub unit: UnitFile,
    /// Heat.
    #[serde(default)]
    pub thermal: ThermalFile,
    /// The sensors over temperature.
    #[serde(default)]
    pub curves: CurvesFile,
    /// What happened to the unit before this session. The truth contains the changed unit instead.
    #[serde(default, skip_serializing_if = "History::is_empty")]
    pub history: History,
    /// The converter.
    #[serde(default)]
    pub converter: ConverterFile,
    /// The turntable, if the plan has one.
    #[serde(default)]
    pub table: TableTruth,
    /// The person, if the plan has one.
    #[serde(default)]
    pub hands: HandsTruth,
    /// Flaws of the recording.
    #[serde(default)]
    pub flaws: FlawsTruth,
    /// The magnetic field, for magnetometers. The truth contains it if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<FieldTruth>,
    /// Triads beyond the first gyro and accelerometer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub triad: Vec<TriadFile>,
    /// Effects that the affine model lacks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effect: Vec<EffectFile>,
}

/// Sensors of the catalog: one for all axes, or one for each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a sensor, or a list of three"
)]
pub enum Parts {
    /// One sensor for all three axes.
    One(String),
    /// Axes x, y, z.
    Each([String; 3]),
}

/// `[unit]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UnitFile {
    /// Default: ADXRS300.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro: Option<Parts>,
    /// Default: MMA7260QT.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel: Option<Parts>,
    /// Default: the dies if the gyros have TEMP pins (ADXRS300), otherwise the board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<TemperatureSensor>,
    /// Lag of the thermometer behind its place. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_lag_s: Option<f64>,
    /// Constant error of the reported temperature, K. Default: drawn within 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_offset_c: Option<f64>,
    /// Noise of the reported temperature, standard deviation of one sample, K. Default 0.02.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_noise_c: Option<f64>,
    /// True voltage of each gyro's reference pin, V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_reference_v: Option<[f64; 3]>,
    /// Constant error of the accelerometer's supply. Default: drawn within 5000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub supply_error_ppm: Option<f64>,
    /// Drift of the accelerometer's supply with the board's temperature. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub supply_ppm_per_c: Option<f64>,
    /// Noise of the accelerometer's supply, standard deviation of one sample. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub supply_noise_ppm: Option<f64>,
    /// Axes of the gyros.
    pub gyro_axes: AxesFile,
    /// Axes of the accelerometer.
    pub accel_axes: AxesFile,
    /// A forward model in place of the gyros' directions, sensitivities and nulls.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_affine: Option<AffineFile>,
    /// A forward model in place of the accelerometer's directions, sensitivities and nulls.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_affine: Option<AffineFile>,
}

/// `[unit.gyro_axes]`, `[unit.accel_axes]`: one number for each axis. Defaults are drawn within the data sheet's tolerances.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AxesFile {
    /// Sensitive directions, body axes, any length. Rows are axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub directions: Option<[Vector; 3]>,
    /// Sensitivity, V or counts per rad/s or m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity_raw_per_si: Option<[f64; 3]>,
    /// Output at no input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub null_raw: Option<[f64; 3]>,
    /// -3 dB of the part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_hz: Option<[f64; 3]>,
    /// -3 dB of the external filter; inf is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rc_hz: Option<f64>,
    /// Coefficient N of the Allan deviation, rad/s/√Hz or m/s²/√Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_si: Option<[f64; 3]>,
    /// Coefficient B of the Allan deviation, rad/s or m/s². The floor is 0.664 of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instability_si: Option<[f64; 3]>,
    /// Coefficient K of the Allan deviation, rad/s/√s or m/s²/√s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub walk_si: Option<[f64; 3]>,
    /// Noise of each reading after the filters, standard deviation. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white_per_sample: Option<[f64; 3]>,
    /// Lowest output.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low_raw: Option<f64>,
    /// Highest output.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub high_raw: Option<f64>,
}

/// `[unit.gyro_affine]`, `[unit.accel_affine]`: `raw = matrix · input + bias`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AffineFile {
    /// Raw per SI; rows are sensors, columns body axes.
    pub matrix: [Vector; 3],
    /// Raw.
    pub bias: Vector,
}

/// `[thermal]`: see [`crate::thermal::ThermalTruth`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThermalFile {
    /// Default: drawn from 200 to 400.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub board_lag_s: Option<f64>,
    /// Default: drawn from 3 to 8.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub die_lag_s: Option<[f64; 4]>,
    /// Default: drawn from 3 to 6.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub board_heating_c: Option<f64>,
    /// Default: from the catalog, within a fifth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub die_heating_c: Option<[f64; 4]>,
    /// Time since switch-on at the start of the recording; inf is warmed up. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_before_s: Option<f64>,
}

/// `[converter]`: see [`crate::converter::ConverterTruth`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConverterFile {
    /// Default 16.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits: Option<u32>,
    /// Nominal reference. Default 3.3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_v: Option<f64>,
    /// Constant error of the true reference. Default: drawn within 5000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_error_ppm: Option<f64>,
    /// Drift of the true reference with the board's temperature. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_ppm_per_c: Option<f64>,
    /// Noise of the true reference, standard deviation of one sample. Default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_noise_ppm: Option<f64>,
    /// Default: the largest multiple of 1/20 that keeps the gyro's highest output by its data sheet below the reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_divider: Option<f64>,
    /// Default: the same for the accelerometer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_divider: Option<f64>,
    /// Default 4.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conversions: Option<u32>,
    /// Default 1.5 (assumed).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_codes: Option<f64>,
    /// Default: false.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub take_out_reference: Option<bool>,
    /// Default: V if both kinds of sensor are analog, otherwise count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw_unit: Option<RawUnit>,
}

/// `[[effect]]`: the id, and the parameters that are not to be drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectFile {
    /// See [`crate::effects::specs`].
    pub id: String,
    /// By the keys of its kind: numbers, lists, or lists of three lists.
    #[serde(flatten)]
    pub parameters: toml::Table,
}

impl Default for RigFile {
    fn default() -> Self {
        Self {
            format: FORMAT.to_owned(),
            earth_rate: None,
            draw_effects: None,
            unit: UnitFile::default(),
            thermal: ThermalFile::default(),
            curves: CurvesFile::default(),
            history: History::default(),
            converter: ConverterFile::default(),
            table: TableTruth::default(),
            hands: HandsTruth::default(),
            flaws: FlawsTruth::default(),
            field: None,
            triad: Vec::new(),
            effect: Vec::new(),
        }
    }
}

impl RigFile {
    /// Reads and checks a file. Errors: one line with file, line, problem and remedy.
    pub fn read(path: &Path) -> Result<Self, String> {
        Self::parse(&Source::read(path)?)
    }

    /// Checks a text. Errors: as [`RigFile::read`].
    pub fn parse(source: &Source) -> Result<Self, String> {
        let file: Self = source.parse()?;
        match file.check() {
            Ok(()) => Ok(file),
            Err(bad) => {
                let lines: lines::Lines = source.parse()?;
                Err(source.error(&lines.find(&bad.path), bad.problem, bad.remedy))
            }
        }
    }

    /// The file as text.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("numbers, texts and lists only")
    }
}
