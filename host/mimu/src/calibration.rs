//! The calibration file: TOML that a program reads and a person can apply with a pocket calculator.

pub mod apply;
pub mod bias_cubic;
pub mod body;
mod check;
pub mod comparison;
pub mod die_temperature;
mod effect;
mod next_power_on;
mod of_curves;
mod of_device;
pub mod of_fit;
mod of_sessions;
mod on_device;
mod over_temperature;
pub mod thermal_biases;
pub mod verify;

pub use next_power_on::{BetweenSessions, NextPowerOn, SessionOrigin};
pub use of_curves::{CurvesOfUnit, TriadOfCurves};
pub use of_device::DeviceCalibration;
pub(crate) use of_fit::FIGURE_DIGITS;
pub use of_sessions::Combined;
pub use on_device::compensator;
pub use over_temperature::{
    Curves, DieTable, NodeTable, OverTemperature, TemperatureNode, reference_node,
};

use std::path::Path;

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use body::BodyTriad;

use crate::effects::fitted::FittedEffect;
use crate::judgement::Judgement;
use crate::quantity::{Sensor, significant};
use crate::triad::Covariance;
use crate::warning::Warning;
use mimu_recording::{
    ClockRate, Manifest, RawUnit, Reference, Result, SensorSettings, UNNAMED, are_two_units,
    check_kind, parse_toml, read_text,
};

/// Relative difference of two ranges that are the same.
const SAME_RANGE: f64 = 0.01;
/// Program and version, as results name them.
pub const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));
/// Version of the layout of a calibration at one temperature.
const FORMAT: &str = "mimu-calibration/1";
/// Version of the layout with curves over temperature. A program that does not know curves refuses it, instead of applying the one model.
const FORMAT_OF_CURVES: &str = "mimu-calibration/2";
/// The formula that applies a triad's numbers, and its direction.
const FORMULA: &str = "x = C u + o";
const INVERSE_DIRECTION: &str = "raw to SI";

/// What a person has to know to apply a calibration by hand.
const HEADER: &str = "\
# Calibration of an inertial unit. To apply it by hand to a raw reading u = (x, y, z):
#   first axis  = C[0][0]*u_x + C[0][1]*u_y + C[0][2]*u_z + o[0],  and so on by rows.
";
const HEADER_OF_EFFECTS: &str = "\
# of a reading without the errors e of the effects below, which are added up for each sensor and are SI:
#   u_x - S_x*e_x in place of u_x, with S_x the root of the sum of squares of P[0], and so on.
";
const HEADER_OF_KEYS: &str = "\
# sigma_ is a standard deviation, interval_ half of a 95 % interval; misalignments are in the order x, y, z,
# non-orthogonalities yz, zy, zx. sha256 is that of the samples file, temp_c the mean of its dwells in degrees Celsius.
";

const HEADER_OF_CURVES: &str = "\
# [gyro] and [accel] are valid at recording.temp_c. Over temperature C and o follow the nodes of [temperature], at the temperature of the dies:
# between two nodes, h apart, with w from 0 to 1, a number p and its slope s are
#   (1+2w)(1-w)^2 p0 + w^2(3-2w) p1 + h w(1-w)^2 s0 - h w^2(1-w) s1;
# outside they continue along the slope for 5 kelvin and are constant beyond. The dies of a triad follow the thermometer with the lag_s of
# [temperature.dies].
";

const HEADER_OF_KEPT: &str = "\
# From a device or another program's file, which stores no standard deviations, no covariance and no error figures: its uncertainty is unknown.
# Numbers of a device have single precision. temp_c is the temperature at which the device lists it, in degrees Celsius.
";

const HEADER_OF_SESSIONS: &str = "\
# Made from several sessions. C and o are what is expected at the next power-on. sigma_ and interval_ are those of this expectation;
# [gyro.next_power_on] and [accel.next_power_on] have the intervals of what the next power-on makes of it: use these for tomorrow.
";

