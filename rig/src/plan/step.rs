//! Reading one `[[step]]` of a plan.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::reader::{FASTEST_DPS, Reader};
use super::{CarriedBy, Places, Pose, Step, TableAxis, Turn, WholeTurns};
use crate::located::written;
use crate::rotation::{Vector, direction};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawStep {
    pub(super) up: Option<Spanned<Vector>>,
    pub(super) poses: Option<Spanned<u32>>,
    pub(super) stay: Option<Spanned<bool>>,
    pub(super) heading_deg: Option<Spanned<f64>>,
    pub(super) rate_dps: Option<Spanned<f64>>,
    pub(super) spin_dps: Option<Spanned<f64>>,
    pub(super) turn_axis: Option<Spanned<TableAxis>>,
    pub(super) turn_deg: Option<Spanned<f64>>,
    pub(super) turn_dps: Option<Spanned<f64>>,
    pub(super) whole_turns: Option<Spanned<f64>>,
    pub(super) about: Option<Spanned<Vector>>,
    pub(super) tumble_s: Option<Spanned<f64>>,
    pub(super) dwell_s: Option<Spanned<f64>>,
    pub(super) repeat: Option<Spanned<u32>>,
}

impl Reader<'_> {
    pub(super) fn step(
        &self,
        raw: &Spanned<RawStep>,
        carrier: CarriedBy,
        sample_rate_hz: f64,
    ) -> Result<Step, String> {
        let (at, raw) = (raw.span(), raw.get_ref());
        self.on_table(raw, carrier)?;
        let turn = self.turn(raw)?;
        let whole = self.whole_turns(raw, carrier)?;
        let tumble_s = self.tumble_s(raw, carrier)?;
        let turns = turn.is_some() || whole.is_some() || tumble_s.is_some();
        let (pose, pose_at) = self.pose(raw, &at, turns)?;
        let dwell_s = self.dwell_s(raw, &at, turn.as_ref(), sample_rate_hz)?;
        let repeat = self.repeat(raw)?;
        let place = |value: Option<&Spanned<f64>>| value.map_or(at.clone(), Spanned::span);
        Ok(Step {
            pose,
            heading: match &raw.heading_deg {
                Some(_) => Some(self.angle("heading_deg", &raw.heading_deg, 360.0, "degrees")?),
                None => None,
            },
            rate: self.angle("rate_dps", &raw.rate_dps, FASTEST_DPS, "degrees per second")?,
            spin: self.angle("spin_dps", &raw.spin_dps, FASTEST_DPS, "degrees per second")?,
            turn,
            whole,
            tumble_s,
            dwell_s,
            repeat,
            at: Places {
                heading: place(raw.heading_deg.as_ref()),
                rate: place(raw.rate_dps.as_ref()),
                spin: place(raw.spin_dps.as_ref().or(raw.rate_dps.as_ref())),
                pose: pose_at,
            },
        })
    }

    /// The pose of the step at `at`, and where it is written.
    fn pose(
        &self,
        raw: &RawStep,
        at: &Range<usize>,
        turns: bool,
    ) -> Result<(Pose, Range<usize>), String> {
        let remedy = "keep one of them";
        if let (Some(stay), true) = (&raw.stay, raw.up.is_some() || raw.poses.is_some()) {
            let problem = "`stay` contradicts the pose of the same entry";
            return Err(self.source.error(&stay.span(), problem, remedy));
        }
        match (&raw.up, &raw.poses) {
            (None, None) if self.stays(raw, turns)? => Ok((Pose::Here, at.clone())),
            (Some(up), None) => Ok((Pose::Up(self.up(up)?), up.span())),
            (None, Some(poses)) => match *poses.get_ref() {
                0 => {
                    let remedy = "give one or more";
                    Err(self.source.error(&poses.span(), "`poses` is 0", remedy))
                }
                count => Ok((Pose::Many(count), poses.span())),
            },
            (Some(_), Some(poses)) => {
                let problem = "`up` and `poses` in one entry";
                Err(self.source.error(&poses.span(), problem, remedy))
            }
            (None, None) => {
                let remedy = "add the body direction that points up, or `poses = ...`";
                Err(self.source.error(at, "`up` is missing", remedy))
            }
        }
    }

    fn up(&self, up: &Spanned<Vector>) -> Result<Vector, String> {
        let refuse = |problem, remedy| self.source.error(&up.span(), problem, remedy);
        let v = *up.get_ref();
        if !v.iter().all(|x| x.is_finite()) {
            return Err(refuse("`up` is not finite", "give three numbers"));
        }
        direction(v).ok_or_else(|| {
            let remedy = "give the body direction that points up, as [0.0, 0.0, 1.0]";
            refuse("`up` has no length", remedy)
        })
    }

    /// How long the step at `at` takes: a turn as long as its angle needs.
    fn dwell_s(
        &self,
        raw: &RawStep,
        at: &Range<usize>,
        turn: Option<&Turn>,
        sample_rate_hz: f64,
    ) -> Result<f64, String> {
        let dwell_s = match (turn, &raw.dwell_s) {
            (Some(turn), _) => turn.angle.abs() / turn.rate,
            (None, Some(dwell_s)) => *dwell_s.get_ref(),
            (None, None) => {
                let remedy = "add `dwell_s = ...`, in seconds";
                return Err(self.source.error(at, "`dwell_s` is missing", remedy));
            }
        };
        if dwell_s.is_finite() && dwell_s * sample_rate_hz >= 1.0 {
            return Ok(dwell_s);
        }
        let problem = match turn {
            Some(_) => format!("the turn takes {} s", written(dwell_s)),
            None => format!("`dwell_s` is {}", written(dwell_s)),
        };
        let place = raw.dwell_s.as_ref().map_or(at.clone(), Spanned::span);
        let remedy = "give the dwell in seconds, a sample or longer";
        Err(self.source.error(&place, problem, remedy))
    }

    /// Whole turns by hand, after which the board is put back.
    fn whole_turns(&self, raw: &RawStep, carrier: CarriedBy) -> Result<Option<WholeTurns>, String> {
        let (turns, about) = match (&raw.whole_turns, &raw.about) {
            (None, None) => return Ok(None),
            (Some(turns), Some(about)) => (turns, about),
            (Some(only), None) => {
                let remedy = "add `about = [...]`, the body axis of the turns";
                return Err(self
                    .source
                    .error(&only.span(), "`about` is missing", remedy));
            }
            (None, Some(only)) => {
                let remedy = "add `whole_turns = ...`, or remove it";
                return Err(self
                    .source
                    .error(&only.span(), "`about` without turns", remedy));
            }
        };
        let count = *turns.get_ref();
        if carrier == CarriedBy::Table {
            let remedy =
                "give `turn_axis`, `turn_deg` and `turn_dps`, or set `carrier = \"hands\"`";
            return Err(self
                .source
                .error(&turns.span(), "`whole_turns` on a table", remedy));
        }
        if !(0.1..=1000.0).contains(&count.abs()) {
            let problem = format!("`whole_turns` is {}", written(count));
            let remedy = "give 0.1 to 1000 turns, negative for the other direction";
            return Err(self.source.error(&turns.span(), problem, remedy));
        }
        let remedy = "give a body direction, as [0.0, 0.0, 1.0]";
        let about = direction(*about.get_ref()).ok_or_else(|| {
            self.source
                .error(&about.span(), "`about` has no length", remedy)
        })?;
        Ok(Some(WholeTurns { count, about }))
    }

    /// A slow tumble by hand, after which the board is put back.
    fn tumble_s(&self, raw: &RawStep, carrier: CarriedBy) -> Result<Option<f64>, String> {
        let Some(tumble_s) = &raw.tumble_s else {
            return Ok(None);
        };
        let refused = |problem, remedy| Err(self.source.error(&tumble_s.span(), problem, remedy));
        if carrier == CarriedBy::Table {
            let remedy = "remove it, or set `carrier = \"hands\"`";
            return refused("`tumble_s` on a table", remedy);
        }
        if raw.up.is_some() || raw.poses.is_some() || raw.whole_turns.is_some() {
            let problem = "`tumble_s` beside a pose or whole turns";
            return refused(problem, "make it a separate [[step]]");
        }
        self.within("tumble_s", tumble_s, [1.0, 3600.0], "s")
            .map(Some)
    }

    fn repeat(&self, raw: &RawStep) -> Result<u32, String> {
        match &raw.repeat {
            None => Ok(1),
            Some(repeat) if *repeat.get_ref() == 0 => {
                let remedy = "give one or more, or remove the entry";
                Err(self.source.error(&repeat.span(), "`repeat` is 0", remedy))
            }
            Some(repeat) => Ok(*repeat.get_ref()),
        }
    }

    /// Refuses a step by hand that only a table can carry out.
    fn on_table(&self, raw: &RawStep, carrier: CarriedBy) -> Result<(), String> {
        if carrier == CarriedBy::Table {
            return Ok(());
        }
        let steady = "a person cannot turn at a constant rate";
        let stays = "a person needs a pose";
        for (key, span, why) in [
            ("rate_dps", raw.rate_dps.as_ref().map(Spanned::span), steady),
            ("spin_dps", raw.spin_dps.as_ref().map(Spanned::span), steady),
            (
                "turn_axis",
                raw.turn_axis.as_ref().map(Spanned::span),
                steady,
            ),
            ("stay", raw.stay.as_ref().map(Spanned::span), stays),
        ] {
            if let Some(span) = span {
                let problem = format!("`{key}` by hand: {why}");
                let remedy = "remove it, or set `carrier = \"table\"`";
                return Err(self.source.error(&span, problem, remedy));
            }
        }
        Ok(())
    }

    /// Whether a step without a pose begins where the previous one ended.
    fn stays(&self, raw: &RawStep, turns: bool) -> Result<bool, String> {
        let stay = raw.stay.as_ref().is_some_and(|s| *s.get_ref());
        let stays = stay || turns;
        if let (true, Some(heading)) = (stays, &raw.heading_deg) {
            let problem = "`heading_deg` without a pose";
            let remedy = "add `up`, or remove it";
            return Err(self.source.error(&heading.span(), problem, remedy));
        }
        Ok(stays)
    }
}
