//! Limits: the file of a product, limits of a data sheet, and those that belong to the measurement itself.

use std::path::Path;

use mimu::data_sheet::{Part, Property};
use mimu::{STANDARD_GRAVITY, Sensor};
use mimu_recording::{Error, RawUnit, Result, check_kind, parse_toml, read_text};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::decision::{Decision, Rule};
use crate::measured::Measured;
use crate::own_limit::OwnLimit;
use crate::population::Population;
use crate::quantities::Quantities;
use crate::quantity::{Quantity, without_axis};
use crate::scale::{Ranges, Scale};
use crate::side::direction;

/// Version of the file.
const FORMAT: &str = "mimu-limits/1";
/// Factor on limits that a data sheet calls typical: half of good units may exceed a typical value.
const TYPICAL: f64 = 2.0;
/// Most samples that may be lost unless a file says otherwise, %.
const MOST_LOST: f64 = 1.0;
/// Temperatures, °C, at which parts of the industrial grade are used.
const TEMPERATURES_C: [f64; 2] = [-40.0, 85.0];

/// A row of the file. At least one of the limits is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitRow {
    /// Name of a quantity, `gyro_x_offset`, or without its axis for all three, `gyro_offset`.
    pub name: String,
    /// Smallest value that passes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower: Option<f64>,
    /// Largest value that passes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper: Option<f64>,
    /// Unit of both.
    pub unit: String,
}

/// How far offsets wander between two measurements of a unit, one standard deviation: flicker noise and temperature, which ten seconds do not show.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wander {
    /// Of the gyro, deg/s.
    #[serde(default)]
    pub gyro_dps: f64,
    /// Of the accelerometer, mg.
    #[serde(default)]
    pub accel_mg: f64,
}

impl Wander {
    /// `measured` with this uncertainty, if it is an offset or contains one.
    pub fn apply(&self, measured: Measured) -> Measured {
        match Quantity::find(&measured.name) {
            Some(Quantity::GyroOffset) => measured.with_common(self.gyro_dps),
            Some(Quantity::AccelOffset | Quantity::GravityError) => {
                measured.with_common(self.accel_mg)
            }
            _ => measured,
        }
    }
}

/// The file of a product's limits.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// `mimu-limits/1`.
    pub format: String,
    /// Name of the product.
    #[serde(default)]
    pub product: Option<String>,
    /// Part whose data sheet limits the quantities that no row names.
    #[serde(default)]
    pub part: Option<String>,
    /// Ranges that the sensors are set to.
    #[serde(default)]
    pub ranges: Option<Ranges>,
    /// Side that has to be up, such as `+z`: limits of `tilt` are about it.
    #[serde(default)]
    pub up: Option<String>,
    /// Which values pass.
    #[serde(default)]
    pub decision: Rule,
    /// Width of the guard band, standard uncertainties.
    #[serde(default)]
    pub k: Option<f64>,
    /// Factor on limits that the data sheet calls typical.
    #[serde(default)]
    pub typical_factor: Option<f64>,
    /// How far offsets wander between two measurements.
    #[serde(default)]
    pub wander: Wander,
    /// The limits.
    #[serde(default)]
    pub rows: Vec<LimitRow>,
    /// Units of the same kind, which limit what no row names.
    #[serde(skip)]
    pub population: Option<Population>,
    /// Path of the file.
    #[serde(skip)]
    pub place: String,
}

