//! Controller of a table: the angles of a pose, and the motions of each axis.

use std::f64::consts::{PI, TAU};

use super::truth::TableTruth;
use crate::axis::{Axis, nearest_turn};
use crate::plan::{Beyond, Limits, Plan, Pose, Step, TableAxis, Turn, UPRIGHT, attitude, tilt};
use crate::rotation::{Rotation, Vector};

pub(super) const OUTER: usize = 0;
pub(super) const MIDDLE: usize = 1;
pub(super) const INNER: usize = 2;

/// A dwell: start and end, s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dwell {
    pub(super) start_s: f64,
    pub(super) end_s: f64,
    /// Whether it is a turn by an angle: the encoder ends it, so rate errors do not affect it.
    pub(super) by_angle: bool,
}

/// Carries out steps by appending to the axes' commands.
#[derive(Debug, Clone)]
pub(super) struct Controller {
    truth: TableTruth,
    pub(super) limits: Limits,
    lead_in_s: f64,
    pub(super) axes: [Axis; 3],
    pub(super) dwells: Vec<Dwell>,
    /// Whether it has turned by an angle and the load has not yet had time to settle.
    unsettled: bool,
    /// Under command: last commanded rates about the vertical and about the inner axis, rad/s.
    pub(super) rates: [f64; 2],
    /// End of the last commanded move, s, and the time at which the load has settled.
    pose_s: f64,
    settled_s: f64,
    /// End of all commanded motion, s.
    pub(super) busy_s: f64,
}

impl Controller {
    /// Carries out a whole plan within the table's limits.
    pub(super) fn carry_out(plan: &Plan, truth: &TableTruth) -> Result<Self, Beyond> {
        let mut controller = Self::new(plan, truth);
        for round in 0..plan.rounds {
            if let Some(round_s) = plan.round_s {
                controller.await_round(plan, round, round_s)?;
            }
            for step in &plan.steps {
                match (step.turn, step.pose) {
                    (Some(turn), _) => controller.turn_by(step, turn)?,
                    (None, Pose::Up(up)) => controller.step(step, Some(up)),
                    (None, Pose::Here) => controller.step(step, None),
                    (None, Pose::Many(count)) => {
                        for up in spread(count, &truth.limits()) {
                            controller.step(step, Some(up));
                        }
                    }
                }
            }
        }
        Ok(controller)
    }

    /// Waits in its pose until a round is due.
    fn await_round(&mut self, plan: &Plan, round: u32, round_s: f64) -> Result<(), Beyond> {
        let due_s = self.lead_in_s + f64::from(round) * round_s;
        if round == 0 {
            return Ok(());
        }
        // The ends of dwells are sums: an excess by a rounding error is ignored.
        if self.now() > due_s + 1e-6 {
            let problem = format!(
                "round {round} is due at {due_s} s, but the one before ends at {:.1} s",
                self.now()
            );
            return Err(Beyond::rounds(plan, problem, "give `round_s` more"));
        }
        self.hold((due_s - self.now()).max(0.0));
        Ok(())
    }

    /// At rest in the first pose of a plan, within the table's limits, waiting for commands.
    pub(super) fn standing(plan: &Plan, truth: &TableTruth) -> Result<Self, Beyond> {
        let mut controller = Self::new(plan, truth);
        if let Some(first) = plan.steps.first() {
            let mut at_rest = first.clone();
            (at_rest.rate, at_rest.spin) = (0.0, 0.0);
            controller.limits.check(&at_rest)?;
            let up = match first.pose {
                Pose::Up(up) => Some(up),
                Pose::Many(count) => spread(count, &controller.limits).next(),
                Pose::Here => None,
            };
            if let Some(up) = up {
                controller.stand(up, first.heading);
            }
        }
        Ok(controller)
    }

    fn new(plan: &Plan, truth: &TableTruth) -> Self {
        Self {
            truth: truth.clone(),
            limits: truth.limits(),
            lead_in_s: plan.lead_in_s,
            axes: [0, 1, 2].map(|_| Axis::new(0.0, truth.settling)),
            dwells: Vec::new(),
            rates: [0.0; 2],
            unsettled: false,
            pose_s: 0.0,
            settled_s: 0.0,
            busy_s: 0.0,
        }
    }

    /// Starts in a pose.
    fn stand(&mut self, up: Vector, heading: Option<f64>) {
        let target = self.angles(up, heading.unwrap_or(0.0));
        self.axes = target.map(|angle| Axis::new(angle, self.truth.settling));
    }

    /// Moves to a pose, or stays. Returns the time at which the previous motion ended, s.
    fn pose(&mut self, up: Option<Vector>, heading: Option<f64>) -> f64 {
        let first = self.dwells.is_empty();
        let before = if first { self.lead_in_s } else { self.now() };
        match up {
            // The table is in the first pose when the recording begins.
            Some(up) if first => {
                self.stand(up, heading);
                self.hold(self.lead_in_s);
            }
            Some(up) => self.slew(up, heading),
            None => {}
        }
        self.hold(0.0);
        before
    }

