//! The sequence of a procedure: marks of dwells and turns in the recording, orders for motions and temperatures.
//!
//! All times are the device's. A dwell begins when the table has arrived, and a turn lasts from rest to rest. A table slower than the plan therefore
//! makes the procedure longer, and no input wrong.

use std::time::Instant;

use mimu::plan::Planned;
use mimu_device::record::{Procedure, RecordingState};

use super::equipment::Order;
use crate::step::Step;

/// Interval between two settings of the chamber, s: at 5 K/min, successive temperatures differ by less than a chamber's control error.
const SET_EVERY_S: f64 = 5.0;
/// Least change of temperature that is sent to the chamber, K.
const SET_LEAST_C: f64 = 0.005;
/// Largest deviation of the chamber from the plan's first temperature when the plan begins, K.
const NEAR_C: f64 = 1.0;
/// Time, s, during which older samples may still arrive after the table reports completion: a batch, the line and a busy PC.
const ON_THE_WAY_S: f64 = 0.5;

/// State of recording and equipment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// Time by [`Sequence::clock`], s.
    pub now_s: f64,
    /// No samples arrive: no dwell begins or ends, but the chamber continues.
    pub line_lost: bool,
    /// The table has completed all orders.
    pub arrived: bool,
    /// Temperature of the chamber, °C, if it can be read.
    pub chamber_c: Option<f64>,
}

/// Actions that follow.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Actions {
    /// Dwells that end or begin with the next sample.
    pub marks: u32,
    pub orders: Vec<Order>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// The table moves to its first pose, and the chamber to its first temperature.
    Approach,
    /// The dwell is not yet due.
    Due,
    /// The table moves to the dwell's pose.
    Moving,
    /// It has arrived, but samples from before may still arrive.
    Arrived {
        until_s: f64,
    },
    Dwell {
        until_s: f64,
    },
    Turn,
    /// The turn is complete, but as in [`Phase::Arrived`].
    Turned {
        until_s: f64,
    },
    Done,
}

/// A procedure being carried out.
#[derive(Debug)]
pub(super) struct Sequence<'a> {
    procedure: &'a Procedure,
    has_table: bool,
    has_chamber: bool,
    phase: Phase,
    /// Index of the running or the next dwell.
    at: usize,
    /// Last state ordered of the table: up, and rate, deg/s.
    stands: Option<([f64; 3], f64)>,
    /// When the procedure began, s.
    zero_s: Option<f64>,
    /// The last temperature that was set, and when.
    set: Option<(f64, f64)>,
    set_points: usize,
    /// Time of the last sample, and when it was received.
    heard: (f64, Instant),
}

impl<'a> Sequence<'a> {
    pub fn new(procedure: &'a Procedure, has_table: bool, has_chamber: bool) -> Self {
        Self {
            procedure,
            has_table,
            has_chamber,
            phase: Phase::Approach,
            at: 0,
            stands: None,
            zero_s: None,
            set: None,
            set_points: 0,
            heard: (0.0, Instant::now()),
        }
    }

    /// The device's time, s: that of the last sample and, if the line is lost, the time that has passed here since.
    pub fn clock(&mut self, state: &RecordingState) -> f64 {
        let last_s = state.last_s.unwrap_or_default();
        if last_s != self.heard.0 {
            self.heard = (last_s, Instant::now());
        }
        match state.waiting {
            true => last_s + self.heard.1.elapsed().as_secs_f64(),
            false => last_s,
        }
    }

    /// The running dwell or turn.
    pub fn running(&self) -> Option<usize> {
        let runs = matches!(
            self.phase,
            Phase::Dwell { .. } | Phase::Turn | Phase::Turned { .. }
        );
        runs.then_some(self.at)
    }

    /// Number of completed dwells and turns.
    pub fn done(&self) -> usize {
        self.at
    }

    pub fn set_points(&self) -> usize {
        self.set_points
    }

    /// Time since the procedure began, s; `None` until the chamber has reached the first temperature.
    pub fn since_s(&self) -> Option<f64> {
        self.zero_s.map(|zero_s| self.heard.0 - zero_s)
    }

    pub fn look(&mut self, seen: &Seen) -> Actions {
        let mut actions = Actions::default();
        self.lead(seen, &mut actions);
        // Phases that need no motion follow at once. After an order to the table, its completion is awaited.
        let moves = |order: &Order| !matches!(order, Order::Set(_));
        while !seen.line_lost
            && !actions.orders.iter().any(moves)
            && self.advance(seen, &mut actions)
        {}
        actions
    }

