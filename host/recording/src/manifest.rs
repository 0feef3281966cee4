//! `recording.toml`: what is known about a recording beside its samples.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::clock::{ClockRate, Times};
use super::declared::{Rails, RawUnit, Reference, WholeTurns};
use super::recorded::{Recorded, SensorSettings};
use super::reference_error::ReferenceError;
use super::turntable::Turntable;
use crate::error::{Argument, Error, Result};
use crate::toml_file::{check_kind, parse_toml, read_text};

/// Name of the manifest in a recording's directory.
pub const MANIFEST_FILE: &str = "recording.toml";

/// Gravity on the Earth's surface with room to spare: 9.764 (Huascarán) to 9.834 (poles) m/s².
const GRAVITY_RANGE: std::ops::RangeInclusive<f64> = 9.7..=9.9;

/// Sample rates in Hz; no inertial sensor is slower or faster.
const RATE_RANGE: std::ops::RangeInclusive<f64> = 0.01..=1e7;

/// Version of the layout of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Format {
    /// The only one so far.
    #[default]
    #[serde(rename = "mimu-recording/1")]
    V1,
}

/// A file that the recording was imported from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Name, without its folder.
    pub file: String,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
}

/// Option of an import that uses readings although they look wrong.
pub(crate) const TRUST_READINGS: &str = "--trust-readings";

/// Contents of `recording.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the layout.
    pub format: Format,
    /// Unit that was recorded; [`UNNAMED`](crate::UNNAMED) if nobody has named it.
    pub device: String,
    /// Nominal sample rate in Hz. Only means may lack it; it is NaN then.
    #[serde(default = "unknown", skip_serializing_if = "is_unknown")]
    pub sample_rate_hz: f64,
    /// Local gravity in m/s².
    pub gravity_mps2: f64,
    /// Unit of the raw columns.
    pub raw_unit: RawUnit,
    /// Latitude in degrees, north positive: estimates subtract the Earth's rate from a gyro's input. The known rates are those against the ground.
    pub latitude_deg: Option<f64>,
    /// What is known of the true input.
    pub reference: Reference,
    /// Time of the power-on, on the clock of `t_s`, s. Effects that depend on the time since power-on count from it; without it, from the first
    /// sample.
    pub power_on_s: Option<f64>,
    /// Whether the recording was not finished: its program was killed, or is still recording. A cut last row is then left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub unfinished: bool,
    /// Whether there are means instead of samples, one row for each pose: only a fit and a verification can use them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub means: bool,
    /// Text label of step i, if the source named its steps.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub step_labels: Vec<String>,
    /// Steps that are turns by a known angle: only their mean rate is known, and the unit is not at rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub turn_steps: Vec<i32>,
    /// Steps that were repeated and do not count: their rows are treated like those between dwells.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dropped_steps: Vec<i32>,
    /// Arguments of the import that made the recording, with file names instead of paths.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub imported_with: Vec<String>,
    /// The device from which it was recorded.
    pub recorded: Option<Recorded>,
    /// How fast the clock of the times runs, if it was compared with a better one.
    pub clock: Option<ClockRate>,
    /// Where readings saturate.
    pub rails: Option<Rails>,
    /// What is stated of turns by hand that end where they began.
    pub whole_turns: Option<WholeTurns>,
    /// The known rates, if the reference is the magnitude of the rate.
    pub turntable: Option<Turntable>,
    /// How well the reference is known, if that is stated.
    pub reference_error: Option<ReferenceError>,
    /// Files from which it was imported.
    #[serde(default, rename = "source", skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<Source>,
}

fn unknown() -> f64 {
    f64::NAN
}

fn is_unknown(number: &f64) -> bool {
    number.is_nan()
}

impl Manifest {
    /// Converts its times and its rate from the board's clock to the computer's. Returns the ratio by which `t_s` has to be divided, if they are not the
    /// same.
    pub fn by_computer(&mut self) -> Option<f64> {
        let clock = self.clock.as_mut().filter(|c| c.times == Times::Board)?;
        clock.times = Times::Computer;
        let factor = clock.factor;
        self.sample_rate_hz *= factor;
        let restarts = self.recorded.iter_mut().flat_map(|r| &mut r.restarts);
        let times = restarts.map(|restart| &mut restart.t_s);
        times.chain(&mut self.power_on_s).for_each(|t| *t /= factor);
        Some(factor)
    }

    /// Why the device had started, if it was not by a power-on and `power_on_s` is not given. The time since power-on is then unknown: it did not
    /// begin at the first sample.
    pub fn start_without_power_on(&self) -> Option<&str> {
        let start = self.recorded.as_ref()?.start.as_deref()?;
        self.power_on_s.is_none().then_some(start)
    }

