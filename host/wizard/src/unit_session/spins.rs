//! Whole turns of a unit: counted while they last, and judged where it is put back, so that the person can complete or repeat them.

use std::f64::consts::TAU;

use mimu::signal::stillness::STILL_FACTOR;
use mimu::spun::{End, Spun, is_clipped};
use mimu::{Prepared, significant};
use mimu_recording::error::Result;
use mimu_recording::health::Fault;
use nalgebra::Vector3;

use super::rows::part;
use super::{Dwell, Round, UnitSession};
use crate::event::Event;
use crate::folder::Entry;
use crate::source::Chunk;
use crate::spin::{Spin, SpinState};
use crate::waiting::Waiting;
use crate::watch::LastSecond;
use mimu_equipment::step::Step;

/// Fewest turns before a rest may be the end of a spin: less is how a unit is taken up.
const BEGUN: f64 = 0.75;
/// Share of the turns asked for from which a spin counts although some are missing.
const ENOUGH: f64 = 0.8;
/// Rests in a row, without a movement in between, after which a person has heard what is wrong, and leaves it so.
const INSISTS: u32 = 2;
/// A turn is told this much before it is complete: the sum of a wobbling turn is short by up to 2 %.
const TOLD: f64 = 0.1;
/// Cosine of the largest angle between the axis of a spin and that of the unit that it counts for.
const NEAR_AXIS: f64 = 0.9;
/// Hands turn unevenly: their mean rate has to stay below the range by this factor.
const UNEVEN: f64 = 1.75;

/// The spin that is asked for.
#[derive(Debug, Clone)]
pub(super) struct Spinning {
    asked: Spin,
    /// The rest that it begins from, once there is one.
    from: Option<Start>,
}

/// The rest before a spin, and what has happened since.
#[derive(Debug, Clone)]
struct Start {
    /// Number of the dwell.
    number: i32,
    up: Vector3<f64>,
    /// Gyro at rest, raw.
    at_rest: Vector3<f64>,
    /// Sum of the turns since, rad, body axes.
    turned: Vector3<f64>,
    /// Fastest rate since, rad/s.
    fastest: f64,
    /// Whole turns told so far.
    told: u32,
    /// Why the spin cannot be used, and whether that was told.
    lost: Option<(String, bool)>,
    /// Rests in a row that were not its end.
    stopped: u32,
}

impl Start {
    fn turns(&self) -> f64 {
        self.turned.norm() / TAU
    }

    /// Whether a rest with `up` is on another side than this one.
    fn is_left(&self, up: &Vector3<f64>, limit_deg: f64) -> bool {
        self.up.angle(up).to_degrees() > limit_deg
    }

    /// The axis of the turns so far, with its sign.
    fn axis(&self) -> Spin {
        let axis = self.turned.iamax();
        let turns = self.turned[axis].signum() as i32;
        Spin { axis, turns }
    }
}

/// What a rest after a spin is.
enum Rested {
    /// The end of a spin that counts.
    Done(Spin),
    /// Not its end yet, and why.
    Not(Waiting),
    /// The end of one that cannot be used, and why.
    Lost(String),
}

impl UnitSession {
    /// A spin is asked for. The rest after the one before may be where it begins; it can then be turned at once.
    pub fn ask_for_spin(&mut self, asked: Spin, limit_deg: f64) -> Option<Event> {
        let before = self.spin.take().and_then(|spin| spin.from);
        let upright = |up: &Vector3<f64>| up.angle(&asked.about()).to_degrees() <= limit_deg;
        let from = before.filter(|from| upright(&from.up) && from.turns() < BEGUN);
        self.spin = Some(Spinning { asked, from });
        self.asked_for();
        self.show_spin();
        self.to_turn()
    }

    /// The present spin begins anew, from another rest.
    pub fn restart_spin(&mut self) {
        if let Some(spin) = &mut self.spin {
            spin.from = None;
        }
        self.show_spin();
    }

    /// No more spins are asked for.
    pub fn end_spins(&mut self) {
        self.spin = None;
        self.show_spin();
    }

    /// Whether whole turns are asked for now.
    pub fn spins(&self) -> bool {
        self.spin.is_some()
    }

    /// Whether the poses so far determine the gyro, so that its turns can be counted.
    pub fn can_count(&self) -> bool {
        self.fitted.is_some()
    }

    fn show_spin(&mut self) {
        self.state.spin = self.spin.as_ref().map(|spin| SpinState {
            axis: spin.asked.name(),
            asked: spin.asked.turns.unsigned_abs(),
            turns: spin.from.as_ref().map(Start::turns),
        });
    }

