//! What makes a table carry out a plan: which angles give a pose, and when each axis moves.

use std::f64::consts::{PI, TAU};

use super::truth::TableTruth;
use crate::axis::{Axis, nearest_turn};
use crate::plan::{Limits, Plan, Pose, Step, UPRIGHT, tilt};
use crate::rotation::Vector;

pub(super) const OUTER: usize = 0;
pub(super) const MIDDLE: usize = 1;
pub(super) const INNER: usize = 2;

/// A dwell: from and to, s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dwell {
    pub(super) start_s: f64,
    pub(super) end_s: f64,
}

/// Carries out steps by appending to the axes' commands.
pub(super) struct Controller<'a> {
    truth: &'a TableTruth,
    limits: Limits,
    lead_in_s: f64,
    pub(super) axes: [Axis; 3],
    pub(super) dwells: Vec<Dwell>,
}

impl<'a> Controller<'a> {
    /// All of a plan that is within the table's limits.
    pub(super) fn carry_out(plan: &Plan, truth: &'a TableTruth) -> Self {
        let mut controller = Self::new(plan, truth);
        for step in &plan.steps {
            match step.pose {
                Pose::Up(up) => controller.step(step, up),
                Pose::Many(count) => {
                    for up in spread(count, &truth.limits()) {
                        controller.step(step, up);
                    }
                }
            }
        }
        controller
    }

    fn new(plan: &Plan, truth: &'a TableTruth) -> Self {
        Self {
            truth,
            limits: truth.limits(),
            lead_in_s: plan.lead_in_s,
            axes: [0, 1, 2].map(|_| Axis::new(0.0, truth.settling)),
            dwells: Vec::new(),
        }
    }

    /// Pose, rates up, dwells, rates down. Between the dwells of one pose nothing stops.
    fn step(&mut self, step: &Step, up: Vector) {
        let target = self.angles(up, step.heading.unwrap_or(0.0));
        let per_axis = |dps: Vector| dps.map(f64::to_radians);
        let (slew, acceleration) = (
            per_axis(self.truth.slew_dps),
            per_axis(self.truth.max_acceleration_dps2),
        );
        let first = self.dwells.is_empty();
        let before = if first { self.lead_in_s } else { self.now() };
        if first {
            // The table stands at the first pose when the recording begins.
            self.axes = target.map(|angle| Axis::new(angle, self.truth.settling));
            self.hold(self.lead_in_s);
        } else {
            for i in 0..3 {
                self.axes[i].move_to(target[i], slew[i], acceleration[i]);
            }
        }
        self.hold(0.0);
        let rates = if self.limits.outer {
            [step.rate, 0.0, step.spin]
        } else {
            // The check lets a rate about the vertical pass where the inner axis is upright, either way up.
            [0.0, 0.0, step.spin + step.rate * up[2].signum()]
        };
        let run = |axes: &mut [Axis; 3], rates: Vector| {
            for i in 0..3 {
                axes[i].run_up(
                    rates[i] * (1.0 + 1e-6 * self.truth.rate_scale_ppm[i]),
                    acceleration[i],
                );
            }
        };
        run(&mut self.axes, rates);
        self.hold(0.0);
        if self.now() > before {
            self.hold(self.truth.settle_s);
        }
        for _ in 0..step.repeat {
            let start_s = self.now();
            self.hold(step.dwell_s);
            self.dwells.push(Dwell {
                start_s,
                end_s: self.now(),
            });
        }
        run(&mut self.axes, [0.0; 3]);
        self.hold(0.0);
    }

    /// When the last axis is done, s.
    fn now(&self) -> f64 {
        self.axes.iter().map(Axis::end_s).fold(0.0, f64::max)
    }

    /// All axes go on as they are until so long after the last is done.
    fn hold(&mut self, duration_s: f64) {
        let end_s = self.now() + duration_s;
        for axis in &mut self.axes {
            axis.hold_until(end_s);
        }
    }

    /// Angles for a pose and a heading: of the two ways that there may be, the one that takes less time.
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
                    // The heading falls to the inner axis, which turns the other way when it is upside down.
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

/// Directions of up spread evenly over what the middle axis reaches: a Fibonacci spiral, from the inner
/// axis upright down.
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
