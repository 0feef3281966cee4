//! A person who turns the board by hand: poses are missed, turns deviate from their axis, and the board gets knocked.
//!
//! Attitude and position are twice differentiable everywhere, so rate, angular acceleration and specific force are their exact derivatives.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::chain::{Frame, Jet};
use crate::motion::{Carrier, Instant, Motion};
use crate::place::Place;
use crate::plan::{Plan, Pose};
use crate::random::Random;
use crate::refusal::{Refusal, within};
use crate::rotation::{Vector, scale};

use choice::{Jolt, Turn, between, chosen};
use commanded::CommandState;

mod choice;
mod commanded;
mod even;
mod flaws;

/// Behaviour of the person. Ranges are lowest and highest, uniformly distributed.
///
/// By default the board rests during the dwells, in a cube, a fixture, or against a book.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HandsTruth {
    /// Whether the person holds the board during the dwells.
    pub held: bool,
    /// Standard deviation of a pose from its target about each level axis.
    pub aim_deg: f64,
    /// Range of a turn's length, s.
    pub turn_s: [f64; 2],
    /// Range of the pause before and after a dwell, s.
    pub pause_s: [f64; 2],
    /// Maximum relative lengthening of a dwell.
    pub dwell_stretch: f64,
    /// Standard deviation of a turn from its axis, about each perpendicular axis.
    pub wander_deg: f64,
    /// Range of the length of one of several whole turns, s.
    pub whole_turn_s: [f64; 2],
    /// Rms deviation of the axis of whole turns, about each axis, in the band of the sway times ten.
    pub wobble_deg: f64,
    /// Standard deviation of the attitude in which the board is put back after whole turns, about each axis.
    pub put_back_deg: f64,
    /// Standard deviation of the position where the board is put down, in each horizontal direction.
    pub carry_mm: f64,
    /// Mean height of the arc from pose to pose. The lowest is half of it, the highest one and a half times it.
    pub lift_mm: f64,
    /// Position of the board's origin relative to the point about which the hand turns it, board axes.
    pub lever_mm: Vector,
    /// Band of the tremor of a hand, Hz. Physiological tremor is at 8 to 12.
    pub tremor_hz: [f64; 2],
    /// Rms tremor along each axis.
    pub tremor_mm: f64,
    /// Rms tremor about each axis.
    pub tremor_mrad: f64,
    /// Band of the sway of a hand that holds still, Hz.
    pub sway_hz: [f64; 2],
    /// Rms sway along each axis.
    pub sway_mm: f64,
    /// Rms sway about each axis.
    pub sway_mrad: f64,
    /// Share of dwells with a knock in them.
    pub jolt_probability: f64,
    /// Length of a knock, s.
    pub jolt_s: f64,
    /// Displacement at the peak of a knock, standard deviation along each axis.
    pub jolt_mm: f64,
    /// Rotation at the peak of a knock, standard deviation about each axis.
    pub jolt_mrad: f64,
}

impl Default for HandsTruth {
    fn default() -> Self {
        Self {
            held: false,
            aim_deg: 3.0,
            turn_s: [1.0, 3.0],
            pause_s: [0.3, 1.5],
            dwell_stretch: 0.3,
            wander_deg: 15.0,
            whole_turn_s: [2.0, 3.5],
            wobble_deg: 3.0,
            put_back_deg: 0.5,
            carry_mm: 100.0,
            lift_mm: 80.0,
            lever_mm: [20.0, -10.0, 15.0],
            tremor_hz: [8.0, 12.0],
            tremor_mm: 0.05,
            tremor_mrad: 0.5,
            sway_hz: [0.1, 0.6],
            sway_mm: 2.0,
            sway_mrad: 5.0,
            jolt_probability: 0.05,
            jolt_s: 0.05,
            jolt_mm: 0.1,
            jolt_mrad: 0.3,
        }
    }
}

