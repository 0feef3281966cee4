//! Reading one `[[step]]` of a plan.

use std::fmt::Display;
use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::reader::{FASTEST_DPS, Reader};
use super::{CarriedBy, Places, Pose, Step, TableAxis};
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
        let place = |value: Option<Range<usize>>| value.unwrap_or(at.clone());
        let refuse = |at: &Range<usize>, problem: &dyn Display, remedy: &str| {
            Err(self.source.error(at, problem, remedy))
        };
        if let (Some(stay), true) = (&raw.stay, raw.up.is_some() || raw.poses.is_some()) {
            return refuse(
                &stay.span(),
                &"`stay` contradicts the pose of the same entry",
                "keep one of them",
            );
        }
        let (pose, pose_at) = match (&raw.up, &raw.poses) {
            (None, None) if self.stays(raw, turn.is_some())? => (Pose::Here, at.clone()),
            (Some(up), None) => {
                let v = *up.get_ref();
                if !v.iter().all(|x| x.is_finite()) {
                    return refuse(&up.span(), &"`up` is not finite", "give three numbers");
                }
                let Some(v) = direction(v) else {
                    let remedy = "give the body direction that points up, as [0.0, 0.0, 1.0]";
                    return refuse(&up.span(), &"`up` has no length", remedy);
                };
                (Pose::Up(v), up.span())
            }
            (None, Some(poses)) => {
                if *poses.get_ref() == 0 {
                    return refuse(&poses.span(), &"`poses` is 0", "give one or more");
                }
                (Pose::Many(*poses.get_ref()), poses.span())
            }
            (Some(_), Some(poses)) => {
                return refuse(
                    &poses.span(),
                    &"`up` and `poses` in one entry",
                    "keep one of them",
                );
            }
            (None, None) => {
                let remedy = "add the body direction that points up, or `poses = ...`";
                return refuse(&at, &"`up` is missing", remedy);
            }
        };
        let dwell_s = match (&turn, &raw.dwell_s) {
            (Some(turn), _) => turn.angle.abs() / turn.rate,
            (None, Some(dwell_s)) => *dwell_s.get_ref(),
            (None, None) => {
                let remedy = "add `dwell_s = ...`, in seconds";
                return refuse(&at, &"`dwell_s` is missing", remedy);
            }
        };
        if !(dwell_s.is_finite() && dwell_s * sample_rate_hz >= 1.0) {
            let problem = match turn {
                Some(_) => format!("the turn takes {} s", written(dwell_s)),
                None => format!("`dwell_s` is {}", written(dwell_s)),
            };
            return refuse(
                &place(raw.dwell_s.as_ref().map(Spanned::span)),
                &problem,
                "give the dwell in seconds, a sample or longer",
            );
        }
        let repeat = raw.repeat.as_ref().map_or(1, |r| *r.get_ref());
        if let Some(r) = &raw.repeat
            && repeat == 0
        {
            return refuse(
                &r.span(),
                &"`repeat` is 0",
                "give one or more, or remove the entry",
            );
        }
        Ok(Step {
            pose,
            heading: match &raw.heading_deg {
                Some(_) => Some(self.angle("heading_deg", &raw.heading_deg, 360.0, "degrees")?),
                None => None,
            },
            rate: self.angle("rate_dps", &raw.rate_dps, FASTEST_DPS, "degrees per second")?,
            spin: self.angle("spin_dps", &raw.spin_dps, FASTEST_DPS, "degrees per second")?,
            turn,
            dwell_s,
            repeat,
            at: Places {
                heading: place(raw.heading_deg.as_ref().map(Spanned::span)),
                rate: place(raw.rate_dps.as_ref().map(Spanned::span)),
                spin: place(
                    raw.spin_dps
                        .as_ref()
                        .or(raw.rate_dps.as_ref())
                        .map(Spanned::span),
                ),
                pose: pose_at,
            },
        })
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