/// A calibration as a file holds it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// `mimu-calibration/1`, or `/2` if and only if there is a [temperature](Self::temperature).
    pub format: String,
    /// Unit that it is for.
    pub device: String,
    /// The unit's own number, if `mimu record` recorded it: 24 hexadecimal digits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_id: Option<String>,
    /// When it was made, RFC 3339; absent if it comes from a device that does not store this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub created: Option<String>,
    /// When its offsets were trimmed on the device, RFC 3339; everything else was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trimmed: Option<String>,
    /// Program and version that made it.
    pub tool: String,
    /// The judgement of the result that it comes from; a device does not store it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judgement: Option<Judgement>,
    /// The sensors as they were set, if `mimu record` recorded it: it is for no other range or filter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<sensors_schema::Sensors>"))]
    pub sensors: Option<SensorSettings>,
    /// The recording that it was made from.
    pub recording: Origin,
    /// How it was made, if from several sessions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between_sessions: Option<BetweenSessions>,
    /// The sessions that it was made from; empty for one. `recording` is then the last one used.
    #[serde(default, rename = "session", skip_serializing_if = "Vec::is_empty")]
    pub sessions: Vec<SessionOrigin>,
    /// Gyro triad.
    #[serde(default)]
    pub gyro: Option<TriadTable>,
    /// Accelerometer triad.
    #[serde(default)]
    pub accel: Option<TriadTable>,
    /// The models over temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<OverTemperature>,
    /// Errors that the affine models lack.
    #[serde(default, rename = "effect", skip_serializing_if = "Vec::is_empty")]
    effects: Vec<FittedEffect>,
    /// The triads of its body beyond these two.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<BodyTriad>,
}

/// What the schema says of [`SensorSettings`] and of [`ClockRate`].
#[cfg(feature = "schema")]
mod sensors_schema {
    /// Rate of a board's clock relative to the computer's.
    #[derive(schemars::JsonSchema)]
    #[schemars(deny_unknown_fields)]
    #[expect(dead_code, reason = "for the schema only")]
    pub struct Clock {
        /// The ratio: above 1 the board's clock is fast.
        factor: f64,
        /// Half-width of its 95 % interval.
        half_width: f64,
        /// Time over which they were compared, s.
        over_s: f64,
        /// The clock that the calibration's time follows.
        #[schemars(extend("enum" = ["board", "computer", "trusted"]))]
        times: String,
    }

    /// The sensors of a unit as they were set.
    #[derive(schemars::JsonSchema)]
    #[schemars(deny_unknown_fields)]
    #[expect(dead_code, reason = "for the schema only")]
    pub struct Sensors {
        /// The gyros.
        gyro: Sensor,
        /// The accelerometers.
        accel: Sensor,
    }

    /// The sensors of a triad as they were set.
    #[derive(schemars::JsonSchema)]
    #[schemars(deny_unknown_fields)]
    #[expect(dead_code, reason = "for the schema only")]
    pub struct Sensor {
        /// Name of the part.
        part: String,
        /// Bits of a reading, with its sign.
        bits: u8,
        /// Largest input, rad/s or m/s².
        range: f64,
        /// Filters and rate.
        filter: String,
    }
}

/// The recording that a calibration was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// SHA-256 of its samples file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// The known part of its input; a device does not store it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<String>"))]
    pub reference: Option<Reference>,
    /// Unit of its raw columns.
    #[cfg_attr(feature = "schema", schemars(with = "String", extend("enum" = ["V", "count", "SI"])))]
    pub raw_unit: RawUnit,
    /// Local gravity, m/s²; a device does not store it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity_mps2: Option<f64>,
    /// How fast the clock of the times runs, if it was compared with a better one; a device does not store it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "Option<sensors_schema::Clock>"))]
    pub clock: Option<ClockRate>,
    /// Mean temperature of the dwells, °C, if known.
    #[serde(default)]
    pub temp_c: Option<f64>,
    /// Temperatures of the coldest and of the warmest of them, °C, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temp_range_c: Option<[f64; 2]>,
}