impl HandsTruth {
    /// Refuses impossible values.
    pub fn check(&self) -> Result<(), Refusal> {
        let (angle, size) = ([0.0, 90.0], [0.0, 1000.0]);
        let ranges: [(&str, &[f64], [f64; 2]); 21] = [
            ("aim_deg", &[self.aim_deg], angle),
            ("turn_s", &self.turn_s, [0.1, 60.0]),
            ("pause_s", &self.pause_s, [0.0, 600.0]),
            ("dwell_stretch", &[self.dwell_stretch], [0.0, 10.0]),
            ("wander_deg", &[self.wander_deg], angle),
            ("whole_turn_s", &self.whole_turn_s, [0.1, 60.0]),
            ("wobble_deg", &[self.wobble_deg], angle),
            ("put_back_deg", &[self.put_back_deg], angle),
            ("carry_mm", &[self.carry_mm], size),
            ("lift_mm", &[self.lift_mm], size),
            ("lever_mm", &self.lever_mm, [-1000.0, 1000.0]),
            ("tremor_hz", &self.tremor_hz, [0.0, 100.0]),
            ("tremor_mm", &[self.tremor_mm], size),
            ("tremor_mrad", &[self.tremor_mrad], size),
            ("sway_hz", &self.sway_hz, [0.0, 100.0]),
            ("sway_mm", &[self.sway_mm], size),
            ("sway_mrad", &[self.sway_mrad], size),
            ("jolt_probability", &[self.jolt_probability], [0.0, 1.0]),
            ("jolt_s", &[self.jolt_s], [0.001, 10.0]),
            ("jolt_mm", &[self.jolt_mm], size),
            ("jolt_mrad", &[self.jolt_mrad], size),
        ];
        for (key, values, range) in ranges {
            within(&format!("hands.{key}"), values, range)?;
        }
        for (key, [low, high]) in [
            ("turn_s", self.turn_s),
            ("whole_turn_s", self.whole_turn_s),
            ("pause_s", self.pause_s),
            ("tremor_hz", self.tremor_hz),
            ("sway_hz", self.sway_hz),
        ] {
            if low > high {
                let problem = format!("`{key}` is from {low} to {high}");
                let path = format!("hands.{key}");
                return Err(Refusal::new(path, problem, "give the lowest first"));
            }
        }
        Ok(())
    }
}

/// Rotation and displacement of the board relative to the path of a turn.
#[derive(Debug, Clone, Copy, Default)]
struct Shift {
    angle: [Jet; 3],
    position: [Jet; 3],
}

impl Shift {
    fn add(&mut self, other: &Self, weight: Jet) {
        for i in 0..3 {
            self.angle[i] = self.angle[i] + other.angle[i] * weight;
            self.position[i] = self.position[i] + other.position[i] * weight;
        }
    }
}

/// Oscillation within a band: three sines on each of six channels, whose beat varies the amplitude.
#[derive(Debug, Clone)]
struct Shake {
    /// Angular frequency (rad/s), phase (rad), amplitude (rad, m): angles, then positions.
    sines: [[[f64; 3]; 3]; 6],
}

impl Shake {
    fn new(random: &mut Random, [low, high]: [f64; 2], mrad: f64, mm: f64) -> Self {
        let sines = std::array::from_fn(|channel| {
            // Sines of amplitude a have an rms value of a √(3/2).
            let amplitude = 1e-3 * if channel < 3 { mrad } else { mm } / 1.5_f64.sqrt();
            std::array::from_fn(|_| {
                let frequency = low + (high - low) * random.uniform();
                [TAU * frequency, TAU * random.uniform(), amplitude]
            })
        });
        Self { sines }
    }

    fn at(&self, t_s: f64) -> Shift {
        let channel = |i: usize| {
            self.sines[i]
                .iter()
                .fold(Jet::default(), |sum, &[frequency, phase, amplitude]| {
                    let angle = Jet {
                        value: frequency * t_s + phase,
                        rate: frequency,
                        acceleration: 0.0,
                    };
                    sum + angle.sin().times(amplitude)
                })
        };
        Shift {
            angle: std::array::from_fn(channel),
            position: std::array::from_fn(|i| channel(3 + i)),
        }
    }
}

/// Slow tumble of a board in the hand: band, rms angle about each of three axes in a row, and rms displacement along each. 50 deg/s about each axis on
/// average, and every attitude within a minute.
const TUMBLE_HZ: [f64; 2] = [0.04, 0.12];
const TUMBLE_DEG: f64 = 100.0;
const TUMBLE_MM: f64 = 30.0;

