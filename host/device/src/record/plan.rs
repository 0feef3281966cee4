//! The plan of an experiment, `mimu-plan/1`, as far as a recording needs it: dwells with their inputs and lengths.

use std::path::Path;
use std::time::Duration;

use nalgebra::Vector3;
use serde::Deserialize;

use mimu_recording::error::{Error, Result};
use mimu_recording::read_text;

/// A plan of more is a mistake in it.
const MOST_DWELLS: usize = 100_000;
/// Directions whose cosine is as near to 1 are the same: a hundredth of a degree.
const PARALLEL: f64 = 1.5e-8;

/// A plan as `mimu design` writes it. What only the bench needs is read and left alone.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    format: String,
    /// Name of the unit.
    #[serde(default)]
    pub device: Option<String>,
    #[serde(rename = "sample_rate_hz")]
    _sample_rate_hz: f64,
    #[serde(default, rename = "samples")]
    _samples: Option<String>,
    carrier: Carrier,
    #[serde(default, rename = "steps")]
    _steps: Option<bool>,
    /// Degrees.
    #[serde(default)]
    pub latitude_deg: Option<f64>,
    /// Local gravity, m/s².
    #[serde(default)]
    pub gravity_mps2: Option<f64>,
    #[serde(default, rename = "chamber_c")]
    _chamber_c: Vec<[f64; 2]>,
    #[serde(default)]
    lead_in_s: f64,
    step: Vec<Step>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Carrier {
    Table,
    Hands,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    #[serde(default)]
    up: Option<[f64; 3]>,
    #[serde(default)]
    poses: Option<u32>,
    #[serde(default, rename = "heading_deg")]
    _heading_deg: f64,
    #[serde(default)]
    rate_dps: f64,
    #[serde(default)]
    spin_dps: f64,
    dwell_s: f64,
    #[serde(default = "once")]
    repeat: u32,
}

fn once() -> u32 {
    1
}

/// A dwell of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// Rate, deg/s, and specific force, m/s², of the body, in the order of the `ref_` columns. Not a number by hand, where nobody knows
    /// them well enough.
    pub input: [f64; 6],
    /// How long.
    pub length: Duration,
    /// What is to be done, for the person who does it.
    pub title: String,
    /// Direction in the body frame that points up, of length 1; `None` where the bench chooses the pose.
    pub up: Option<[f64; 3]>,
    /// Rate about it, deg/s.
    pub rate_dps: f64,
}

impl Plan {
    /// Reads and checks a plan.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = read_text(path)?;
        let plan: Self = toml::from_str(&text).map_err(|error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            let line = 1 + before.map_or(0, |text| text.matches('\n').count());
            Error::new(
                format!("{place}, line {line}"),
                error.message().trim(),
                "correct the line, or have `mimu design -o` write the plan",
            )
        })?;
        if plan.format != "mimu-plan/1" {
            let problem = format!("format is {:?}, and a plan is \"mimu-plan/1\"", plan.format);
            return Err(Error::new(place, problem, "give the plan of an experiment"));
        }
        Ok(plan)
    }

    /// Whether its inputs are known well enough to calibrate by.
    pub fn is_of_table(&self) -> bool {
        self.carrier == Carrier::Table
    }

    /// Time before the first dwell.
    pub fn lead_in(&self) -> Duration {
        Duration::try_from_secs_f64(self.lead_in_s).unwrap_or_default()
    }

    /// Its dwells in order, with local gravity, m/s²; `place` is its path.
    pub fn dwells(&self, gravity_mps2: f64, place: &str) -> Result<Vec<Planned>> {
        let mut all = Vec::new();
        for (k, step) in self.step.iter().enumerate() {
            let at = format!("{place}, [[step]] {}", k + 1);
            let dwell = step.planned(self.carrier, gravity_mps2, &at)?;
            let count = step.repeat as usize * step.poses.unwrap_or(1) as usize;
            if all.len() + count > MOST_DWELLS {
                let problem = format!("the plan has more than {MOST_DWELLS} dwells by here");
                return Err(Error::new(at, problem, "plan fewer"));
            }
            all.extend(std::iter::repeat_n(dwell, count));
        }
        match all.is_empty() {
            true => Err(Error::new(place, "it has no dwell", "add a [[step]]")),
            false => Ok(all),
        }
    }
}

