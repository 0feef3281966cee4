//! Reading and checking `PLAN.toml`: every refusal names the file and the line.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::reader::Reader;
use super::step::RawStep;
use super::{CarriedBy, Plan, Pose, Samples, Step};
use crate::located::{Source, written};
use crate::place::Place;

/// Longest recording, s: a longer plan must contain a wrong unit.
const LONGEST_S: f64 = 48.0 * 3600.0;
/// Maximum number of dwells in a plan, for the same reason.
const MOST_DWELLS: u64 = 100_000;
/// Maximum number of samples, for the same reason: 48 h at 1 kHz are 173 million, and each takes some hundred bytes on disk.
const MOST_SAMPLES: f64 = 200e6;
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlan {
    format: Spanned<String>,
    #[serde(default = "unit")]
    device: Spanned<String>,
    sample_rate_hz: Spanned<f64>,
    samples: Option<Samples>,
    carrier: CarriedBy,
    steps: Option<bool>,
    latitude_deg: Option<Spanned<f64>>,
    gravity_mps2: Option<Spanned<f64>>,
    #[serde(default)]
    chamber_c: Vec<Spanned<[f64; 2]>>,
    lead_in_s: Option<Spanned<f64>>,
    rounds: Option<Spanned<u32>>,
    round_s: Option<Spanned<f64>>,
    #[serde(default)]
    step: Vec<Spanned<RawStep>>,
}

fn unit() -> Spanned<String> {
    Spanned::new(0..0, "unit".to_owned())
}

impl Plan {
    /// Reads a plan. An error is one line: the file, the line, the problem and the remedy.
    pub fn parse(source: Source) -> Result<Self, String> {
        let raw: RawPlan = source.parse()?;
        let reader = Reader { source: &source };
        if raw.format.get_ref() != "mimu-plan/1" {
            return Err(source.error(
                &raw.format.span(),
                format_args!("format \"{}\" is not that of a plan", raw.format.get_ref()),
                "give a plan, with format = \"mimu-plan/1\"",
            ));
        }
        let device = raw.device.get_ref();
        if device.trim().is_empty() || device.contains(char::is_control) {
            return Err(source.error(
                &raw.device.span(),
                "`device` is not a name",
                "name the unit in one line, or remove the key",
            ));
        }
        let sample_rate_hz =
            reader.within("sample_rate_hz", &raw.sample_rate_hz, [1.0, 20_000.0], "Hz")?;
        let latitude_deg = match &raw.latitude_deg {
            Some(value) => reader.within("latitude_deg", value, [-90.0, 90.0], "degrees")?,
            None => 45.0,
        };
        let gravity = match &raw.gravity_mps2 {
            // Normal gravity on the ellipsoid is 9.780 to 9.832; mountains reduce it by 0.02.
            Some(value) => Some(reader.within("gravity_mps2", value, [9.7, 9.9], "m/s²")?),
            None => None,
        };
        let lead_in_s = match &raw.lead_in_s {
            Some(value) => reader.within("lead_in_s", value, [0.0, LONGEST_S], "s")?,
            None => 0.0,
        };
        if raw.step.is_empty() {
            return Err(source.error(
                &(usize::MAX..usize::MAX),
                "the plan has no entry",
                "add a `[[step]]` with `up` and `dwell_s`",
            ));
        }
        let steps = raw
            .step
            .iter()
            .map(|step| reader.step(step, raw.carrier, sample_rate_hz))
            .collect::<Result<Vec<_>, _>>()?;
        let (rounds, round_s) = reader.rounds(&raw)?;
        if let (Some(first), Pose::Here) = (steps.first(), steps[0].pose) {
            let remedy = "add `up`, the body direction that points up";
            let problem = "the first entry has no pose to begin in";
            return Err(source.error(&first.at.pose, problem, remedy));
        }
        reader.length(lead_in_s, sample_rate_hz, &steps, rounds)?;
        Ok(Self {
            device: device.clone(),
            sample_rate_hz,
            samples: raw.samples.unwrap_or(Samples::Parquet),
            carrier: raw.carrier,
            numbered: raw.steps.unwrap_or(raw.carrier == CarriedBy::Table),
            place: Place::new(latitude_deg, gravity),
            chamber: reader.chamber(&raw.chamber_c)?,
            lead_in_s,
            steps,
            rounds,
            round_s,
            round_at: raw.round_s.as_ref().map_or(0..0, Spanned::span),
            source,
        })
    }
}

