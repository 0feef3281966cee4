//! The plan of an experiment, `mimu-plan/1`: what a table or a person carries out, step by step.
//!
//! One type writes and reads it. The bench has a separate reader, as a check from outside.

pub mod chamber;
pub mod design;
pub mod next_experiment;
mod turn;

use std::path::Path;
use std::time::Duration;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use mimu_recording::{Argument, Error, Result, check_kind, parse_toml, read_text};

use crate::plan::design::model::Setting;
use crate::plan::design::reach::Fixture;
use crate::toml_layout;
use turn::Angles;
pub use turn::{TableAxis, Turn};

/// `format` of a plan.
const FORMAT: &str = "mimu-plan/1";
/// Most dwells of a plan; more are taken for a mistake.
const MOST_DWELLS: usize = 100_000;
/// Directions are the same if their cosine is as near to 1 as this: a hundredth of a degree.
const PARALLEL: f64 = 1.5e-8;

/// A plan. Keys that only the bench needs are read and ignored.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    format: String,
    /// Name of the unit.
    pub device: Option<String>,
    sample_rate_hz: f64,
    samples: Option<String>,
    carrier: Carrier,
    steps: Option<bool>,
    /// Latitude, degrees.
    pub latitude_deg: Option<f64>,
    /// Local gravity, m/s².
    pub gravity_mps2: Option<f64>,
    /// Course of the chamber, s and °C; empty where it does not matter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chamber_c: Vec<[f64; 2]>,
    /// Time before the first dwell, s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub lead_in_s: f64,
    /// Number of rounds, each through all entries.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub rounds: u32,
    /// From the beginning of a round to that of the next, s; without it they follow each other.
    pub round_s: Option<f64>,
    /// Entries of a round.
    pub step: Vec<Step>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Carrier {
    Table,
    Hands,
}

/// A dwell of a plan, or a turn of one axis of the table.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    up: Option<[f64; 3]>,
    poses: Option<u32>,
    #[serde(default, skip_serializing_if = "is_zero")]
    heading_deg: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    rate_dps: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    spin_dps: f64,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    stay: bool,
    turn_axis: Option<TableAxis>,
    turn_deg: Option<f64>,
    turn_dps: Option<f64>,
    dwell_s: Option<f64>,
    #[serde(default = "once", skip_serializing_if = "is_once")]
    repeat: u32,
}

fn once() -> u32 {
    1
}

fn is_once(count: &u32) -> bool {
    *count == 1
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// To a whole number of 1/`per`, without a negative zero.
pub fn round(value: f64, per: f64) -> f64 {
    (value * per).round() / per + 0.0
}

impl Step {
    /// A dwell of `dwell_s` seconds with the body direction `up` upwards, turning at `rate_dps` about it. Without a direction it stays
    /// where the turn before has ended.
    pub fn dwell(up: Option<Vector3<f64>>, rate_dps: f64, dwell_s: f64) -> Self {
        Self {
            up: up.map(|up| up.map(|c| round(c, 1e9)).into()),
            rate_dps: round(rate_dps, 1e6),
            stay: up.is_none(),
            dwell_s: Some(round(dwell_s, 1e3)),
            repeat: 1,
            ..Self::default()
        }
    }

    /// A dwell at `setting`.
    pub fn of(setting: &Setting, dwell_s: f64) -> Self {
        Self::dwell(Some(setting.up), setting.rate.to_degrees(), dwell_s)
    }

    /// The same, repeated so many times without a move between them.
    pub fn repeated(self, repeat: u32) -> Self {
        Self { repeat, ..self }
    }

    /// A turn of one axis of the table.
    pub fn turn(axis: TableAxis, angle_deg: f64, rate_dps: f64) -> Self {
        Self {
            turn_axis: Some(axis),
            turn_deg: Some(angle_deg),
            turn_dps: Some(rate_dps),
            repeat: 1,
            ..Self::default()
        }
    }
}

/// A dwell of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// Rate, deg/s, and specific force, m/s², of the body, in the order of the `ref_` columns. NaN by hand, where they are not known well
    /// enough.
    pub input: [f64; 6],
    /// Length.
    pub length: Duration,
    /// Instruction for the person who carries it out.
    pub title: String,
    /// Direction in the body frame that points up, of length 1; `None` where the bench chooses the pose.
    pub up: Option<[f64; 3]>,
    /// Rate about that direction, deg/s.
    pub rate_dps: f64,
    /// A turn by an angle instead of a dwell. Only the mean of its input is known, and only after its end.
    pub turn: Option<Turn>,
}

