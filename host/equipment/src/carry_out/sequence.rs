//! What comes next, and when: dwells and turns as marks in the recording, motions and temperatures as orders.
//!
//! All times are the device's. A dwell begins when the table has arrived, and a turn is from rest to rest, so that a table that is slower
//! than the plan makes the procedure longer and no input wrong.

use std::time::Instant;

use mimu::plan::Planned;
use mimu_device::record::{Procedure, Standing};

use super::equipment::Order;
use crate::step::Step;

/// Time between two temperatures that the chamber is set to, s: at 5 K/min they are less apart than a chamber holds.
const SET_EVERY_S: f64 = 5.0;
/// Change that is worth telling it, K.
const SET_LEAST_C: f64 = 0.005;
/// How near to the first temperature of the plan the chamber has to be at the beginning, K.
const NEAR_C: f64 = 1.0;
/// Time, s, during which older samples still arrive after the table reports that it is done: a batch, the line and a busy PC.
const ON_THE_WAY_S: f64 = 0.5;

/// How it stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// By [`Sequence::clock`], s.
    pub now_s: f64,
    /// No samples come: no dwell begins or ends, and the chamber continues.
    pub line_lost: bool,
    /// The table is done with all that was ordered.
    pub arrived: bool,
    /// °C, if the chamber can be asked.
    pub chamber_c: Option<f64>,
}

/// What is to be done about it.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Does {
    /// Dwells that end or begin with the next sample.
    pub marks: u32,
    pub orders: Vec<Order>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// The table goes to its first pose, and the chamber to its first temperature.
    Approach,
    /// The dwell is not yet due.
    Due,
    /// The table is on its way.
    Moving,
    /// It has arrived, and samples from before are on their way.
    Arrived {
        until_s: f64,
    },
    Dwell {
        until_s: f64,
    },
    Turn,
    /// It has turned, as [`Phase::Arrived`].
    Turned {
        until_s: f64,
    },
    Done,
}

/// A procedure on its way.
#[derive(Debug)]
pub(super) struct Sequence<'a> {
    procedure: &'a Procedure,
    has_table: bool,
    has_chamber: bool,
    phase: Phase,
    /// Dwell that runs, or is next.
    at: usize,
    /// What the table was brought to: up, and rate, deg/s.
    stands: Option<([f64; 3], f64)>,
    /// When the procedure began.
    zero_s: Option<f64>,
    /// The last temperature that was told, and when.
    set: Option<(f64, f64)>,
    set_points: usize,
    /// The last sample, and when it was heard.
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

    /// The device's time, s: of the last sample and, where none comes, as long after it as has passed here.
    pub fn clock(&mut self, standing: &Standing) -> f64 {
        let last_s = standing.last_s.unwrap_or_default();
        if last_s != self.heard.0 {
            self.heard = (last_s, Instant::now());
        }
        match standing.waiting {
            true => last_s + self.heard.1.elapsed().as_secs_f64(),
            false => last_s,
        }
    }

    /// The dwell or turn that runs.
    pub fn running(&self) -> Option<usize> {
        let runs = matches!(
            self.phase,
            Phase::Dwell { .. } | Phase::Turn | Phase::Turned { .. }
        );
        runs.then_some(self.at)
    }

    /// Dwells and turns that were had.
    pub fn done(&self) -> usize {
        self.at
    }

    pub fn set_points(&self) -> usize {
        self.set_points
    }

    /// Time since the procedure began, s; `None` while the chamber is on its way to the first temperature.
    pub fn since_s(&self) -> Option<f64> {
        self.zero_s.map(|zero_s| self.heard.0 - zero_s)
    }

    pub fn look(&mut self, seen: &Seen) -> Does {
        let mut does = Does::default();
        self.lead(seen, &mut does);
        // A dwell that ends is followed at once by what needs no motion; a motion that was just ordered has not been done.
        let moves = |order: &Order| !matches!(order, Order::Set(_));
        while !seen.line_lost && !does.orders.iter().any(moves) && self.advance(seen, &mut does) {}
        does
    }

    /// Leads the chamber along its temperatures.
    fn lead(&mut self, seen: &Seen, does: &mut Does) {
        if !self.has_chamber || self.set.is_some_and(|s| seen.now_s < s.1 + SET_EVERY_S) {
            return;
        }
        let t_s = self.zero_s.map_or(0.0, |zero_s| seen.now_s - zero_s);
        let temp_c = self.procedure.temp_c(t_s);
        let told = self.set.map(|s| s.0);
        if told.is_some_and(|told| (temp_c - told).abs() < SET_LEAST_C) {
            return;
        }
        does.orders.push(Order::Set(temp_c));
        self.set = Some((temp_c, seen.now_s));
        self.set_points += 1;
    }

    /// One phase on; whether there is more to be done now.
    fn advance(&mut self, seen: &Seen, does: &mut Does) -> bool {
        let now_s = seen.now_s;
        match self.phase {
            Phase::Approach => return self.approach(seen, does),
            Phase::Due => {
                let Some(dwell) = self.procedure.dwells.get(self.at) else {
                    self.phase = Phase::Done;
                    return false;
                };
                if self.since(now_s) < self.procedure.due_s(self.at).max(ON_THE_WAY_S) {
                    // A table turns no longer than it is asked to.
                    if let Some((up, rate)) = self.stands
                        && rate != 0.0
                    {
                        does.orders.push(Order::Halt);
                        self.stands = Some((up, 0.0));
                    }
                    return false;
                }
                match self.motion_to(dwell) {
                    Some(order) => {
                        does.orders.push(order);
                        self.phase = Phase::Moving;
                        return false;
                    }
                    None if !seen.arrived => return false,
                    None => self.begin(now_s, does),
                }
            }
            Phase::Moving if seen.arrived => {
                let until_s = now_s + ON_THE_WAY_S;
                self.phase = Phase::Arrived { until_s };
            }
            Phase::Arrived { until_s } if now_s >= until_s => self.begin(now_s, does),
            Phase::Turn if seen.arrived => {
                let until_s = now_s + ON_THE_WAY_S;
                self.phase = Phase::Turned { until_s };
            }
            Phase::Dwell { until_s } | Phase::Turned { until_s } if now_s >= until_s => {
                does.marks += 1;
                self.at += 1;
                self.phase = Phase::Due;
            }
            _ => return false,
        }
        true
    }

    /// The first pose and the first temperature, before which the plan does not begin.
    fn approach(&mut self, seen: &Seen, does: &mut Does) -> bool {
        let first = &self.procedure.dwells[0];
        if self.has_table && self.stands.is_none() {
            let up = first.turn.map_or(first.up, |turn| Some(turn.from_up));
            let up = up.unwrap_or([0.0, 0.0, 1.0]);
            does.orders.push(go(up, 0.0, 0.0));
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

    /// What brings the table to where a dwell or a turn begins, if it is not there.
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
    fn begin(&mut self, now_s: f64, does: &mut Does) {
        let dwell = &self.procedure.dwells[self.at];
        does.marks += 1;
        self.phase = match &dwell.turn {
            Some(turn) => {
                does.orders.push(Order::Turn(*turn));
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
