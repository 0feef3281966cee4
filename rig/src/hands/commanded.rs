//! A person under command, pose by pose.

use super::choice::{Turn, between, chosen};
use super::{Hands, HandsTruth};
use crate::command::{Command, Commanded, Position};
use crate::flaws::direction;
use crate::plan::{Plan, Pose, Step};
use crate::random::Random;
use crate::rotation::Vector;

/// Assumed length of a dwell whose end is not announced, s: a knock falls within it. As in the plan of 38 poses.
const DWELL_S: f64 = 4.0;

/// A hand that moves in a pose does so within this time after it has come to rest, s, while a short dwell still lasts.
const FIDGET_AFTER_S: [f64; 2] = [1.0, 3.0];

/// And it turns the unit by this angle, degrees: as much as a pose misses its target, and far more than tremor.
const FIDGET_DEG: [f64; 2] = [3.0, 8.0];

/// State of a person under command.
#[derive(Debug, Clone)]
pub(super) struct CommandState {
    truth: HandsTruth,
    random: Random,
    /// Separate stream for a hand that moves in a pose, so that all else is unchanged.
    fidget: Random,
    /// The hand moves in every so many-th pose, 0 is never; and the number of poses since this command.
    every: u32,
    poses: u32,
    lead_in_s: f64,
    busy_s: f64,
}

impl Hands {
    /// The person `truth` with the unit in the first pose of `plan`, whose steps are not carried out. Commands during the lead-in wait for its end.
    /// The seed determines all random choices.
    pub fn commanded(plan: &Plan, truth: &HandsTruth, seed: u64) -> Result<Self, String> {
        truth.check()?;
        let mut random = Random::new(seed, "hands");
        let mut hands = Self::of(plan, truth, &mut random);
        let (up, heading) = match plan.steps.first() {
            Some(first) => (
                match first.pose {
                    Pose::Up(up) => Some(up),
                    Pose::Many(count) => chosen(count, &mut random).first().copied(),
                    Pose::Here => None,
                },
                first.heading,
            ),
            None => (None, None),
        };
        let up = up.unwrap_or([0.0, 0.0, 1.0]);
        let step = Step::commanded(up, heading, DWELL_S);
        let first = Turn::draw(None, plan.lead_in_s, &step, up, truth, &mut random);
        hands.turns = vec![first];
        hands.duration_s = f64::INFINITY;
        hands.commanded = Some(CommandState {
            truth: truth.clone(),
            random,
            fidget: Random::new(seed, "fidget"),
            every: 0,
            poses: 0,
            lead_in_s: plan.lead_in_s,
            busy_s: 0.0,
        });
        Ok(hands)
    }

    /// Discards every turn that has not begun at `t_s`. Returns the current turn, or the last one.
    fn drop_pending(&mut self, t_s: f64) -> Option<Turn> {
        // The first begins at 0.
        while self.turns.len() > 1 && self.turns[self.turns.len() - 1].start_s > t_s {
            self.turns.pop();
        }
        self.turns.last().cloned()
    }
}

impl CommandState {
    /// The turn to a pose, after the end of `last`, and the motion of the hand in that pose, if any.
    fn turns(
        &mut self,
        last: &Turn,
        t_s: f64,
        up: Vector,
        heading: Option<f64>,
    ) -> (Turn, Option<Turn>) {
        let (truth, random) = (&self.truth, &mut self.random);
        let free_s = t_s.max(last.arrived_s()).max(self.lead_in_s);
        let at_s = last.may_leave_s(free_s + between(truth.pause_s, random), truth.jolt_s);
        let step = Step::commanded(up, heading, DWELL_S);
        let turn = Turn::draw(Some(last), at_s, &step, up, truth, random);
        self.busy_s = turn.dwell[0];
        self.poses += 1;
        let moves = self.every > 0 && self.poses.is_multiple_of(self.every);
        let fidget = moves.then(|| {
            let after_s = turn.dwell[0] + between(FIDGET_AFTER_S, &mut self.fidget);
            let start_s = turn.may_leave_s(after_s, truth.jolt_s);
            let turn_s = between(truth.turn_s, &mut self.fidget);
            Turn {
                start_s,
                turn_s,
                from: turn.aim(),
                axis: direction(&mut self.fidget),
                angle: between(FIDGET_DEG, &mut self.fidget).to_radians(),
                wander: [0.0; 2],
                position: [turn.position[1]; 2],
                lift: 0.0,
                dwell: [start_s + turn_s, f64::INFINITY],
                held: [turn.held[1]; 2],
                jolt: None,
                ..turn.clone()
            }
        });
        (turn, fidget)
    }
}

impl Turn {
    /// The first time from `t_s` on at which the next turn may begin without cutting a knock short.
    fn may_leave_s(&self, t_s: f64, jolt_s: f64) -> f64 {
        match self.jolt {
            Some(jolt) if jolt.start_s < t_s => t_s.max(jolt.start_s + jolt_s),
            _ => t_s,
        }
    }
}

impl Commanded for Hands {
    fn command(&mut self, t_s: f64, command: Command) -> Result<(), String> {
        let Some(mut commanded) = self.commanded.take() else {
            return Err("the person carries out a plan; serve a bench under command".into());
        };
        let mut done = Ok(());
        match command {
            Command::Move { up, heading } => {
                if let Some(last) = self.drop_pending(t_s) {
                    let (turn, fidget) = commanded.turns(&last, t_s, up, heading);
                    self.turns.push(turn);
                    self.turns.extend(fidget);
                }
            }
            Command::Stop => {
                // A turn that has begun is completed.
                if let Some(last) = self.drop_pending(t_s) {
                    commanded.busy_s = commanded.busy_s.min(last.dwell[0].max(t_s));
                }
            }
            Command::Rate(_) | Command::Spin(_) | Command::Turn(_) => {
                let problem =
                    "by hand a person cannot turn at a constant rate; serve a bench with a table";
                done = Err(problem.into());
            }
            Command::Fidget(every) => (commanded.every, commanded.poses) = (every, 0),
            Command::Hold(held) => commanded.truth.held = held,
        }
        self.commanded = Some(commanded);
        done
    }

    fn busy(&self, t_s: f64) -> bool {
        self.commanded
            .as_ref()
            .is_some_and(|commanded| t_s < commanded.busy_s)
    }

    fn position(&self, _: f64) -> Position {
        let last = self.turns.last();
        Position {
            up: last.map_or([0.0, 0.0, 1.0], |turn| turn.up),
            heading: last.and_then(|turn| turn.heading),
        }
    }
}
