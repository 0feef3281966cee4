//! Choices of a person carrying out a plan: the next pose, how well it is met, and how long everything takes.

use std::f64::consts::TAU;

use super::even::Even;
use super::{HandsTruth, smooth_step};
use crate::chain::Jet;
use crate::plan::{Step, WholeTurns, attitude};
use crate::random::Random;
use crate::rotation::{Rotation, Vector, norm};

/// Longest time in which a tumble begins, and in which it ends, s.
const TUMBLE_RAMP_S: f64 = 3.0;

/// A turn to the next pose, and the rest there.
#[derive(Debug, Clone)]
pub(super) struct Turn {
    pub(super) start_s: f64,
    /// Its target: the direction that should point up (unit, body axes), and the heading, rad.
    pub(super) up: Vector,
    pub(super) heading: Option<f64>,
    /// Whether the board is held before and after.
    pub(super) held: [bool; 2],
    /// Duration of the turn, s; 0 at the start of the recording.
    pub(super) turn_s: f64,
    pub(super) from: Rotation,
    /// Axis (unit, body axes before the turn) and angle (rad).
    pub(super) axis: Vector,
    pub(super) angle: f64,
    /// Detour about body x and y, rad.
    pub(super) wander: [f64; 2],
    /// Before and after, level axes, m.
    pub(super) position: [Vector; 2],
    pub(super) lift: f64,
    pub(super) dwell: [f64; 2],
    pub(super) jolt: Option<Jolt>,
    /// Whether it is shaken violently on the way.
    pub(super) shaken: bool,
    /// Whether it tumbles slowly on the way.
    pub(super) tumbles: bool,
    /// Rotation from its pose at which it arrives, rad, and the time to settle, s.
    pub(super) settling: Option<(Vector, f64)>,
    /// Whole turns on the way: axis (unit, body axes before the turn) and angle, rad.
    pub(super) whole: Option<(Vector, f64)>,
    /// A slow turn instead of a rest.
    pub(super) even: Option<Even>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Jolt {
    pub(super) start_s: f64,
    pub(super) angle: Vector,
    pub(super) position: Vector,
}

impl Turn {
    /// The turn that begins at `at_s` and the following dwell; without `last` only the dwell, from `at_s` on.
    pub(super) fn draw(
        last: Option<&Turn>,
        at_s: f64,
        step: &Step,
        up: Vector,
        truth: &HandsTruth,
        random: &mut Random,
    ) -> Turn {
        let from = last.map_or(attitude(up, 0.0), |last| {
            let put_back = last.from * Rotation::about(last.axis, last.angle);
            // A turn that stopped half-way goes on from there.
            match last.whole {
                Some((axis, angle)) => put_back * Rotation::about(axis, angle),
                None => put_back,
            }
        });
        let aim = match step.heading {
            Some(heading) => attitude(up, heading),
            // The shortest turn that brings it upright, then a random one about the vertical.
            None => {
                let upright = Rotation::between(from.turn(up), [0.0, 0.0, 1.0]) * from;
                Rotation::about([0.0, 0.0, 1.0], 0.5 * random.normal()) * upright
            }
        };
        let mut normal = |size: f64| size * random.normal();
        let to = Rotation::by([0; 3].map(|_| normal(truth.aim_deg.to_radians()))) * aim;
        let spot = [
            normal(1e-3 * truth.carry_mm),
            normal(1e-3 * truth.carry_mm),
            0.0,
        ];
        let wander = [0; 2].map(|_| normal(truth.wander_deg.to_radians()));
        let knock = Jolt {
            start_s: 0.0,
            angle: [0; 3].map(|_| normal(1e-3 * truth.jolt_mrad)),
            position: [0; 3].map(|_| normal(1e-3 * truth.jolt_mm)),
        };
        let (turn_s, pause_s) = (
            between(truth.turn_s, random),
            between(truth.pause_s, random),
        );
        let lift = 1e-3 * truth.lift_mm * (0.5 + random.uniform());
        let length_s = step.dwell_s * (1.0 + truth.dwell_stretch * random.uniform());
        let jolted = random.uniform() < truth.jolt_probability && length_s > truth.jolt_s;
        let when = random.uniform();
        // The board is in the first pose from the beginning, without a turn.
        let (from, turn_s, dwell_s) = match last {
            Some(_) => (from, turn_s, at_s + turn_s + pause_s),
            None => (to, 0.0, at_s),
        };
        let (axis, angle) = (from.inverse() * to).axis_angle();
        Turn {
            start_s: if last.is_some() { at_s } else { 0.0 },
            up,
            heading: step.heading,
            held: [last.map_or(truth.held, |last| last.held[1]), truth.held],
            turn_s,
            from,
            axis,
            angle,
            wander,
            position: [last.map_or(spot, |last| last.position[1]), spot],
            lift,
            dwell: [dwell_s, dwell_s + length_s],
            jolt: jolted.then_some(Jolt {
                start_s: dwell_s + when * (length_s - truth.jolt_s),
                ..knock
            }),
            shaken: false,
            tumbles: false,
            whole: None,
            settling: None,
            even: None,
        }
    }
}

impl Turn {
    /// The whole turns of `step` from where the board lies since `last`, and the dwell where it is put back.
    pub(super) fn whole(
        last: &Turn,
        at_s: f64,
        step: &Step,
        whole: &WholeTurns,
        truth: &HandsTruth,
        random: &mut Random,
    ) -> Turn {
        // All choices of a turn, so that those of later turns do not depend on what this one is.
        let mut turn = Turn::draw(Some(last), at_s, step, last.up, truth, random);
        let each_s = between(truth.whole_turn_s, random);
        turn.come_back(each_s * whole.count.abs(), truth, random);
        turn.whole = Some((whole.about, TAU * whole.count));
        turn
    }