impl Step {
    fn planned(&self, carrier: Carrier, gravity_mps2: f64, at: &str) -> Result<Planned> {
        let refuse = |problem: &str, remedy: &str| Err(Error::new(at, problem, remedy));
        let length = Duration::try_from_secs_f64(self.dwell_s).unwrap_or_default();
        if length.is_zero() {
            return refuse("dwell_s is no length of time", "write seconds above 0");
        }
        let unknown = |title: String| Planned {
            input: [f64::NAN; 6],
            length,
            title,
            up: self.up.map(|up| Vector3::from(up).normalize().into()),
            rate_dps: 0.0,
        };
        let (up, poses) = (self.up.map(Vector3::from), self.poses);
        let up = match (up, poses, carrier) {
            (Some(up), None, _) if up.norm() > 0.0 && up.norm().is_finite() => up.normalize(),
            (None, Some(_), Carrier::Hands) => return Ok(unknown("another pose".into())),
            (None, Some(_), Carrier::Table) => {
                let problem = "poses lets the bench choose the attitudes, so that none is known";
                return refuse(problem, "write the direction that points up in each: up");
            }
            _ => return refuse("there has to be up, or poses", "write up = [x, y, z]"),
        };
        let shown = up.map(|c| (c * 1e3).round() / 1e3 + 0.0);
        let mut title = format!("up {}, {}, {}", shown.x, shown.y, shown.z);
        if carrier == Carrier::Hands {
            return Ok(unknown(title));
        }
        let turns_up = up.z.abs() < 1.0 - PARALLEL;
        if self.spin_dps != 0.0 && turns_up {
            let problem = "spin_dps turns the direction of gravity within the dwell, so that it has no one input";
            let remedy = "record it with --step-every or --steps, and import it with ref_ columns";
            return refuse(problem, remedy);
        }
        // A turn about the vertical is one about the body direction that points up.
        let rate = up * self.rate_dps + Vector3::z() * self.spin_dps;
        if !rate.iter().all(|r| r.is_finite()) {
            return refuse("a rate is not a number", "write degrees per second");
        }
        if rate.norm() > 0.0 {
            title += &format!(", {} deg/s about it", rate.dot(&up));
        }
        let force = up * gravity_mps2;
        let mut input = [0.0; 6];
        for (cell, value) in input.iter_mut().zip(rate.iter().chain(force.iter())) {
            // Minus zero puzzles.
            *cell = *value + 0.0;
        }
        Ok(Planned {
            input,
            length,
            title,
            up: Some(up.into()),
            rate_dps: rate.dot(&up),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dwells(steps: &str, carrier: &str) -> Result<Vec<Planned>> {
        let folder = std::env::temp_dir().join(format!("mimu-plan-{}", std::process::id()));
        let name = format!("{carrier}-{}.toml", steps.len());
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(name);
        let head = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\n";
        let text = format!("{head}carrier = \"{carrier}\"\n{steps}");
        std::fs::write(&path, text).unwrap();
        let plan = Plan::read(&path)?;
        plan.dwells(9.8, "plan.toml")
    }

    #[test]
    fn a_rate_about_the_vertical_is_along_the_direction_that_points_up() {
        let all = dwells(
            "[[step]]\nup = [0.0, -2.0, 0.0]\nrate_dps = 100.0\ndwell_s = 2.0\nrepeat = 2\n\
             [[step]]\nup = [0.0, 0.0, -1.0]\nspin_dps = 10.0\ndwell_s = 1.5\n",
            "table",
        )
        .unwrap();
        assert_eq!(all.len(), 3);
        assert_eq!(all[0], all[1]);
        assert_eq!(all[0].input, [0.0, -100.0, 0.0, 0.0, -9.8, 0.0]);
        assert_eq!(all[0].length, Duration::from_secs(2));
        // About the body's own z, whichever way that points.
        assert_eq!(all[2].input, [0.0, 0.0, 10.0, 0.0, 0.0, -9.8]);
    }

    #[test]
    fn by_hand_no_input_is_known() {
        let all = dwells("[[step]]\nposes = 3\ndwell_s = 1.0\n", "hands").unwrap();
        assert_eq!(all.len(), 3);
        assert!(all[2].input.iter().all(|v| v.is_nan()));
    }

    #[test]
    fn what_has_no_input_is_refused_by_its_step() {
        for (steps, words) in [
            ("[[step]]\nposes = 3\ndwell_s = 1.0\n", "[[step]] 1: poses"),
            (
                "[[step]]\nup = [1.0, 0.0, 0.0]\nspin_dps = 1.0\ndwell_s = 1.0\n",
                "no one input",
            ),
            ("[[step]]\ndwell_s = 1.0\n", "up, or poses"),
            (
                "[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = -1.0\n",
                "dwell_s",
            ),
            ("[[step]]\nup = [0.0, 0.0, 1.0]\ndwel = 1.0\n", "line 6"),
        ] {
            let line = dwells(steps, "table").unwrap_err().to_string();
            assert!(line.contains(words), "{line}");
        }
    }
}