    /// Number of the unit, if it has one; an emulated unit has the number 0.
    pub fn unit_id(&self) -> Option<&str> {
        let recorded = self.recorded.as_ref()?;
        Some(recorded.unit_id.as_str()).filter(|id| id.bytes().any(|digit| digit != b'0'))
    }

    /// The sensors as they were set, if the recording has them.
    pub fn sensors(&self) -> Option<&SensorSettings> {
        self.recorded.as_ref()?.sensors.as_ref()
    }

    /// Whether an import computed the sample rate from the time stamps, and nobody gave it.
    pub fn has_rate_of_stamps(&self) -> bool {
        let given = self.imported_with.iter().any(|a| a == "--rate-hz");
        !self.imported_with.is_empty() && !given
    }

    /// Whether readings that look wrong are used, because a person said that they are right.
    pub fn trusts_readings(&self) -> bool {
        self.imported_with.iter().any(|a| a == TRUST_READINGS)
    }

    /// Whether it was joined from files that follow one another, one step each.
    pub fn is_joined(&self) -> bool {
        let by = ["--sequence", "--faces"];
        self.imported_with.iter().any(|a| by.contains(&a.as_str()))
    }

    /// Name of a step: its label, or its number.
    pub fn step_name(&self, step: i32) -> String {
        let label = usize::try_from(step)
            .ok()
            .and_then(|i| self.step_labels.get(i));
        label.cloned().unwrap_or_else(|| step.to_string())
    }

    /// Manifest with the keys that have no default; the others are empty.
    pub fn new(
        device: impl Into<String>,
        sample_rate_hz: f64,
        gravity_mps2: f64,
        raw_unit: RawUnit,
        reference: Reference,
    ) -> Self {
        Self {
            format: Format::V1,
            device: device.into(),
            sample_rate_hz,
            gravity_mps2,
            raw_unit,
            latitude_deg: None,
            reference,
            power_on_s: None,
            unfinished: false,
            means: false,
            step_labels: Vec::new(),
            turn_steps: Vec::new(),
            dropped_steps: Vec::new(),
            imported_with: Vec::new(),
            recorded: None,
            clock: None,
            rails: None,
            whole_turns: None,
            turntable: None,
            reference_error: None,
            sources: Vec::new(),
        }
    }

    /// Reads and checks `recording.toml` at `path`.
    pub fn read(path: &Path) -> Result<Manifest> {
        let text = read_text(path)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Parses and checks the text of a manifest; `place` is its file.
    pub fn parse(text: &str, place: &str) -> Result<Manifest> {
        check_kind(text, place, "mimu-recording")?;
        let manifest: Manifest = parse_toml(text, place, None)?;
        manifest.check(place)?;
        Ok(manifest)
    }

    /// Checks the values; `place` is their file.
    pub fn check(&self, place: &str) -> Result<()> {
        let at = |key: &str| format!("{place}, {key}");
        match (self.sample_rate_hz.is_nan(), self.means) {
            (true, true) => {}
            (true, false) if place.ends_with(MANIFEST_FILE) => {
                let problem = "missing field `sample_rate_hz`";
                return Err(Error::new(place, problem, "add the key"));
            }
            _ => check_rate(self.sample_rate_hz, &at("sample_rate_hz"))?,
        }
        check_gravity(self.gravity_mps2, &at("gravity_mps2"))?;
        if let Some(latitude) = self.latitude_deg
            && !(-90.0..=90.0).contains(&latitude)
        {
            return Err(Error::new(
                at("latitude_deg"),
                format!("{latitude} is not a latitude"),
                "write degrees from -90 to 90, north positive",
            ));
        }
        if let Some(power) = self.power_on_s
            && !power.is_finite()
        {
            return Err(Error::new(
                at("power_on_s"),
                format!("{power} is not a time"),
                "write the t_s of the power-on, or remove the key",
            ));
        }
        match (self.reference, &self.turntable) {
            (Reference::TurntableRate, None) => {
                let problem = "reference is \"turntable-rate\", but no rate is given";
                let remedy = "give it in deg/s: 200 for 33 1/3 rpm, 270 for 45 rpm";
                return Err(
                    Error::new(at("turntable"), problem, remedy).about(Argument::TurntableRates)
                );
            }
            (Reference::TurntableRate, Some(turntable)) => {
                turntable.check(|key| at(&format!("turntable.{key}")))?;
            }
            (_, Some(_)) => {
                let problem = format!(
                    "rates of a turntable are given, but reference is {}",
                    self.reference
                );
                let remedy = "remove them, or set the reference to turntable-rate";
                return Err(Error::new(at("turntable"), problem, remedy).about(Argument::Reference));
            }
            (_, None) => {}
        }
        if let Some(error) = &self.reference_error {
            error.check(&at("reference_error"))?;
        }
        if let Some(clock) = &self.clock {
            clock.check(&at("clock"))?;
        }
        if let Some(whole) = &self.whole_turns {
            whole.check(&at("whole_turns"))?;
        }
        let rails = self.rails.unwrap_or_default();
        for (sensor, rails) in [("gyro", rails.gyro), ("accel", rails.accel)] {
            if let Some([low, high]) = rails
                && !(low.is_finite() && high.is_finite() && low < high)
            {
                return Err(Error::new(
                    at(&format!("rails.{sensor}")),
                    format!("[{low}, {high}] is not a range"),
                    "write [lowest, highest] in raw units",
                ));
            }
        }
        Ok(())
    }

    /// Text of `recording.toml`.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|error| {
            Error::new(
                MANIFEST_FILE,
                error,
                "report this: the manifest cannot be written",
            )
        })
    }
}