    /// The tumble of `step` from where the board lies since `last`, and the dwell where it is put back.
    pub(super) fn tumble(
        last: &Turn,
        at_s: f64,
        step: &Step,
        truth: &HandsTruth,
        random: &mut Random,
    ) -> Turn {
        let mut turn = Turn::draw(Some(last), at_s, step, last.up, truth, random);
        turn.come_back(step.tumble_s.unwrap_or_default(), truth, random);
        turn.tumbles = true;
        turn
    }

    /// Makes it take `turn_s` and end where the board lay, but for the error of putting it back.
    fn come_back(&mut self, turn_s: f64, truth: &HandsTruth, random: &mut Random) {
        let [dwell, end] = self.dwell;
        let longer_s = turn_s - self.turn_s;
        self.turn_s += longer_s;
        self.dwell = [dwell + longer_s, end + longer_s];
        if let Some(jolt) = &mut self.jolt {
            jolt.start_s += longer_s;
        }
        let missed = [0; 3].map(|_| random.normal() * truth.put_back_deg.to_radians());
        (self.axis, self.angle) = Rotation::by(missed).axis_angle();
        self.position[1] = self.position[0];
    }

    /// Share of the tumble at `t_s`: it begins and ends within a quarter of the turn, or [`TUMBLE_RAMP_S`].
    pub(super) fn tumbling(&self, t_s: f64) -> Jet {
        let ramp_s = TUMBLE_RAMP_S.min(0.25 * self.turn_s);
        let ramp = |past_s: f64, sign: f64| {
            smooth_step(Jet {
                value: (past_s / ramp_s).min(1.0),
                rate: sign / ramp_s,
                acceleration: 0.0,
            })
        };
        ramp(t_s - self.start_s, 1.0) * ramp(self.arrived_s() - t_s, -1.0)
    }
}

pub(super) fn between([low, high]: [f64; 2], random: &mut Random) -> f64 {
    low + (high - low) * random.uniform()
}

/// A person's idea of all directions: faces, edges, corners of a cube, then random ones.
pub(super) fn chosen(count: u32, random: &mut Random) -> Vec<Vector> {
    let mut cube: Vec<Vector> = (0..27)
        .map(|k| [k % 3, k / 3 % 3, k / 9].map(|i| f64::from(i) - 1.0))
        .filter(|v| norm(*v) > 0.0)
        .collect();
    cube.sort_by(|a, b| norm(*a).total_cmp(&norm(*b)));
    let anyhow = std::iter::repeat_with(|| random.attitude().turn([0.0, 0.0, 1.0]));
    cube.into_iter()
        .chain(anyhow)
        .take(count as usize)
        .collect()
}