impl Planned {
    /// Its mean input, if it took so long.
    pub fn input_over(&self, duration_s: f64) -> [f64; 6] {
        let mut input = self.input;
        if let Some(turn) = &self.turn {
            for (cell, deg) in input.iter_mut().zip(turn.about_deg) {
                *cell = deg / duration_s;
            }
        }
        input
    }
}

impl Plan {
    /// A plan for a fixture.
    pub fn new(fixture: Fixture, sample_rate_hz: f64, step: Vec<Step>) -> Self {
        Self {
            format: FORMAT.into(),
            device: None,
            sample_rate_hz: round(sample_rate_hz, 1e6),
            samples: None,
            carrier: match fixture {
                Fixture::Hand => Carrier::Hands,
                _ => Carrier::Table,
            },
            steps: None,
            latitude_deg: None,
            gravity_mps2: None,
            chamber_c: Vec::new(),
            lead_in_s: 0.0,
            rounds: 1,
            round_s: None,
            step,
        }
    }

    /// The same with a course of the chamber, s and °C.
    pub fn in_chamber(mut self, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let points = points.into_iter();
        self.chamber_c = points
            .map(|[t, c]| [round(t, 1e3), round(c, 1e3)])
            .collect();
        self
    }

    /// The same with a time before the first dwell, s, and so many rounds; `round_s` from one to the next, if the table waits for it.
    pub fn in_rounds(mut self, lead_in_s: f64, rounds: u32, round_s: Option<f64>) -> Self {
        self.lead_in_s = round(lead_in_s, 1e3);
        self.rounds = rounds;
        self.round_s = round_s.map(|s| round(s, 1e3));
        self
    }

    /// Text of the file; `about` is put in front as a comment, line by line.
    pub fn to_toml(&self, about: &str) -> String {
        let about: String = about.lines().map(|line| format!("# {line}\n")).collect();
        toml_layout::to_toml(&about, self)
    }