/// One triad in a calibration file. Standard deviations, intervals, covariance and error figures are all present or all absent. They are absent in a
/// calibration that was fetched from a device, which stores none.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)] // C, P: the letters of the formulas, in the file as in the papers
pub struct TriadTable {
    /// `x = C u + o`.
    pub formula: String,
    /// `raw to SI`.
    pub direction: String,
    /// Unit of u.
    #[cfg_attr(feature = "schema", schemars(with = "String", extend("enum" = ["V", "count", "SI"])))]
    pub raw_unit: RawUnit,
    /// Unit of x.
    pub unit: String,
    /// Axes that x is given in.
    pub frame: String,
    /// SI per raw unit, by rows.
    pub C: [[f64; 3]; 3],
    /// SI.
    pub o: [f64; 3],
    /// How firmware removes the bias before the reading is recorded. `o` and the biases are then those of such readings, and not of the sensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias_removed: Option<String>,
    /// Standard deviations of C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_C: Option<[[f64; 3]; 3]>,
    /// Standard deviations of o.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_o: Option<[f64; 3]>,
    /// Halves of the 95 % intervals of C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_C: Option<[[f64; 3]; 3]>,
    /// Halves of the 95 % intervals of o.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_o: Option<[f64; 3]>,
    /// Order of the covariance.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<String>,
    /// 12x12.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub covariance: Vec<Vec<f64>>,
    /// The part of the covariance that noise and stated errors alone give, 12x12; absent if that is all of it. The rest is by scatter beyond the noise: it
    /// widens the intervals, and excuses no error.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub covariance_by_noise: Vec<Vec<f64>>,
    /// Error figures of its fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judged: Option<Judged>,
    /// The uncertainty at the next power-on, if several sessions show it. That of the entries above is that of the expected values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next_power_on: Option<NextPowerOn>,
    /// The same calibration in the other direction.
    pub forward: ForwardTable,
    /// The same calibration as physical quantities.
    pub physical: PhysicalTable,
}

impl TriadTable {
    /// Half-width of the 95 % intervals in standard deviations: with few dwells it exceeds 1.96. The file gives both.
    pub fn interval_sigmas(&self) -> f64 {
        let ratio = self.interval_o.zip(self.sigma_o).map(|(i, s)| i[0] / s[0]);
        ratio.filter(|k| k.is_finite()).unwrap_or(1.96)
    }
}

/// Error figures of the fit.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Judged {
    /// How it was estimated.
    pub estimator: String,
    /// The quantity that the figures describe.
    pub figure: String,
    /// Unit of the figures.
    pub unit: String,
    /// Rms error in sample.
    pub rms: f64,
    /// Rms error held out.
    #[serde(default)]
    pub held_out_rms: Option<f64>,
    /// Rms error by noise alone; absent if the noise is unknown.
    #[serde(default)]
    pub noise_floor: Option<f64>,
    /// Dwells used.
    pub dwells: usize,
    /// Condition of the experiment.
    pub condition: f64,
}

/// Forward model, SI to raw.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
pub struct ForwardTable {
    /// `u = P x + b`.
    pub formula: String,
    /// `SI to raw`.
    pub direction: String,
    /// Raw per SI, by rows.
    pub P: [[f64; 3]; 3],
    /// Raw.
    pub b: [f64; 3],
}

/// Physical quantities with their standard deviations.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PhysicalTable {
    /// Formula of `P`.
    pub formula: String,
    /// Raw per SI.
    pub scale_factor: [f64; 3],
    /// Standard deviations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_scale_factor: Option<[f64; 3]>,
    /// Raw.
    pub bias: [f64; 3],
    /// Standard deviations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_bias: Option<[f64; 3]>,
    /// θx, θy, θz, degrees.
    pub misalignment_deg: [f64; 3],
    /// Standard deviations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_misalignment_deg: Option<[f64; 3]>,
    /// βyz, βzy, βzx, degrees.
    pub non_orthogonality_deg: [f64; 3],
    /// Standard deviations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_non_orthogonality_deg: Option<[f64; 3]>,
}

