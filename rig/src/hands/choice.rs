//! Choices of a person carrying out a plan: the next pose, how well it is met, and how long everything takes.

use std::f64::consts::TAU;

use super::HandsTruth;
use super::even::Even;
use crate::plan::{Step, WholeTurns, attitude};
use crate::random::Random;
use crate::rotation::{Rotation, Vector, norm};

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
        let [dwell, end] = turn.dwell;
        let longer_s = each_s * whole.count.abs() - turn.turn_s;
        turn.turn_s += longer_s;
        turn.dwell = [dwell + longer_s, end + longer_s];
        if let Some(jolt) = &mut turn.jolt {
            jolt.start_s += longer_s;
        }
        let missed = [0; 3].map(|_| random.normal() * truth.put_back_deg.to_radians());
        (turn.axis, turn.angle) = Rotation::by(missed).axis_angle();
        turn.position[1] = turn.position[0];
        turn.whole = Some((whole.about, TAU * whole.count));
        turn
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