    /// Adds received samples to the present spin.
    pub(super) fn count_turns(&mut self, chunk: &Chunk) {
        let Some([gyro, _]) = &self.fitted else {
            return;
        };
        let (c, missing) = (gyro.inverse.matrix, self.turn_missing);
        let period_s = 1.0 / self.station.unit.rate_hz;
        let Some(from) = self.spin.as_mut().and_then(|spin| spin.from.as_mut()) else {
            return;
        };
        for row in &chunk.values {
            let rate = c * (Vector3::new(row[0], row[1], row[2]) - from.at_rest);
            from.turned += rate * period_s;
            from.fastest = from.fastest.max(rate.norm());
        }
        if missing > 0 {
            let why = format!("{missing} samples of it are missing");
            from.lost.get_or_insert((why, false));
        }
        if chunk.saturated {
            let why = too_fast(from.fastest);
            from.lost.get_or_insert((why, false));
        }
        self.show_spin();
    }

    /// Tells the turns that have been completed since the last call, and at once why they are in vain.
    pub(super) fn tell_turns(&mut self, tell: &mut Vec<Event>) {
        let unit = self.name();
        let Some(from) = self.spin.as_mut().and_then(|spin| spin.from.as_mut()) else {
            return;
        };
        let turns = (from.turns() + TOLD) as u32;
        match &mut from.lost {
            Some((_, true)) => {}
            Some((why, told)) => {
                *told = true;
                let why = why.clone();
                tell.push(Event::SpinLost { unit, why });
            }
            None if turns > from.told => {
                from.told = turns;
                let axis = from.axis().name();
                tell.push(Event::Turned { unit, axis, turns });
            }
            None => {}
        }
    }

    /// The line was interrupted: a spin that was under way is lost.
    pub(super) fn interrupt_spin(&mut self, tell: &mut Vec<Event>) {
        let unit = self.name();
        let Some(from) = self.spin.as_mut().and_then(|spin| spin.from.take()) else {
            return;
        };
        if from.turns() > BEGUN {
            let why = "the samples were interrupted".into();
            tell.push(Event::SpinLost { unit, why });
        }
    }

    /// The rest that this pose may be; see [`UnitSession::pose`].
    pub(super) fn spin_pose(
        &self,
        spin: &Spinning,
        up: &Vector3<f64>,
        round: &Round<'_>,
        step: &Step,
    ) -> std::result::Result<Step, Waiting> {
        let limit_deg = round.config.fixture.tolerance_deg();
        let off = up.angle(&spin.asked.about()).to_degrees();
        match &spin.from {
            None if off > limit_deg => Err(Waiting::WrongPose(*up, off)),
            Some(from)
                if from.lost.is_none() && from.turns() < BEGUN && !from.is_left(up, limit_deg) =>
            {
                Err(Waiting::ToSpin)
            }
            _ => Ok(Step::at_rest(*up, step.dwell_s)),
        }
    }

    /// A motion while it is turned is what was asked for.
    pub(super) fn while_turning(&mut self, why: Waiting) -> Waiting {
        let Some(spin) = &mut self.spin else {
            return why;
        };
        let Some(from) = &mut spin.from else {
            return why;
        };
        match why {
            Waiting::Moves(..) | Waiting::Turns(_) => {}
            Waiting::Faulty(found) if found.fault == Fault::AtEnd => {}
            other => return other,
        }
        from.stopped = 0;
        Waiting::Spinning
    }

    /// Whether it is being turned, so that a short rest is none to tell of.
    pub(super) fn is_turned(&self) -> bool {
        self.spin.as_ref().is_some_and(|spin| spin.from.is_some())
    }

    /// The unit has rested for a dwell before or after a spin.
    pub(super) fn rested(
        &mut self,
        dwell: Dwell,
        to: u64,
        seen: &LastSecond,
        round: &Round<'_>,
        tell: &mut Vec<Event>,
    ) -> Result<()> {
        let limit_deg = round.config.fixture.tolerance_deg();
        let up = dwell.step.up();
        let rested = match self.spin.as_ref().and_then(|spin| spin.from.as_ref()) {
            None => None,
            Some(from) if from.lost.is_some() => None,
            Some(from) if from.is_left(&up, limit_deg) => {
                let why = "it rests on another side than before";
                (from.turns() > BEGUN).then(|| Rested::Lost(why.into()))
            }
            Some(from) => Some(self.judge_rest(&dwell, to, from)),
        };
        match &rested {
            Some(Rested::Not(why)) => {
                (self.dwell, self.state.left_s) = (None, None);
                self.state.waiting = Some(why.clone());
                let (unit, why) = (self.name(), why.clone());
                if let Some(from) = self.spin.as_mut().and_then(|s| s.from.as_mut()) {
                    if from.stopped == 0 {
                        tell.push(Event::Waiting { unit, why });
                    }
                    from.stopped += 1;
                }
                return Ok(());
            }
            Some(Rested::Lost(why)) => {
                let (unit, why) = (self.name(), why.clone());
                tell.push(Event::SpinLost { unit, why });
            }
            _ => {}
        }
        let stands = |spin: &Spinning| up.angle(&spin.asked.about()).to_degrees() <= limit_deg;
        if !matches!(rested, Some(Rested::Done(_))) && !self.spin.as_ref().is_some_and(stands) {
            // Not where it can begin anew.
            (self.dwell, self.state.left_s) = (None, None);
            self.restart_spin();
            return Ok(());
        }
        let number = self.number;
        self.accept(dwell, to, seen, round, tell)?;
        if let Some(spin) = &mut self.spin {
            spin.from = Some(Start {
                number,
                up,
                at_rest: Vector3::new(seen.mean[0], seen.mean[1], seen.mean[2]),
                turned: Vector3::zeros(),
                fastest: 0.0,
                told: 0,
                lost: None,
                stopped: 0,
            });
        }
        match rested {
            Some(Rested::Done(made)) => self.made(made, number, tell)?,
            _ => tell.extend(self.to_turn()),
        }
        self.show_spin();
        Ok(())
    }