impl Limits {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, has another format, or names a quantity or a unit that does not exist.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&read_text(path)?, &path.display().to_string())
    }

    /// Parses and checks the text of a file; `place` is its path.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        check_kind(text, place, "mimu-limits")?;
        let mut limits: Self = parse_toml(text, place, None)?;
        place.clone_into(&mut limits.place);
        limits.check()?;
        Ok(limits)
    }

    fn check(&self) -> Result<()> {
        let wrong = |what: &str, problem: String, remedy: String| {
            Err(Error::new(
                format!("{}, {what}", self.place),
                problem,
                remedy,
            ))
        };
        if self.format != FORMAT {
            let problem = format!("it is {:?}, and this program reads {FORMAT:?}", self.format);
            return wrong(
                "format",
                problem,
                "use the version of mimu that it was written for".into(),
            );
        }
        if let Some(up) = self.up.as_ref().filter(|up| direction(up).is_none()) {
            return wrong(
                "up",
                format!("{up:?} is no side"),
                "write +x, -x, +y, -y, +z or -z".into(),
            );
        }
        for (name, value) in [("k", self.k), ("typical_factor", self.typical_factor)] {
            if let Some(value) = value.filter(|v| !(0.0..=100.0).contains(v)) {
                return wrong(
                    name,
                    format!("{value} is out of range"),
                    "write a number from 0 to 100".into(),
                );
            }
        }
        let Wander { gyro_dps, accel_mg } = self.wander;
        if ![gyro_dps, accel_mg].iter().all(|w| (0.0..1e3).contains(w)) {
            return wrong(
                "wander",
                "it is out of range".into(),
                "write gyro_dps and accel_mg, from 0 to 1000".into(),
            );
        }
        for (k, row) in (1..).zip(&self.rows) {
            let what = format!("row {k}, {}", row.name);
            let self_test = row.name.starts_with("self_test_");
            let Some(unit) = Quantity::find(&row.name).map(Quantity::unit) else {
                if self_test {
                    continue;
                }
                let names: Vec<&str> = Quantity::all().map(Quantity::without_axis).collect();
                let remedy = format!(
                    "use one of {}, with the axis after the sensor for one axis (gyro_x_offset), or self_test_ and a name",
                    names.join(", ")
                );
                return wrong(&what, "no quantity has this name".into(), remedy);
            };
            if row.unit != unit {
                let problem = format!("its unit is {:?}, and the quantity is in {unit}", row.unit);
                return wrong(
                    &what,
                    problem,
                    format!("convert the limits and write unit = {unit:?}"),
                );
            }
            let order = [row.lower, row.upper]
                .iter()
                .flatten()
                .all(|v| v.is_finite());
            let crossed = row.lower.zip(row.upper).is_some_and(|(l, u)| l > u);
            if !order || crossed || row.lower.or(row.upper).is_none() {
                let problem = "it needs lower, upper or both, and lower below upper".into();
                return wrong(&what, problem, "correct the row".into());
            }
        }
        Ok(())
    }

    /// The decision by these limits.
    pub fn decision(&self) -> Decision {
        match self.decision {
            Rule::Simple => Decision::SIMPLE,
            rule => Decision {
                rule,
                k: self.k.unwrap_or(Decision::default().k),
            },
        }
    }

    /// The limits of what was measured, by name, with their source: those of the measurement itself, then those of `part`, then those of the population,
    /// then the rows of the file.
    ///
    /// # Errors
    /// The population reads in another unit.
    pub fn of(
        &self,
        found: &Quantities,
        part: Option<&Part>,
        scale: &Scale,
        raw_unit: RawUnit,
    ) -> Result<Vec<OwnLimit>> {
        let mut all = built_in();
        all.extend(found.own_limits.iter().cloned());
        if let Some(part) = part {
            let force = found.force.map(|[force, _]| force);
            let factor = self.typical_factor.unwrap_or(TYPICAL);
            all.extend(of_part(part, force.as_ref(), scale, factor));
        }
        if let Some(population) = &self.population {
            all.extend(population.limits(scale, raw_unit)?);
        }
        // On another side the unit is 90 degrees off, whatever the rows allow.
        all.extend(self.up.as_ref().map(|up| OwnLimit {
            name: Quantity::Tilt.name(None),
            lower: None,
            upper: Some(45.0),
            source: format!("{}, up = {up:?}", self.place),
        }));
        all.extend(self.rows.iter().map(|row| OwnLimit {
            name: row.name.clone(),
            lower: row.lower,
            upper: row.upper,
            source: self.place.clone(),
        }));
        Ok(all)
    }

    /// Rows of the file for which nothing was measured.
    pub fn not_met(&self, names: &[&str]) -> Vec<&LimitRow> {
        let measured = |row: &&LimitRow| !names.iter().any(|name| is_for(&row.name, name));
        self.rows.iter().filter(measured).collect()
    }
}