impl Origin {
    /// Of readings in this unit, and nothing else known.
    fn of(raw_unit: RawUnit) -> Self {
        Self {
            sha256: None,
            reference: None,
            raw_unit,
            gravity_mps2: None,
            clock: None,
            temp_c: None,
            temp_range_c: None,
        }
    }
}

impl Calibration {
    /// A calibration of no triad yet.
    fn empty(device: &str, recording: Origin) -> Self {
        Self {
            format: FORMAT.into(),
            device: device.to_owned(),
            unit_id: None,
            created: None,
            trimmed: None,
            between_sessions: None,
            sessions: Vec::new(),
            tool: TOOL.into(),
            judgement: None,
            sensors: None,
            recording,
            gyro: None,
            accel: None,
            temperature: None,
            effects: Vec::new(),
            body: Vec::new(),
        }
    }

    /// Reads and checks a calibration file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Parses and checks the text of a calibration file; `place` is its path. A file of [biases alone](thermal_biases) is refused by its name.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        if thermal_biases::is_one(text) {
            return Err(thermal_biases::refusal(place));
        }
        check_kind(text, place, "mimu-calibration")?;
        let calibration: Self = parse_toml(text, place, Some("fit the recording again"))?;
        calibration.checked(place)
    }

    /// Text of the file, for programs and for people.
    pub fn to_toml(&self) -> String {
        let effects = match self.effects.is_empty() {
            true => "",
            false => HEADER_OF_EFFECTS,
        };
        let keys = match self.is_uncertain() {
            true => HEADER_OF_KEYS,
            false => HEADER_OF_KEPT,
        };
        let curves = match self.temperature {
            None => "",
            Some(_) => HEADER_OF_CURVES,
        };
        let sessions = match self.between_sessions {
            None => "",
            Some(_) => HEADER_OF_SESSIONS,
        };
        let header = format!("{HEADER}{effects}{curves}{keys}{sessions}");
        crate::toml_layout::to_toml(&header, self)
    }

    /// The errors that the affine models lack.
    pub fn effects(&self) -> &[FittedEffect] {
        &self.effects
    }

    /// Ids of the effects of `sensor`. Its C and o were fitted together with them, and are right only with them.
    pub fn effects_of(&self, sensor: Sensor) -> Vec<String> {
        let own = self.effects.iter().filter(|e| e.sensor() == sensor);
        own.map(FittedEffect::id).collect()
    }

    /// The table of `sensor`.
    pub fn table(&self, sensor: Sensor) -> Option<&TriadTable> {
        sensor.pick(self.gyro.as_ref(), self.accel.as_ref())
    }

    /// Whether it contains standard deviations. One that was fetched from a device does not.
    pub fn is_uncertain(&self) -> bool {
        let mut tables = [&self.gyro, &self.accel].into_iter().flatten();
        tables.all(|table| table.sigma_C.is_some())
    }

    /// A warning if it belongs to another unit than the recording. Numbers are compared if both have one, otherwise names.
    pub fn other_unit(&self, manifest: &Manifest) -> Option<Warning> {
        let (ours, theirs) = (self.device.clone(), manifest.device.clone());
        match (&self.unit_id, manifest.unit_id()) {
            (Some(ours), Some(theirs)) => {
                (!ours.eq_ignore_ascii_case(theirs)).then(|| Warning::OtherUnit {
                    calibration: ours.clone(),
                    recording: theirs.into(),
                })
            }
            _ => are_two_units(&ours, &theirs).then_some(Warning::OtherDevice {
                calibration: ours,
                recording: theirs,
            }),
        }
    }

    /// The sensor that was set otherwise when the calibration was made, in words: `its gyro had a range of 17.45 rad/s`. `None` if none was, or if
    /// one of the two is unknown.
    pub fn other_setting(&self, now: Option<&SensorSettings>) -> Option<String> {
        let (ours, now) = self.sensors.as_ref().zip(now)?;
        let pairs = [
            (Sensor::Gyro, &ours.gyro, &now.gyro),
            (Sensor::Accel, &ours.accel, &now.accel),
        ];
        pairs.into_iter().find_map(|(sensor, ours, now)| {
            let unit = sensor.unit().replace("^2", "²");
            let differs = |what: &str, a: String, b: String| {
                format!("it was made with the {sensor} at {what} {a}, but it is {b} now")
            };
            if ours.part != now.part {
                let problem = "it was made with another part as the";
                return Some(format!(
                    "{problem} {sensor}: {}, not {}",
                    ours.part, now.part
                ));
            }
            // A device stores it in single precision, and a person writes three digits; ranges of a part are twice apart.
            if (ours.range / now.range - 1.0).abs() > SAME_RANGE {
                let of = |range: f64| format!("{} {unit}", significant(range));
                return Some(differs("a range of", of(ours.range), of(now.range)));
            }
            if ours.bits != now.bits {
                let [a, b] = [ours.bits, now.bits].map(|bits| format!("{bits} bits"));
                return Some(differs("a reading of", a, b));
            }
            (ours.filter != now.filter).then(|| {
                let [a, b] = [ours, now].map(|of| format!("{:?}", of.filter));
                differs("the filter", a, b)
            })
        })
    }

    /// A note if only a person knows that it belongs to the unit of the recording, because one of the two names no unit.
    pub fn unnamed_unit(&self, manifest: &Manifest) -> Option<Warning> {
        let numbered = self.unit_id.is_some() && manifest.unit_id().is_some();
        let unnamed = [&self.device, &manifest.device].map(|name| name == UNNAMED);
        (!numbered && unnamed != [false; 2]).then_some(Warning::UnnamedUnit { unnamed })
    }

    /// Covariance of the inverse model of `sensor`: C by rows, then o. `None` if [it is not known](Self::is_uncertain).
    pub fn covariance(&self, sensor: Sensor) -> Option<Covariance> {
        let table = self.table(sensor).filter(|t| !t.covariance.is_empty())?;
        Some(Covariance::from_fn(|i, j| table.covariance[i][j]))
    }

    /// What noise and stated errors alone give of [`Self::covariance`]; at the next power-on, if several sessions show what that changes. Zero if nothing is
    /// known.
    pub fn known_covariance(&self, sensor: Sensor) -> Covariance {
        let by_noise = self.table(sensor).map(|table| &table.covariance_by_noise);
        let by_noise = by_noise.filter(|rows| !rows.is_empty());
        let by_noise = by_noise.map(|rows| Covariance::from_fn(|i, j| rows[i][j]));
        let next = self.next_power_on(sensor).map(|next| next.0);
        let known = next.or(by_noise).or_else(|| self.covariance(sensor));
        known.unwrap_or_else(Covariance::zeros)
    }

    /// The inverse model of `sensor`.
    pub fn inverse(&self, sensor: Sensor) -> Option<Affine<f64>> {
        let table = self.table(sensor)?;
        Some(Affine {
            matrix: Matrix3::from_fn(|i, j| table.C[i][j]),
            offset: Vector3::from(table.o),
        })
    }

    /// The inverse models over temperature, to be evaluated many times; `None` if there is one for all temperatures.
    pub fn curves(&self) -> Option<Curves> {
        Curves::of(self)
    }

    /// The temperatures for which it is valid, °C, as the device takes them; `None` if they are not known.
    pub fn limits(&self) -> Option<[f64; 2]> {
        match self.curves() {
            Some(curves) => curves.table().limits(),
            None => self.recording.temp_range_c,
        }
    }

    /// The inverse model of `sensor` at a temperature of the dies, °C, raw to SI. Between nodes it follows cubic Hermite polynomials; outside it
    /// continues along the end slope for 5 K and is constant beyond. Without nodes it is that of all temperatures.
    pub fn inverse_at(&self, sensor: Sensor, die_temp_c: f64) -> Option<Affine<f64>> {
        match self.curves() {
            Some(curves) => curves.inverse(sensor, die_temp_c),
            None => self.inverse(sensor),
        }
    }

    /// `format` of a calibration file with curves or without.
    pub fn format_of(curves: bool) -> &'static str {
        if curves { FORMAT_OF_CURVES } else { FORMAT }
    }
}