    /// Tells that it is to be turned, if it has rested.
    fn to_turn(&self) -> Option<Event> {
        let spin = self.spin.as_ref().filter(|spin| spin.from.is_some())?;
        Some(Event::Turned {
            unit: self.name(),
            axis: spin.asked.name(),
            turns: 0,
        })
    }

    /// Keeps a spin in the journal.
    fn made(&mut self, made: Spin, number: i32, tell: &mut Vec<Event>) -> Result<()> {
        let part = self.part;
        self.folder.add(Entry::Spin {
            part,
            number,
            spin: made,
        })?;
        let unit = self.name();
        tell.push(Event::Spun {
            unit,
            part,
            axis: made.name(),
            turns: made.turns.unsigned_abs(),
        });
        self.done = true;
        Ok(())
    }

    /// What the rest `dwell` until `to` is to the spin that began at `from`.
    fn judge_rest(&self, dwell: &Dwell, to: u64, from: &Start) -> Rested {
        let spun = match self.spun(dwell, to, from) {
            Ok(spun) => spun,
            Err(why) => return Rested::Lost(why),
        };
        let asked = self.spin.as_ref().map(|spin| spin.asked.turns);
        let wanted = asked.unwrap_or_default().unsigned_abs();
        let insists = from.stopped + 1 >= INSISTS;
        let missing = spun.turns + 0.5 < f64::from(wanted);
        match spun.end {
            End::Whole if missing && !(insists && spun.turns > ENOUGH * f64::from(wanted)) => {
                Rested::Not(Waiting::TurnsMissing(spun.turns, wanted))
            }
            End::Whole => match along(&spun) {
                Some(made) => Rested::Done(made),
                None => Rested::Lost("it was about no axis of the unit".into()),
            },
            End::Off(_) if missing => Rested::Not(Waiting::TurnsMissing(spun.turns, wanted)),
            End::Off(off) if !insists => Rested::Not(Waiting::NotPutBack(off.to_degrees())),
            End::Off(off) => Rested::Lost(format!(
                "it lies {} deg from where it lay",
                significant(off.to_degrees())
            )),
            End::Open => Rested::Lost(
                "the gyro's scale factor is not known well enough to count its turns".into(),
            ),
        }
    }

    /// The turn between the rest `from` and this one, or why it cannot be used.
    fn spun(&self, dwell: &Dwell, to: u64, from: &Start) -> std::result::Result<Spun, String> {
        let unusable = || "its rests cannot be used".to_string();
        let (Some(recording), Some([gyro, accel])) = (&self.recording, &self.fitted) else {
            return Err(unusable());
        };
        let all = &recording.samples;
        let others = |step: &i32| *step != -1 && *step != from.number;
        let first = all.step.iter().rposition(others).map_or(0, |at| at + 1);
        let mut rows = part(all, first..all.len());
        let mut ends = part(&self.pending.rows, 0..self.pending.before(to));
        let begin = self.pending.before(dwell.from);
        ends.step[begin..].fill(self.number);
        ends.reference = Default::default();
        rows.append(&ends, 0..ends.len());
        let prepared = Prepared::of(recording.manifest().clone(), &rows, STILL_FACTOR)
            .map_err(|error| error.to_string())?;
        match prepared.spun(gyro, &accel.inverse) {
            Ok(spun) => spun.ok_or_else(unusable),
            Err(why) if is_clipped(&why) => Err(too_fast(from.fastest)),
            Err(why) => Err(why.to_string()),
        }
    }
}

/// The axis of the unit that the turns were about, if they were about one.
fn along(spun: &Spun) -> Option<Spin> {
    let axis = spun.axis.iamax();
    let turns = (spun.turns * spun.axis[axis].signum()).round() as i32;
    (spun.axis[axis].abs() >= NEAR_AXIS).then_some(Spin { axis, turns })
}

/// The gyro's range was reached at a rate of about `fastest`, rad/s.
fn too_fast(fastest: f64) -> String {
    let per_turn_s = UNEVEN * TAU / fastest.max(f64::MIN_POSITIVE);
    format!(
        "it reached the end of the gyro's range, {} deg/s: take {per_turn_s:.1} s or more for each turn",
        significant(fastest.to_degrees())
    )
}