/// A person who carries out a plan, or commands.
#[derive(Debug, Clone)]
pub struct Hands {
    place: Place,
    turns: Vec<Turn>,
    cursor: usize,
    duration_s: f64,
    lever: Vector,
    tremor: Shake,
    sway: Shake,
    shake: Shake,
    wobble: Shake,
    tumble: Shake,
    jolt_s: f64,
    still: Option<(usize, Motion)>,
    /// State under command; `None` if there is a plan.
    commanded: Option<CommandState>,
}

impl Hands {
    /// The person `truth`, ready to carry out `plan`. The seed determines all random choices.
    pub fn new(plan: &Plan, truth: &HandsTruth, seed: u64) -> Result<Self, String> {
        truth.check()?;
        let mut random = Random::new(seed, "hands");
        let mut hands = Self::of(plan, truth, &mut random);
        let random = &mut random;
        let mut turns: Vec<Turn> = Vec::new();
        let mut end_s = 0.0;
        for step in (0..plan.rounds).flat_map(|_| &plan.steps) {
            let poses = match step.pose {
                Pose::Up(up) => vec![up],
                Pose::Many(count) => chosen(count, random),
                // A plan by hand has a pose in every step, or whole turns where the board lies.
                Pose::Here => turns.last().map(|last| last.up).into_iter().collect(),
            };
            for up in poses {
                for _ in 0..step.repeat {
                    let at_s = if turns.is_empty() {
                        plan.lead_in_s
                    } else {
                        end_s
                    };
                    let turn = match (&step.whole, turns.last()) {
                        (Some(whole), Some(last)) => {
                            Turn::whole(last, at_s, step, whole, truth, random)
                        }
                        (None, Some(last)) if step.tumble_s.is_some() => {
                            Turn::tumble(last, at_s, step, truth, random)
                        }
                        (_, last) => Turn::draw(last, at_s, step, up, truth, random),
                    };
                    end_s = turn.dwell[1] + between(truth.pause_s, random);
                    turns.push(turn);
                }
            }
        }
        if turns.iter().any(|turn| turn.whole.is_some()) {
            let band = truth.sway_hz.map(|hz| 10.0 * hz);
            let mrad = 1e3 * truth.wobble_deg.to_radians();
            hands.wobble = Shake::new(random, band, mrad, truth.sway_mm);
        }
        // A separate stream: a tumble changes nothing of the other turns.
        let tumble = &mut Random::new(seed, "tumble");
        hands.tumble = Shake::new(tumble, TUMBLE_HZ, 1e3 * TUMBLE_DEG.to_radians(), TUMBLE_MM);
        (hands.turns, hands.duration_s) = (turns, end_s);
        Ok(hands)
    }

    /// The person without turns.
    fn of(plan: &Plan, truth: &HandsTruth, random: &mut Random) -> Self {
        let tremor = Shake::new(random, truth.tremor_hz, truth.tremor_mrad, truth.tremor_mm);
        let sway = Shake::new(random, truth.sway_hz, truth.sway_mrad, truth.sway_mm);
        Self {
            place: plan.place,
            turns: Vec::new(),
            cursor: 0,
            duration_s: 0.0,
            lever: scale(1e-3, truth.lever_mm),
            tremor,
            shake: sway.clone(),
            wobble: sway.clone(),
            tumble: sway.clone(),
            sway,
            jolt_s: truth.jolt_s,
            still: None,
            commanded: None,
        }
    }
}

impl Carrier for Hands {
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn at(&mut self, t_s: f64) -> Instant {
        while self
            .turns
            .get(self.cursor + 1)
            .is_some_and(|next| next.start_s <= t_s)
        {
            self.cursor += 1;
        }
        let turn = &self.turns[self.cursor];
        let dwells = t_s >= turn.dwell[0] && t_s < turn.dwell[1] && self.commanded.is_none();
        let step = dwells.then_some(self.cursor as u32);
        let turning = t_s < turn.start_s + turn.turn_s;
        let jolt = turn
            .jolt
            .filter(|jolt| t_s >= jolt.start_s && t_s < jolt.start_s + self.jolt_s);
        let settles = |(_, length_s)| t_s < turn.arrived_s() + length_s;
        let moves = turn.even.is_some() || turn.settling.is_some_and(settles);
        let lies = !turn.held[1] && !turning && !moves && jolt.is_none();
        let motion = match self.still {
            Some((at, still)) if lies && at == self.cursor => Motion { t_s, ..still },
            _ => self.moving(turn, t_s, turning, jolt),
        };
        self.still = lies.then_some((self.cursor, motion));
        Instant {
            motion,
            step,
            stated_rate: None,
            stated_force: None,
        }
    }
}

