//! A person who is led by the wizard through poses and whole turns with a board on a table, and who errs once in each way. The physics are independent
//! of the bench and of the program.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use mimu_wizard::event::Event;
use mimu_wizard::spin::Spin;
use mimu_wizard::waiting::Waiting;

use crate::text_board::{
    GRAVITY, Matrix, Random, TextBoard, Turn, Vector, product, rotation, times, transposed,
};

/// What a person does wrong in a spin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Slip {
    /// Nothing.
    Right,
    /// Turns it once too few.
    OneShort,
    /// Puts it down on the way.
    HalfWay,
    /// Puts it back by this angle off, degrees, and leaves it so.
    Aside(f64),
    /// Turns it faster than the range of the gyro.
    Fast,
}

/// Time from words to a movement, s.
const REACTION_S: f64 = 0.8;
/// Time of one turn, s: at leisure, and too fast.
const TURN_S: [f64; 2] = [2.2, 0.55];
/// Amplitude of the wobble of the axis, rad, and its frequencies about the three axes, Hz.
const WOBBLE: f64 = 0.04;
const WOBBLE_HZ: [f64; 3] = [1.1, 1.7, 0.7];
/// Frequencies of the tremor about the three axes, Hz.
const TREMOR_HZ: [f64; 3] = [5.3, 4.1, 6.7];
/// Standard deviation of the attitude in which it is put back, rad.
const PUT_BACK: f64 = 0.005;

/// Whole turns under way.
struct Whole {
    turn: Turn,
    /// Rotation vector from the attitude in which it should end.
    miss: Vector,
}

enum Motion {
    Pose(Turn),
    Spin(Whole),
}

/// The person and the board.
pub struct Spinner {
    /// Time, s.
    pub now_s: f64,
    /// The slips of the spins to come.
    pub slips: VecDeque<Slip>,
    /// The board.
    pub board: TextBoard,
    /// Amplitude of the tremor of the hands, rad/s.
    pub tremor: f64,
    random: Random,
    /// Attitude of the board.
    pub attitude: Matrix,
    moves: Option<Motion>,
    /// What to do, and when.
    due: Option<(f64, Act)>,
    spin: Spin,
    /// Turns that are missing.
    left: f64,
    line: u64,
}

#[derive(Debug, Clone, Copy)]
enum Act {
    Hold(Vector),
    Spin(f64, Slip),
}

impl Spinner {
    /// At rest on a table.
    pub fn new(board: TextBoard, seed: u64, slips: &[Slip]) -> Self {
        Self {
            now_s: 0.0,
            slips: slips.iter().copied().collect(),
            board,
            tremor: 0.0,
            random: Random::new(seed),
            attitude: rotation([0.4, -0.2, 0.3]),
            moves: None,
            due: None,
            spin: Spin { axis: 2, turns: 0 },
            left: 0.0,
            line: 0,
        }
    }

    /// The wizard says something.
    pub fn hear(&mut self, event: &Event) {
        let act = match event {
            Event::Step { step, .. } => Act::Hold(step.up),
            Event::Spin { spin, step, .. } => {
                self.spin = *spin;
                let leans = self.attitude[2][spin.axis] > 0.95;
                match leans {
                    true => return,
                    false => Act::Hold(step.up),
                }
            }
            Event::Turned { turns: 0, .. } => {
                self.left = f64::from(self.spin.turns.abs());
                let slip = self.slips.pop_front().unwrap_or(Slip::Right);
                let turns = match slip {
                    Slip::OneShort => self.left - 1.0,
                    Slip::HalfWay => 0.54 * self.left,
                    Slip::Aside(deg) => self.left + deg / 360.0,
                    Slip::Right | Slip::Fast => self.left,
                };
                Act::Spin(turns, slip)
            }
            Event::Waiting {
                why: Waiting::TurnsMissing(..),
                ..
            } => Act::Spin(self.left, Slip::Right),
            _ => return,
        };
        self.due = Some((self.now_s + REACTION_S, act));
    }

