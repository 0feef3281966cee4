//! The golden unit: one unit that stays at the station. Measured at the start of each shift, it tells whether the station still measures what it measured
//! before.
//!
//! Its first sessions are the reference. A later session is compared with their mean, by the scatter between them: power-ons and placing move a reading by
//! more than its noise, and only the history knows by how much. The reference does not follow later sessions, so a slow drift adds up until it shows.

use std::collections::BTreeMap;
use std::path::Path;

use mimu_recording::error::{Error, Result};
use mimu_recording::read_text;
use mimu_recording::result_file::stage;
use mimu_recording::statistics::mean_and_variance;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::measured::Measured;
use crate::quantity::Quantity;

/// Version of the file.
const FORMAT: &str = "mimu-golden/1";
/// Sessions of the reference.
const REFERENCE: usize = 10;
/// With fewer sessions the scatter between them is not known well enough to judge another one.
pub const FEWEST: usize = 5;
/// Probability that a sound station is refused at the start of a shift, over all quantities together.
const FALSE_ALARM: f64 = 0.01;

/// A value of a session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoldenValue {
    /// Value.
    pub value: f64,
    /// Its standard uncertainty of type A.
    pub repeatability: f64,
    /// Unit.
    pub unit: String,
}

/// A session of the golden unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoldenSession {
    /// When it was measured, RFC 3339.
    pub time: String,
    /// Whether it agreed with the reference; also true while there are too few sessions to judge.
    pub agrees: bool,
    /// Values by name.
    pub values: BTreeMap<String, GoldenValue>,
}

/// The history of a golden unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Golden {
    /// `mimu-golden/1`.
    pub format: String,
    /// Name of the unit.
    pub unit: String,
    /// Its sessions, in order of time.
    pub sessions: Vec<GoldenSession>,
}

/// A quantity of the golden unit that is not where the reference has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// Name.
    pub name: String,
    /// Today's value minus the mean of the reference.
    pub by: f64,
    /// Largest difference that the reference explains.
    pub allowed: f64,
    /// Unit of both.
    pub unit: String,
}

impl Golden {
    /// A history without sessions.
    pub fn new(unit: &str) -> Self {
        Self {
            format: FORMAT.into(),
            unit: unit.into(),
            sessions: Vec::new(),
        }
    }

    /// Reads a history.
    ///
    /// # Errors
    /// The file cannot be read, or has another format.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path)?;
        let wrong = |problem: String| {
            let remedy = "give the history of a golden unit, which mimu accept --golden wrote";
            Error::new(path.display(), problem, remedy)
        };
        let golden: Self = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
        match golden.format == FORMAT {
            true => Ok(golden),
            false => Err(wrong(format!(
                "format is {:?}, and this program reads {FORMAT:?}",
                golden.format
            ))),
        }
    }

    /// Writes the history, whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(path.display(), e, "report this error"))?;
        stage(path, text + "\n")?.publish()
    }

    /// The sessions that others are compared with.
    fn reference(&self) -> Vec<&GoldenSession> {
        let agreeing = self.sessions.iter().filter(|s| s.agrees);
        agreeing.take(REFERENCE).collect()
    }

    /// What moved since the reference; `None` if it has too few sessions to judge.
    pub fn moved(&self, today: &[Measured]) -> Option<Vec<Moved>> {
        let reference = self.reference();
        if reference.len() < FEWEST {
            return None;
        }
        let judged: Vec<&Measured> = today.iter().filter(|m| is_judged(m)).collect();
        let all = judged.iter().filter_map(|measured| {
            let own = reference
                .iter()
                .filter_map(|s| s.values.get(&measured.name));
            let own: Vec<&GoldenValue> = own.collect();
            (own.len() >= FEWEST).then(|| compared(measured, &own, judged.len()))
        });
        Some(all.filter(|m| !(m.by.abs() <= m.allowed)).collect())
    }

    /// Adds a session.
    pub fn add(&mut self, time: &str, agrees: bool, today: &[Measured]) {
        let value = |m: &Measured| {
            let value = GoldenValue {
                value: m.value,
                repeatability: m.repeatability,
                unit: m.unit.clone(),
            };
            (m.name.clone(), value)
        };
        self.sessions.push(GoldenSession {
            time: time.into(),
            agrees,
            values: today.iter().filter(|m| is_judged(m)).map(value).collect(),
        });
    }
}