    /// Waits for the load to settle, if anything has moved since `before`.
    fn settle(&mut self, before: f64) {
        if self.now() > before || self.unsettled {
            self.hold(self.truth.settle_s);
        }
        self.unsettled = false;
    }

    /// Moves to a pose, then turns one axis by an angle.
    fn turn_by(&mut self, step: &Step, turn: Turn) -> Result<(), Beyond> {
        let up = match step.pose {
            Pose::Up(up) => Some(up),
            Pose::Here | Pose::Many(_) => None,
        };
        let before = self.pose(up, step.heading);
        if self.now() > before {
            self.settle(before);
        }
        let i = turn.axis.number();
        let to = self.axes[i].end().0 + turn.angle;
        let refused = |(problem, remedy)| Beyond::step(step, problem, remedy);
        self.check_turn(turn, to).map_err(refused)?;
        let start_s = self.now();
        let acceleration = self.truth.max_acceleration_dps2[i].to_radians();
        self.axes[i].move_to(to, turn.rate, acceleration);
        self.hold(0.0);
        self.unsettled = true;
        self.dwells.push(Dwell {
            start_s,
            end_s: self.now(),
            by_angle: true,
        });
        Ok(())
    }

    /// Refuses a turn to an angle beyond the axis's range, or one that is too fast; returns problem and remedy.
    fn check_turn(&self, turn: Turn, to: f64) -> Result<(), (String, &'static str)> {
        let name = turn.axis.name();
        let fastest = self.truth.max_rate_dps[turn.axis.number()];
        let (problem, remedy) = if turn.axis == TableAxis::Outer && !self.limits.outer {
            let problem = "a turn about the outer axis, but the table has none".to_owned();
            (problem, "turn the inner axis upright and use that one")
        } else if turn.axis == TableAxis::Middle && !self.limits.reaches(to) {
            let [low, high] = self.limits.middle.map(f64::to_degrees);
            let problem = format!(
                "the turn ends with the middle axis at {:.1} degrees, but its range is {low:.1} to {high:.1}",
                to.to_degrees()
            );
            (problem, "turn less, or the other way")
        } else if turn.rate > fastest.to_radians() * (1.0 + 1e-12) {
            let problem = format!("`turn_dps` is more than the {name} axis's {fastest}");
            (problem, "slow down")
        } else {
            return Ok(());
        };
        Err((problem, remedy))
    }

    /// Pose, rates up, dwells, rates down. Between the dwells of one pose the rates continue. Without a pose the table stays.
    fn step(&mut self, step: &Step, up: Option<Vector>) {
        let before = self.pose(up, step.heading);
        let up = up.unwrap_or_else(|| self.position(self.now()).0);
        self.run(self.axis_rates([step.rate, step.spin], up));
        self.hold(0.0);
        self.settle(before);
        for _ in 0..step.repeat {
            let start_s = self.now();
            self.hold(step.dwell_s);
            self.dwells.push(Dwell {
                start_s,
                end_s: self.now(),
                by_angle: false,
            });
        }
        self.run([0.0; 3]);
        self.hold(0.0);
    }

    /// From rest to a pose at rest.
    fn slew(&mut self, up: Vector, heading: Option<f64>) {
        let target = self.angles(up, heading.unwrap_or(0.0));
        let slew = self.truth.slew_dps.map(f64::to_radians);
        let acceleration = self.truth.max_acceleration_dps2.map(f64::to_radians);
        for i in 0..3 {
            self.axes[i].move_to(target[i], slew[i], acceleration[i]);
        }
    }

    /// Every axis to a rate, rad/s.
    fn run(&mut self, rates: Vector) {
        for i in 0..3 {
            self.axes[i].run_up(
                rates[i] * (1.0 + 1e-6 * self.truth.rate_scale_ppm[i]),
                self.truth.max_acceleration_dps2[i].to_radians(),
            );
        }
    }

    /// Rate of each axis, for rates about the vertical and about the inner axis.
    fn axis_rates(&self, [rate, spin]: [f64; 2], up: Vector) -> Vector {
        if self.limits.outer {
            [rate, 0.0, spin]
        } else {
            // The check allows a rate about the vertical only if the inner axis is upright, in either direction.
            [0.0, 0.0, spin + rate * up[2].signum()]
        }
    }

    /// At `t_s` stops its motion, rates down first, and moves to a pose at rest, as between the steps of a plan.
    pub(super) fn go(&mut self, t_s: f64, up: Vector, heading: Option<f64>) {
        let from_s = t_s.max(self.lead_in_s);
        self.halt(from_s);
        self.slew(up, heading);
        self.hold(0.0);
        self.posed(from_s);
    }

    /// Stops at its position at `t_s`.
    pub(super) fn halt(&mut self, t_s: f64) {
        for axis in &mut self.axes {
            axis.cut(t_s);
        }
        self.run([0.0; 3]);
        self.hold(0.0);
        self.rates = [0.0; 2];
        self.posed(t_s);
    }