impl Hands {
    fn moving(&self, turn: &Turn, t_s: f64, turning: bool, jolt: Option<Jolt>) -> Motion {
        let part = |start_s: f64, length_s: f64| Jet {
            value: (t_s - start_s) / length_s,
            rate: 1.0 / length_s,
            acceleration: 0.0,
        };
        let (done, detour) = if turning {
            let part = part(turn.start_s, turn.turn_s);
            (smooth_step(part), bump(part))
        } else {
            (Jet::constant(1.0), Jet::default())
        };
        let mut shift = Shift::default();
        // The share held: the hand lets go, or takes hold, during the turn.
        let held = match turn.held {
            [false, false] => None,
            [true, true] => Some(Jet::constant(1.0)),
            [true, false] => Some(Jet::constant(1.0) + done.times(-1.0)),
            [false, true] => Some(done),
        };
        if let Some(held) = held {
            shift.add(&self.tremor.at(t_s), held);
            shift.add(&self.sway.at(t_s), held);
        }
        if turning && turn.held != [true, true] {
            shift.add(&self.tremor.at(t_s), detour);
        }
        if turning && turn.whole.is_some() {
            shift.add(&self.wobble.at(t_s), detour);
        }
        if turning && turn.tumbles {
            shift.add(&self.tumble.at(t_s), turn.tumbling(t_s));
        }
        if turning && turn.shaken {
            shift.add(&self.shake.at(t_s), detour);
        }
        if let Some((angle, length_s)) = turn.settling {
            let left = match turning {
                true => done,
                false => {
                    let gone = part(turn.arrived_s(), length_s);
                    let gone = smooth_step(Jet {
                        value: gone.value.min(1.0),
                        ..gone
                    });
                    Jet::constant(1.0) + gone.times(-1.0)
                }
            };
            let settling = Shift {
                angle: angle.map(Jet::constant),
                ..Shift::default()
            };
            shift.add(&settling, left);
        }
        if let Some(jolt) = jolt {
            let knock = Shift {
                angle: jolt.angle.map(Jet::constant),
                position: jolt.position.map(Jet::constant),
            };
            shift.add(&knock, bump(part(jolt.start_s, self.jolt_s)));
        }
        let [from, to] = turn.position;
        for i in 0..3 {
            shift.position[i] =
                shift.position[i] + Jet::constant(from[i]) + done.times(to[i] - from[i]);
        }
        shift.position[2] = shift.position[2] + detour.times(turn.lift);
        let mut frame = Frame::ground(&self.place)
            .fixed(turn.from)
            .about(turn.axis, done.times(turn.angle));
        if let Some((axis, angle)) = turn.whole {
            frame = frame.about(axis, done.times(angle));
        }
        if let Some((axis, angle)) = turn.even.map(|even| even.at(t_s)) {
            frame = frame.about(axis, angle);
        }
        frame
            .about_own::<0>(detour.times(turn.wander[0]) + shift.angle[0])
            .about_own::<1>(detour.times(turn.wander[1]) + shift.angle[1])
            .about_own::<2>(shift.angle[2])
            .motion(t_s, &self.place, self.lever, shift.position)
    }
}

/// From 0 to 1 while the argument goes from 0 to 1, at rest and without acceleration at both ends: 10u³ -
/// 15u⁴ + 6u⁵.
fn smooth_step(part: Jet) -> Jet {
    let u = part.value;
    let v = u * (1.0 - u);
    part.through([
        u * u * u * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * v * v,
        60.0 * v * (1.0 - 2.0 * u),
    ])
}

/// From 0 to 1 and back while the argument goes from 0 to 1, at rest and without acceleration at both ends:
/// (4u (1 - u))³.
fn bump(part: Jet) -> Jet {
    let u = part.value;
    let (v, dv) = (u * (1.0 - u), 1.0 - 2.0 * u);
    part.through([
        64.0 * v * v * v,
        192.0 * v * v * dv,
        384.0 * v * (dv * dv - v),
    ])
}
