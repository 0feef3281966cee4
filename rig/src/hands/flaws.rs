//! Flaws of the person: a violent shake, a hand that settles slowly, a slow turn instead of a rest.

use super::choice::Turn;
use super::even::Even;
use super::{Hands, Shake};
use crate::flaws::{FlawsTruth, direction, pick};
use crate::random::Random;
use crate::rotation::{Rotation, scale};

impl Hands {
    /// With the flaws of the person.
    pub fn with_flaws(mut self, truth: &FlawsTruth, seed: u64) -> Self {
        let random = |cause: &str| Random::new(seed, cause);
        let n = self.turns.len();
        let mut shake = random("violent shake");
        self.shake = Shake::new(&mut shake, truth.shake_hz, truth.shake_mrad, 0.0);
        // The first pose has no turn before it.
        let shaken = pick(truth.shake_turns, n.saturating_sub(1), &mut shake);
        for (turn, shaken) in self.turns.iter_mut().skip(1).zip(shaken) {
            turn.shaken = shaken;
        }
        let mut even = random("turning rests");
        let turning = pick(truth.turning_rests, n, &mut even);
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
    /// Time at which the turn ends and the rest begins, s.
    pub(super) fn arrived_s(&self) -> f64 {
        self.start_s + self.turn_s
    }

    /// The attitude at its end.
    pub(super) fn aim(&self) -> Rotation {
        self.from * Rotation::about(self.axis, self.angle)
    }

    /// Changes its start and end attitudes, and keeps everything else.
    fn lead(&mut self, from: Rotation, to: Rotation) {
        (self.axis, self.angle) = (from.inverse() * to).axis_angle();
        self.from = from;
    }
}