impl Plan {
    /// Number of its dwells and turns, over all rounds.
    pub fn dwells(&self) -> u64 {
        u64::from(self.rounds) * self.steps.iter().map(Step::dwells).sum::<u64>()
    }

    /// Refuses a plan that takes too long including the moves from pose to pose; the error is at its last step.
    pub(crate) fn check_length(&self, duration_s: f64) -> Result<(), String> {
        let last = self.steps.last().map_or(0..0, |step| step.at.pose.clone());
        let dwells = self.dwells();
        let what = "with the moves from pose to pose the plan has";
        too_long(
            &self.source,
            &last,
            what,
            dwells,
            duration_s,
            self.sample_rate_hz,
        )
    }
}

fn too_long(
    source: &Source,
    at: &Range<usize>,
    what: &str,
    dwells: u64,
    seconds: f64,
    rate_hz: f64,
) -> Result<(), String> {
    let samples = seconds * rate_hz;
    if seconds <= LONGEST_S && samples <= MOST_SAMPLES && dwells <= MOST_DWELLS {
        return Ok(());
    }
    let (hours, most_hours) = (seconds / 3600.0, LONGEST_S / 3600.0);
    Err(source.error(
        at,
        format_args!("{what} {dwells} dwells, {hours:.1} h, {samples:.3e} samples"),
        format_args!(
            "stay within {MOST_DWELLS} dwells, {most_hours} h (`dwell_s` is in seconds), {MOST_SAMPLES:e} samples"
        ),
    ))
}

impl Reader<'_> {
    /// Number of rounds, and the time from one round to the next.
    fn rounds(&self, raw: &RawPlan) -> Result<(u32, Option<f64>), String> {
        let rounds = raw.rounds.as_ref().map_or(1, |r| *r.get_ref());
        if let (0, Some(key)) = (rounds, &raw.rounds) {
            let remedy = "give one or more, or leave it out";
            return Err(self.source.error(&key.span(), "`rounds` is 0", remedy));
        }
        if let (Some(key), CarriedBy::Hands) = (&raw.round_s, raw.carrier) {
            let problem = "`round_s` by hand: a person cannot keep such times";
            let remedy = "remove it, or set `carrier = \"table\"`";
            return Err(self.source.error(&key.span(), problem, remedy));
        }
        let round_s = raw
            .round_s
            .as_ref()
            .map(|s| self.within("round_s", s, [0.0, LONGEST_S], "s"));
        Ok((rounds, round_s.transpose()?))
    }

    /// Refuses recordings that are too long, at the step where the limit is exceeded. Moves are added in [`Plan::check_length`].
    fn length(
        &self,
        lead_in_s: f64,
        rate_hz: f64,
        steps: &[Step],
        rounds: u32,
    ) -> Result<(), String> {
        let (mut seconds, mut dwells) = (lead_in_s, 0_u64);
        for step in steps {
            let count = u64::from(rounds) * step.dwells();
            seconds += count as f64 * step.dwell_s;
            dwells += count;
            let what = "up to this entry the plan has";
            too_long(self.source, &step.at.pose, what, dwells, seconds, rate_hz)?;
        }
        Ok(())
    }

    fn chamber(&self, raw: &[Spanned<[f64; 2]>]) -> Result<Vec<[f64; 2]>, String> {
        let mut last = f64::NEG_INFINITY;
        for point in raw {
            let [t, c] = *point.get_ref();
            if !(t.abs() <= LONGEST_S) {
                let problem = format!("`chamber_c`: time {} s", written(t));
                let remedy = "give times within 48 h of the beginning, in seconds";
                return Err(self.source.error(&point.span(), problem, remedy));
            }
            if t <= last {
                let problem = format!("`chamber_c`: time {t} s is not later than the one before");
                return Err(self.source.error(
                    &point.span(),
                    problem,
                    "give [time in s, °C] pairs in order of time",
                ));
            }
            // Beyond the limits of chambers and silicon; 298 is a temperature in kelvin.
            if !(-100.0..=200.0).contains(&c) {
                let problem = format!("`chamber_c`: {} °C at {t} s", written(c));
                return Err(self.source.error(
                    &point.span(),
                    problem,
                    "give -100 to 200 degrees Celsius",
                ));
            }
            last = t;
        }
        Ok(raw.iter().map(|point| *point.get_ref()).collect())
    }
}