    /// Sets the chamber to its planned temperature.
    fn lead(&mut self, seen: &Seen, actions: &mut Actions) {
        if !self.has_chamber || self.set.is_some_and(|s| seen.now_s < s.1 + SET_EVERY_S) {
            return;
        }
        let t_s = self.zero_s.map_or(0.0, |zero_s| seen.now_s - zero_s);
        let temp_c = self.procedure.temp_c(t_s);
        let told = self.set.map(|s| s.0);
        if told.is_some_and(|told| (temp_c - told).abs() < SET_LEAST_C) {
            return;
        }
        actions.orders.push(Order::Set(temp_c));
        self.set = Some((temp_c, seen.now_s));
        self.set_points += 1;
    }

    /// Advances by one phase. Returns whether there is more to do now.
    fn advance(&mut self, seen: &Seen, actions: &mut Actions) -> bool {
        let now_s = seen.now_s;
        match self.phase {
            Phase::Approach => return self.approach(seen, actions),
            Phase::Due => {
                let Some(dwell) = self.procedure.dwells.get(self.at) else {
                    self.phase = Phase::Done;
                    return false;
                };
                if self.since(now_s) < self.procedure.due_s(self.at).max(ON_THE_WAY_S) {
                    // The table turns only during dwells.
                    if let Some((up, rate)) = self.stands
                        && rate != 0.0
                    {
                        actions.orders.push(Order::Halt);
                        self.stands = Some((up, 0.0));
                    }
                    return false;
                }
                match self.motion_to(dwell) {
                    Some(order) => {
                        actions.orders.push(order);
                        self.phase = Phase::Moving;
                        return false;
                    }
                    None if !seen.arrived => return false,
                    None => self.begin(now_s, actions),
                }
            }
            Phase::Moving if seen.arrived => {
                let until_s = now_s + ON_THE_WAY_S;
                self.phase = Phase::Arrived { until_s };
            }
            Phase::Arrived { until_s } if now_s >= until_s => self.begin(now_s, actions),
            Phase::Turn if seen.arrived => {
                let until_s = now_s + ON_THE_WAY_S;
                self.phase = Phase::Turned { until_s };
            }
            Phase::Dwell { until_s } | Phase::Turned { until_s } if now_s >= until_s => {
                actions.marks += 1;
                self.at += 1;
                self.phase = Phase::Due;
            }
            _ => return false,
        }
        true
    }

    /// Approaches the first pose and the first temperature. The plan begins once both are reached.
    fn approach(&mut self, seen: &Seen, actions: &mut Actions) -> bool {
        let first = &self.procedure.dwells[0];
        if self.has_table && self.stands.is_none() {
            let up = first.turn.map_or(first.up, |turn| Some(turn.from_up));
            let up = up.unwrap_or([0.0, 0.0, 1.0]);
            actions.orders.push(go(up, 0.0, 0.0));
            self.stands = Some((up, 0.0));
            return false;
        }
        let first_c = self.procedure.temp_c(0.0);
        let is_near = |c: f64| (c - first_c).abs() <= NEAR_C;
        if !seen.arrived || !seen.chamber_c.is_none_or(is_near) {
            return false;
        }
        self.zero_s = Some(seen.now_s);
        self.phase = Phase::Due;
        true
    }

    fn since(&self, now_s: f64) -> f64 {
        now_s - self.zero_s.unwrap_or(now_s)
    }

    /// The motion to the pose or rate of a dwell or a turn, unless the table is there already.
    fn motion_to(&mut self, dwell: &Planned) -> Option<Order> {
        if !self.has_table {
            return None;
        }
        let (up, rate) = match (&dwell.turn, dwell.up) {
            (Some(turn), _) => (turn.from_up, 0.0),
            (None, up) => (up?, dwell.rate_dps),
        };
        let (stood, turned) = self.stands?;
        let same = stood.iter().zip(&up).all(|(a, b)| (a - b).abs() < 1e-9);
        if same && rate == turned {
            return None;
        }
        self.stands = Some((up, rate));
        Some(match same && rate == 0.0 {
            true => Order::Halt,
            false => go(up, rate, dwell.length.as_secs_f64()),
        })
    }

    /// Begins the dwell or the turn.
    fn begin(&mut self, now_s: f64, actions: &mut Actions) {
        let dwell = &self.procedure.dwells[self.at];
        actions.marks += 1;
        self.phase = match &dwell.turn {
            Some(turn) => {
                actions.orders.push(Order::Turn(*turn));
                self.stands = Some((turn.to_up, 0.0));
                Phase::Turn
            }
            None => Phase::Dwell {
                until_s: now_s + dwell.length.as_secs_f64(),
            },
        };
    }
}

fn go(up: [f64; 3], rate_dps: f64, dwell_s: f64) -> Order {
    Order::Go(Step {
        up,
        rate_dps,
        dwell_s,
    })
}

#[cfg(test)]
mod tests;