/// Checks that `rate` (Hz) can be a sample rate; `place` names where it was given.
pub(super) fn check_rate(rate: f64, place: &str) -> Result<()> {
    if RATE_RANGE.contains(&rate) {
        return Ok(());
    }
    Err(Error::new(
        place,
        format!("{rate:?} is not a sample rate"),
        "write the samples per second, from 0.01 to 10 million",
    ))
}

/// Checks that `gravity` (m/s²) is that of a place on Earth; `place` names where it was given.
pub(super) fn check_gravity(gravity: f64, place: &str) -> Result<()> {
    if GRAVITY_RANGE.contains(&gravity) {
        return Ok(());
    }
    if (0.9..=1.1).contains(&gravity) {
        return Err(Error::new(
            place,
            format!("{gravity} looks like g, but m/s² is needed"),
            "write 9.80665, or the local value if you know it",
        ));
    }
    Err(Error::new(
        place,
        format!("{gravity} is not a gravity on Earth"),
        "write the local value in m/s², between 9.7 and 9.9",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"format = "mimu-recording/1"
device = "unit-007"
sample_rate_hz = 1000
gravity_mps2 = 9.80665 # where it was recorded
raw_unit = "V"
reference = "table"
"#;

    fn refused(text: &str) -> String {
        Manifest::parse(text, "r/recording.toml")
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn every_key_comes_back_from_the_written_text() {
        let mut manifest = Manifest::new("µ \"7\"", 102.4, 9.81, RawUnit::Si, Reference::Gravity);
        manifest.latitude_deg = Some(-30.5);
        manifest.rails = Some(Rails {
            gyro: Some([0.05, 3.25]),
            accel: None,
        });
        manifest.unfinished = true;
        manifest.recorded = Some(Recorded {
            tool: "mimu 0".into(),
            start: Some("reset pin".into()),
            missing: 3,
            restarts: vec![super::super::recorded::Restart {
                t_s: 12.5,
                start: "watchdog".into(),
            }],
            ..Recorded::default()
        });
        manifest.step_labels = vec!["x_a".into(), "x_rot".into()];
        manifest.imported_with = vec!["a.csv".into(), "--rate-hz".into()];
        manifest.sources = vec![Source {
            file: "a.csv".into(),
            sha256: "00".into(),
        }];
        let text = manifest.to_toml().unwrap();
        assert_eq!(Manifest::parse(&text, "x").unwrap(), manifest);
    }

    #[test]
    fn gravity_in_g_is_told_apart_from_nonsense() {
        let text = refused(&GOOD.replace("9.80665", "1.0"));
        assert!(
            text.contains("looks like g") && text.contains("write 9.80665"),
            "{text}"
        );
        let text = refused(&GOOD.replace("9.80665", "980.665"));
        assert!(
            text.contains("gravity_mps2") && text.contains("980.665"),
            "{text}"
        );
        refused(&GOOD.replace("9.80665", "nan"));
    }

    #[test]
    fn values_out_of_range_are_refused_with_their_key() {
        for (from, to, word) in [
            ("= 1000", "= 0", "sample_rate_hz"),
            ("= 1000", "= inf", "sample_rate_hz"),
            ("\"V\"", "\"mV\"", "mV"),
            ("\"table\"", "\"tables\"", "tables"),
            ("recording/1", "recording/2", "mimu-recording/2"),
            ("device", "latitude_deg = 91\ndevice", "latitude_deg"),
            (
                "\"table\"\n",
                "\"table\"\n[rails]\ngyro = [1, 0]",
                "rails.gyro",
            ),
        ] {
            let text = refused(&GOOD.replace(from, to));
            assert!(text.contains(word), "{text}");
        }
    }
}