/// Whether limits of `name` are for the quantity `of`.
pub fn is_for(name: &str, of: &str) -> bool {
    name == of || without_axis(of).is_some_and(|all| all == name)
}

/// Limits that hold unless a file says otherwise.
fn built_in() -> Vec<OwnLimit> {
    let limit = |of: Quantity, lower, upper| OwnLimit {
        name: of.without_axis().into(),
        lower,
        upper,
        source: "built in".into(),
    };
    let [coldest, warmest] = TEMPERATURES_C;
    vec![
        limit(Quantity::GyroBits, None, Some(0.0)),
        limit(Quantity::AccelBits, None, Some(0.0)),
        limit(Quantity::LostSamples, None, Some(MOST_LOST)),
        limit(Quantity::Temperature, Some(coldest), Some(warmest)),
    ]
}

/// Limits of a data sheet. `typical`: factor on those that it calls typical.
fn of_part(
    part: &Part,
    force: Option<&Vector3<f64>>,
    scale: &Scale,
    typical: f64,
) -> Vec<OwnLimit> {
    let mut all = Vec::new();
    for sensor in Sensor::BOTH {
        let own = part.sensor(sensor).map_or(&[][..], |own| &own.limits);
        let full_scale = scale.full_scale[sensor as usize];
        for limit in own {
            let (of, lower) = match (limit.quantity, sensor) {
                (Property::Offset, Sensor::Gyro) => (Quantity::GyroOffset, true),
                (Property::Offset, Sensor::Accel) => (Quantity::AccelOffset, true),
                (Property::Sensitivity, Sensor::Accel) => (Quantity::AccelSensitivity, true),
                (Property::NoiseDensity, Sensor::Gyro) => (Quantity::GyroDensity, false),
                (Property::NoiseDensity, Sensor::Accel) => (Quantity::AccelDensity, false),
                _ => continue,
            };
            let (factor, words) = match limit.typical {
                true => (typical, format!(", {typical} times the typical value")),
                false => (1.0, String::new()),
            };
            for axis in (0..3).filter(|axis| limit.is_for(*axis, full_scale)) {
                let at_most = factor * limit.at_most;
                all.push(OwnLimit {
                    name: of.name(Some(axis)),
                    lower: lower.then_some(-at_most),
                    upper: Some(at_most),
                    source: format!("{}, {}{words}", part.name, limit.source),
                });
            }
        }
    }
    all.extend(force.and_then(|force| gravity_of(part, force, scale, typical)));
    all
}

/// Limits of the magnitude of gravity: what offsets and sensitivity of a data sheet allow together in this pose.
fn gravity_of(part: &Part, force: &Vector3<f64>, scale: &Scale, typical: f64) -> Option<OwnLimit> {
    let own = part.sensor(Sensor::Accel)?;
    let full_scale = scale.full_scale[Sensor::Accel as usize];
    let allowed = |of: Property, axis: usize| {
        let limit = own.limits.iter();
        let mut limit = limit.filter(|l| l.quantity == of && l.is_for(axis, full_scale));
        let limit = limit.next()?;
        Some(limit.at_most * if limit.typical { typical } else { 1.0 })
    };
    let up = force.normalize();
    let mut mg = 0.0;
    for axis in 0..3 {
        mg += up[axis].abs() * allowed(Property::Offset, axis)?;
        // A part whose data sheet states no sensitivity has no limit here.
        let percent = allowed(Property::Sensitivity, axis)?;
        mg += up[axis].powi(2) * 0.01 * percent * 1e3 * force.norm() / STANDARD_GRAVITY;
    }
    Some(OwnLimit {
        name: Quantity::GravityError.name(None),
        lower: Some(-mg),
        upper: Some(mg),
        source: format!(
            "{}, offset and sensitivity together in this pose",
            part.name
        ),
    })
}