    /// Reads and checks a plan.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = read_text(path)?;
        let again = "write the plan with `mimu design` or `mimu thermal plan`";
        check_kind(&text, &place, "mimu-plan")?;
        let plan: Self = parse_toml(&text, &place, Some(again))?;
        if !(1..=MOST_DWELLS).contains(&(plan.rounds as usize)) {
            let problem = format!("rounds is {}", plan.rounds);
            let remedy = format!("write one or more, up to {MOST_DWELLS}");
            return Err(Error::new(place, problem, remedy));
        }
        if plan.format != FORMAT {
            let problem = format!("format is {:?}; that of a plan is {FORMAT:?}", plan.format);
            return Err(Error::new(
                place,
                problem,
                "name a plan of `mimu design` or `mimu thermal plan`",
            ));
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

    /// Whether only a program that moves the table can carry it out: it has turns, whose length depends on the table, or rounds that
    /// begin by the clock.
    pub fn is_procedure(&self) -> bool {
        self.round_s.is_some() || self.step.iter().any(|step| step.turn_axis.is_some())
    }

    /// Its dwells in order, with local gravity, m/s²; `place` is its path.
    pub fn dwells(&self, gravity_mps2: f64, place: &str) -> Result<Vec<Planned>> {
        let mut all = Vec::new();
        let mut stands = None;
        for _ in 0..self.rounds {
            for (k, step) in self.step.iter().enumerate() {
                let at = format!("{place}, [[step]] {}", k + 1);
                let dwell = step.planned(self.carrier, gravity_mps2, &mut stands, &at)?;
                let count = step.repeat as usize * step.poses.unwrap_or(1) as usize;
                if all.len() + count > MOST_DWELLS {
                    let problem =
                        format!("up to this entry the plan has more than {MOST_DWELLS} dwells");
                    return Err(Error::new(at, problem, "plan fewer"));
                }
                all.extend(std::iter::repeat_n(dwell, count));
            }
        }
        match all.is_empty() {
            true => Err(Error::new(place, "the plan has no dwell", "add a [[step]]")),
            false => Ok(all),
        }
    }
}

/// A dwell with an unknown input.
fn unknown(up: Option<[f64; 3]>, title: String, length: Duration) -> Planned {
    Planned {
        input: [f64::NAN; 6],
        length,
        title,
        up,
        rate_dps: 0.0,
        turn: None,
    }
}

impl Step {
    /// The entry as a dwell. `stands` is the pose in which the entry before left the table, and then that in which this one leaves it.
    fn planned(
        &self,
        carrier: Carrier,
        gravity_mps2: f64,
        stands: &mut Option<Angles>,
        at: &str,
    ) -> Result<Planned> {
        self.check_turn(carrier, at)?;
        let Some(up) = self.pose(carrier, *stands, at)? else {
            return Ok(unknown(None, "another pose".into(), self.length(at)?));
        };
        let angles = match (*stands, self.up) {
            (Some(angles), None) => angles,
            _ => Angles::of(&up),
        };
        *stands = Some(angles);
        if let Some(axis) = self.turn_axis {
            return self.turned(axis, angles, stands, at);
        }
        let length = self.length(at)?;
        let shown = up.map(|c| (c * 1e3).round() / 1e3 + 0.0);
        let mut title = format!("up {}, {}, {}", shown.x, shown.y, shown.z);
        if carrier == Carrier::Hands {
            return Ok(unknown(Some(up.into()), title, length));
        }
        let rate = self.rate(&up, at)?;
        if rate.norm() > 0.0 {
            title += &format!(", {} deg/s about it", rate.dot(&up));
        }
        let force = up * gravity_mps2;
        let mut input = [0.0; 6];
        for (cell, value) in input.iter_mut().zip(rate.iter().chain(force.iter())) {
            // Without a minus zero, which would puzzle a reader.
            *cell = *value + 0.0;
        }
        Ok(Planned {
            input,
            length,
            title,
            up: Some(up.into()),
            rate_dps: rate.dot(&up),
            turn: None,
        })
    }

    /// Refuses what belongs to a turn by an angle where there is none, and turns by hand.
    fn check_turn(&self, carrier: Carrier, at: &str) -> Result<()> {
        let refuse = |problem: &str, remedy: &str| Err(Error::new(at, problem, remedy));
        if carrier == Carrier::Hands && (self.turn_axis.is_some() || self.stay) {
            let problem =
                "a person cannot turn the unit by an exact angle, nor stay without a pose";
            return refuse(problem, "write up = [x, y, z], or carrier = \"table\"");
        }
        if self.turn_axis.is_none() && self.turn_deg.or(self.turn_dps).is_some() {
            let remedy = "add turn_axis = \"outer\", \"middle\" or \"inner\"";
            return refuse("turn_deg or turn_dps without turn_axis", remedy);
        }
        if self.stay && self.up.is_some() {
            return refuse(
                "stay contradicts the pose of the same entry",
                "keep one of them",
            );
        }
        Ok(())
    }

