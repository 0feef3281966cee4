//! Flaws of the person: a violent shake, a hand that settles slowly, a rest that is none.

use super::choice::Turn;
use super::{Hands, Shake};
use crate::chain::Jet;
use crate::flaws::{FlawsTruth, direction, struck};
use crate::random::Random;
use crate::rotation::{Rotation, Vector, norm, scale};

/// Time in which an even turn gets going, and in which it stops, s; or a quarter of it.
const RAMP_S: f64 = 0.3;

/// An even turn in place of a rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Even {
    /// Rate, rad/s, body axes.
    pub(super) rate: Vector,
    /// From the end of the turn to that of the dwell, s.
    pub(super) span_s: [f64; 2],
}

impl Even {
    /// Axis, and the angle about it at `t_s`, rad.
    pub(super) fn at(&self, t_s: f64) -> (Vector, Jet) {
        let size = norm(self.rate);
        let [from, to] = self.span_s;
        let ramp_s = RAMP_S.min(0.25 * (to - from));
        // Integral of a smooth step of the rate: 5u⁴/2 - 3u⁵ + u⁶, half of it over the whole step.
        let run_up = |t: f64, sign: f64| {
            let u = (t / ramp_s).clamp(0.0, 1.0);
            let u2 = u * u;
            Jet {
                value: ramp_s * u2 * u2 * (2.5 + u * (u - 3.0)) + (t - ramp_s).max(0.0),
                rate: sign * u2 * u * (10.0 + u * (6.0 * u - 15.0)),
                acceleration: 30.0 * u2 * (1.0 - u) * (1.0 - u) / ramp_s,
            }
        };
        let whole_s = to - from - ramp_s;
        let seconds = if t_s < 0.5 * (from + to) {
            run_up((t_s - from).max(0.0), 1.0)
        } else {
            let left = run_up((to - t_s).max(0.0), -1.0);
            Jet::constant(whole_s) + left.times(-1.0)
        };
        (scale(1.0 / size, self.rate), seconds.times(size))
    }

    /// The whole of it.
    fn turned(&self) -> Rotation {
        let (axis, angle) = self.at(self.span_s[1]);
        Rotation::about(axis, angle.value)
    }
}

impl Hands {
    /// With the flaws of the person.
    pub fn with_flaws(mut self, truth: &FlawsTruth, seed: u64) -> Self {
        let random = |cause: &str| Random::new(seed, cause);
        let n = self.turns.len();
        let mut shake = random("violent shake");
        self.shake = Shake::new(&mut shake, truth.shake_hz, truth.shake_mrad, 0.0);
        // No turn leads to the first pose.
        let shaken = struck(truth.shake_turns, n.saturating_sub(1), &mut shake);
        for (turn, shaken) in self.turns.iter_mut().skip(1).zip(shaken) {
            turn.shaken = shaken;
        }
        let mut even = random("turning rests");
        let turning = struck(truth.turning_rests, n, &mut even);
        for i in (0..n).filter(|i| turning[*i] && truth.turning_dps > 0.0) {
            self.turns[i].even = Some(Even {
                rate: scale(truth.turning_dps.to_radians(), direction(&mut even)),
                span_s: [self.turns[i].arrived_s(), self.turns[i].dwell[1]],
            });
        }
        for i in 1..n {
            let [before, turn] = [&self.turns[i - 1], &self.turns[i]];
            let Some(even) = before.even else { continue };
            let (from, to) = (before.aim() * even.turned(), turn.aim());
            self.turns[i].lead(from, to);
        }
        if truth.settle_mrad > 0.0 {
            self.settle(truth, &mut random("settling"));
        }
        self
    }

    fn settle(&mut self, truth: &FlawsTruth, random: &mut Random) {
        let starts: Vec<f64> = self.turns.iter().skip(1).map(|t| t.start_s).collect();
        let ends = starts.into_iter().chain([self.duration_s]);
        for (i, (turn, end_s)) in self.turns.iter_mut().zip(ends).enumerate() {
            let angle = [0; 3].map(|_| 1e-3 * truth.settle_mrad * random.normal());
            let left_s = end_s - turn.arrived_s();
            if i > 0 && left_s > 0.0 {
                turn.settling = Some((angle, truth.settle_s.min(left_s)));
            }
        }
    }
}

impl Turn {
    /// When the turn is over and the rest begins, s.
    pub(super) fn arrived_s(&self) -> f64 {
        self.start_s + self.turn_s
    }

    /// The attitude that it leads to.
    fn aim(&self) -> Rotation {
        self.from * Rotation::about(self.axis, self.angle)
    }

    /// Leads from one attitude to another, and keeps all else.
    fn lead(&mut self, from: Rotation, to: Rotation) {
        (self.axis, self.angle) = (from.inverse() * to).axis_angle();
        self.from = from;
    }
}