/// Whether a quantity belongs to unit and station: the room's temperature does not, and counts have no scatter of their own.
fn is_judged(measured: &Measured) -> bool {
    measured.repeatability > 0.0
        && Quantity::find(&measured.name) != Some(Quantity::Temperature)
        && Quantity::find(&measured.name) != Some(Quantity::LostSamples)
}

/// Today's value against those of the reference, one of `tests` that are made together.
///
/// The prediction interval of one more value: `t · s √(1 + 1/n)`, with the larger of the scatter between the sessions and the noise within them.
fn compared(today: &Measured, reference: &[&GoldenValue], tests: usize) -> Moved {
    let n = reference.len() as f64;
    let (mean, between) = mean_and_variance(reference.iter().map(|v| v.value));
    let within = reference
        .iter()
        .map(|v| v.repeatability.powi(2))
        .sum::<f64>()
        / n;
    let variance = between.max(within).max(today.repeatability.powi(2));
    let tail = 0.5 * FALSE_ALARM / tests.max(1) as f64;
    let t = StudentsT::new(0.0, 1.0, n - 1.0).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - tail));
    Moved {
        name: today.name.clone(),
        by: today.value - mean,
        allowed: t * (variance * (1.0 + 1.0 / n)).sqrt(),
        unit: today.unit.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal numbers with standard deviation 1.
    fn normals(seed: u64) -> impl FnMut() -> f64 {
        let mut random = mimu_rig::random::Random::new(seed, "golden");
        move || random.normal()
    }

    /// A session whose quantities scatter by 1 between sessions, measured with 0.1, and are `off` the first ones.
    fn session(normal: &mut impl FnMut() -> f64, off: f64) -> Vec<Measured> {
        let one = |k| {
            let name = Quantity::GyroOffset.name(Some(k));
            Measured::new(name, off + normal() + 0.1 * normal(), "deg/s", 0.1)
        };
        (0..3).map(one).collect()
    }

    #[test]
    fn a_sound_station_is_refused_as_seldom_as_stated_and_a_moved_one_is_found() {
        let (mut refused, mut found) = (0, 0);
        for seed in 1..=1000 {
            let mut normal = normals(seed);
            let mut golden = Golden::new("golden");
            for _ in 0..10 {
                let today = session(&mut normal, 0.0);
                golden.add("2026-01-01T00:00:00Z", true, &today);
            }
            let moved = |today: Vec<Measured>| !golden.moved(&today).unwrap().is_empty();
            refused += u32::from(moved(session(&mut normal, 0.0)));
            found += u32::from(moved(session(&mut normal, 8.0)));
        }
        // 1 % of 1000, with four standard deviations.
        assert!(refused <= 23, "{refused}");
        assert!(found >= 990, "{found}");
    }

    #[test]
    fn too_short_a_history_judges_nothing_and_the_file_is_read_back() {
        let mut normal = normals(3);
        let mut golden = Golden::new("golden");
        for _ in 0..FEWEST - 1 {
            // Short in decimal: reading JSON may change the last bit of a long number.
            let short = |m: Measured| Measured {
                value: (m.value * 1024.0).round() / 1024.0,
                ..m
            };
            let today: Vec<_> = session(&mut normal, 0.0).into_iter().map(short).collect();
            golden.add("2026-01-01T00:00:00Z", true, &today);
        }
        assert_eq!(golden.moved(&session(&mut normal, 50.0)), None);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("golden.json");
        golden.write(&path).unwrap();
        assert_eq!(Golden::read(&path).unwrap(), golden);
    }
}