    /// Turns one axis by an angle from the present angles.
    pub(super) fn turn_from(&mut self, t_s: f64, turn: Turn) -> Result<(), (String, &'static str)> {
        // During a move the start of the turn would be undefined.
        if t_s < self.busy_s || self.rates != [0.0; 2] {
            let problem = "a turn by an angle starts from rest, but the table is moving".to_owned();
            return Err((problem, "send `STOP`, and wait until `BUSY?` is 0"));
        }
        let i = turn.axis.number();
        let to = self.axes[i].end().0 + turn.angle;
        self.check_turn(turn, to)?;
        let from_s = t_s.max(self.lead_in_s);
        self.halt(from_s);
        let acceleration = self.truth.max_acceleration_dps2[i].to_radians();
        self.axes[i].move_to(to, turn.rate, acceleration);
        self.hold(0.0);
        self.posed(from_s);
        Ok(())
    }

    /// Records the end of the motion commanded at `from_s`.
    fn posed(&mut self, from_s: f64) {
        self.pose_s = self.now();
        self.settled_s = self.settled_s(from_s);
        self.busy_s = self.settled_s;
    }

    /// Time at which the load has settled behind the axes, as before a dwell, if anything moves after `from_s`.
    fn settled_s(&self, from_s: f64) -> f64 {
        let moved = self.now() > from_s;
        self.now() + if moved { self.truth.settle_s } else { 0.0 }
    }

    /// Changes to rates about the vertical and about the inner axis, rad/s, from `t_s` on, or from the end of the current move.
    pub(super) fn turn(&mut self, t_s: f64, rates: [f64; 2]) {
        let from_s = t_s.max(self.lead_in_s).max(self.pose_s);
        for axis in &mut self.axes {
            axis.cut(from_s);
        }
        self.rates = rates;
        self.run(self.axis_rates(rates, self.position(from_s).0));
        self.hold(0.0);
        self.busy_s = self.settled_s.max(self.settled_s(from_s));
    }

    /// Position of its axes at a time, or at the end of the current move: up in body axes, and heading (rad).
    pub(super) fn position(&self, t_s: f64) -> (Vector, f64) {
        let t_s = t_s.max(self.pose_s);
        let [outer, middle, inner] = [0, 1, 2].map(|i| self.axes[i].angle(t_s));
        let (x, z) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let turned =
            Rotation::about(z, outer) * Rotation::about(x, middle) * Rotation::about(z, inner);
        let up = turned.inverse().turn(z);
        let (axis, angle) = (turned * attitude(up, 0.0).inverse()).axis_angle();
        (up, angle * axis[2].signum())
    }

    /// Time at which the last axis ends its motion, s.
    fn now(&self) -> f64 {
        self.axes.iter().map(Axis::end_s).fold(0.0, f64::max)
    }

    /// All axes continue unchanged for this long after the last one has finished.
    fn hold(&mut self, duration_s: f64) {
        let end_s = self.now() + duration_s;
        for axis in &mut self.axes {
            axis.hold_until(end_s);
        }
    }

    /// Angles for a pose and a heading. If there are two solutions, the one that takes less time.
    fn angles(&self, up: Vector, heading: f64) -> Vector {
        let from = [0, 1, 2].map(|i| self.axes[i].end().0);
        let (tilt, inner) = tilt(up);
        let upright = up[0].hypot(up[1]) < UPRIGHT;
        let ways = [(tilt, inner, heading), (-tilt, inner + PI, heading + PI)].map(
            |(middle, inner, outer)| {
                let reachable = self.limits.reaches(middle);
                let [outer, inner] = if self.limits.outer {
                    [outer, inner]
                } else if upright {
                    // The inner axis provides the heading; upside down it turns in the opposite direction.
                    [0.0, heading * up[2].signum()]
                } else {
                    [0.0, inner]
                };
                let angles = [
                    nearest_turn(outer, from[OUTER]),
                    middle,
                    nearest_turn(inner, from[INNER]),
                ];
                let time = (0..3)
                    .map(|i| (angles[i] - from[i]).abs() / self.truth.slew_dps[i])
                    .fold(0.0, f64::max);
                (if reachable { time } else { f64::INFINITY }, angles)
            },
        );
        if ways[1].0 < ways[0].0 {
            ways[1].1
        } else {
            ways[0].1
        }
    }
}

/// Directions of up, spread evenly over the range of the middle axis: a Fibonacci spiral, from inner axis upright downwards.
fn spread(count: u32, limits: &Limits) -> impl Iterator<Item = Vector> {
    let reach = limits.middle[1].max(-limits.middle[0]).min(PI);
    let lowest = reach.cos();
    let golden = TAU * (1.0 - 2.0 / (1.0 + 5f64.sqrt()));
    (0..count).map(move |k| {
        let z = 1.0 - (1.0 - lowest) * (f64::from(k) + 0.5) / f64::from(count);
        let (s, c) = (golden * f64::from(k)).sin_cos();
        let across = (1.0 - z * z).max(0.0).sqrt();
        [across * c, across * s, z]
    })
}