    /// Direction that points up; `None` by hand, if any pose will do.
    fn pose(
        &self,
        carrier: Carrier,
        stands: Option<Angles>,
        at: &str,
    ) -> Result<Option<Vector3<f64>>> {
        let refuse = |problem: &str, remedy: &str| Err(Error::new(at, problem, remedy));
        let stays = self.stay || self.turn_axis.is_some();
        match (self.up.map(Vector3::from), self.poses, carrier) {
            (Some(up), None, _) if up.norm() > 0.0 && up.norm().is_finite() => {
                Ok(Some(up.normalize()))
            }
            (None, Some(_), Carrier::Hands) => Ok(None),
            (None, Some(_), Carrier::Table) => {
                let problem = "poses lets the bench choose the attitudes, so they are unknown";
                refuse(
                    problem,
                    "write the direction that points up in each entry: up",
                )
            }
            (None, None, Carrier::Table) if stays => match stands {
                Some(angles) => Ok(Some(angles.up())),
                None => refuse(
                    "the first entry has no pose to begin in",
                    "add up = [x, y, z]",
                ),
            },
            _ => refuse("up or poses is missing", "write up = [x, y, z]"),
        }
    }

    /// Rate in the body, deg/s.
    fn rate(&self, up: &Vector3<f64>, at: &str) -> Result<Vector3<f64>> {
        let refuse = |problem: &str, remedy: &str| Err(Error::new(at, problem, remedy));
        let turns_up = up.z.abs() < 1.0 - PARALLEL;
        if self.spin_dps != 0.0 && turns_up {
            let problem = "spin_dps turns gravity through the sensors within the dwell, so its input is not constant";
            let remedy =
                "record it without a plan, number its dwells, and import it with ref_ columns";
            return refuse(problem, remedy).map_err(|e| e.about(Argument::StepTimes));
        }
        // A turn about the vertical is one about the body direction that points up.
        let rate = up * self.rate_dps + Vector3::z() * self.spin_dps;
        match rate.iter().all(|r| r.is_finite()) {
            true => Ok(rate),
            false => refuse("a rate is not a number", "write degrees per second"),
        }
    }

    fn length(&self, at: &str) -> Result<Duration> {
        let length = Duration::try_from_secs_f64(self.dwell_s.unwrap_or_default());
        match length.unwrap_or_default() {
            Duration::ZERO => {
                let problem = "dwell_s is not a length of time";
                Err(Error::new(at, problem, "write seconds above 0"))
            }
            length => Ok(length),
        }
    }

    /// A turn of one axis from where the table stands.
    fn turned(
        &self,
        axis: TableAxis,
        from: Angles,
        stands: &mut Option<Angles>,
        at: &str,
    ) -> Result<Planned> {
        let refuse = |problem: &str, remedy: &str| Err(Error::new(at, problem, remedy));
        let (deg, dps) = match (self.turn_deg, self.turn_dps) {
            (Some(deg), Some(dps)) if deg != 0.0 && deg.is_finite() && dps > 0.0 => (deg, dps),
            _ => {
                let remedy =
                    "write turn_deg in degrees and turn_dps in degrees per second, above 0";
                return refuse("a turn needs an angle and a rate", remedy);
            }
        };
        let more = self.dwell_s.is_some() || self.poses.is_some() || self.repeat != 1;
        if more || self.rate_dps != 0.0 || self.spin_dps != 0.0 {
            let remedy = "make the dwell a separate [[step]]";
            return refuse("a turn by an angle cannot be a dwell too", remedy);
        }
        let (turn, to) = from.turn(axis, deg, dps);
        *stands = Some(to);
        Ok(Planned {
            input: [f64::NAN; 6],
            length: Duration::try_from_secs_f64(deg.abs() / dps).unwrap_or_default(),
            title: format!("turn of the {} axis by {deg} degrees", axis.name()),
            up: Some(turn.to_up),
            rate_dps: 0.0,
            turn: Some(turn),
        })
    }
}

#[cfg(test)]
mod tests;