    fn begin(&mut self, act: Act) {
        let (from, begin_s) = (self.attitude, self.now_s);
        self.moves = Some(match act {
            Act::Hold(up) => Motion::Pose(Turn::to(from, up, begin_s, &mut self.random)),
            Act::Spin(turns, slip) => {
                self.left -= turns;
                let mut axis: Vector = [0.0; 3].map(|_| 0.03 * self.random.normal());
                axis[self.spin.axis] += f64::from(self.spin.turns.signum());
                let size = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
                let lasts_s = turns * TURN_S[usize::from(slip == Slip::Fast)];
                let miss = [0.0; 3].map(|_| PUT_BACK * self.random.normal());
                Motion::Spin(Whole {
                    turn: Turn {
                        from,
                        by: axis.map(|x| x / size * TAU * turns),
                        begin_s,
                        lasts_s,
                    },
                    miss,
                })
            }
        });
    }

    /// What the board writes within the next tenth of a second.
    pub fn tenth(&mut self) -> Vec<u8> {
        if let (None, Some((at_s, act))) = (&self.moves, self.due)
            && self.now_s > at_s
        {
            self.due = None;
            self.begin(act);
        }
        let until_s = self.now_s + 0.1;
        let mut text = String::new();
        while self.line as f64 / self.board.rate_hz < until_s {
            let at_s = self.line as f64 / self.board.rate_hz;
            self.line += 1;
            text += &self.written(at_s);
        }
        self.now_s = until_s;
        text.into_bytes()
    }

    fn written(&mut self, at_s: f64) -> String {
        let mut rate = [0.0; 3];
        let mut ended = false;
        match &self.moves {
            None => {}
            Some(Motion::Pose(turn)) => {
                let [done, change] = turn.share(at_s);
                self.attitude = product(&turn.from, &rotation(turn.by.map(|x| x * done)));
                rate = turn.by.map(|x| x * change);
                ended = done >= 1.0;
            }
            Some(Motion::Spin(Whole { turn, miss })) => {
                let [done, change] = turn.share(at_s);
                let since_s = at_s - turn.begin_s;
                let (bump, bumps) = (4.0 * done * (1.0 - done), 4.0 * change * (1.0 - 2.0 * done));
                let mut off = [0.0; 3];
                let mut moves = [0.0; 3];
                for k in 0..3 {
                    let angular = TAU * WOBBLE_HZ[k];
                    let (sine, cosine) = (angular * since_s + k as f64).sin_cos();
                    off[k] = miss[k] * done + WOBBLE * bump * sine;
                    moves[k] = miss[k] * change + WOBBLE * (bumps * sine + bump * angular * cosine);
                }
                let tilted = rotation(off);
                let turned = product(&turn.from, &rotation(turn.by.map(|x| x * done)));
                self.attitude = product(&turned, &tilted);
                let turning = times(&transposed(&tilted), turn.by.map(|x| x * change));
                let own = right_jacobian(off, moves);
                rate = [0, 1, 2].map(|k| turning[k] + own[k]);
                ended = done >= 1.0;
            }
        }
        if ended {
            self.moves = None;
        }
        let force = times(&transposed(&self.attitude), [0.0, 0.0, GRAVITY]);
        let shaking = |k: usize| self.tremor * (TAU * TREMOR_HZ[k] * at_s).sin();
        let rate = [0, 1, 2].map(|k| rate[k] + shaking(k));
        self.board.line(at_s, rate, force, &mut self.random)
    }
}

/// `J(v) u`: the rate of a body whose rotation vector is `v` and changes by `u`.
fn right_jacobian(v: Vector, u: Vector) -> Vector {
    let cross = |a: Vector, b: Vector| {
        [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
    };
    let angle2: f64 = v.iter().map(|x| x * x).sum();
    let (a, b) = match angle2 < 1e-6 {
        true => (0.5, 1.0 / 6.0),
        false => {
            let angle = angle2.sqrt();
            (
                (1.0 - angle.cos()) / angle2,
                (angle - angle.sin()) / (angle2 * angle),
            )
        }
    };
    let once = cross(v, u);
    let twice = cross(v, once);
    [0, 1, 2].map(|i| u[i] - a * once[i] + b * twice[i])
}
