//! A person with a board in hands, who errs in the ways of a seed.

use mimu_tests::stored_calibration::Truth;
use mimu_tests::text_board::{
    GRAVITY, Matrix, Random, Turn, Vector, product, rotation, times, transposed, unit,
};
use mimu_wizard::relay::{Arrival, Stamped};

use crate::sensors::Sensor;

/// What goes wrong in every session besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trouble {
    /// The gyro drifts.
    Drift,
    /// The board's clock is wrong.
    Clock,
    /// Biases differ after each power-on.
    Steps,
    /// Another unit is at the cable from some time on.
    Swap,
    /// The command is killed.
    Kills,
}

impl Trouble {
    /// By its name.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "drift" => Self::Drift,
            "clock" => Self::Clock,
            "steps" => Self::Steps,
            "swap" => Self::Swap,
            "kills" => Self::Kills,
            _ => return None,
        })
    }
}

/// Steps of the biases at a power-on, standard deviations: rad/s and m/s².
const BIAS_STEPS: [f64; 2] = [0.1 * std::f64::consts::PI / 180.0, 5e-3 * 9.80665];
/// Mean time between pulled cables where biases step or units are swapped, s.
const PULLED_S: f64 = 150.0;
/// When another unit may come, s.
const SWAPPED_S: f64 = 90.0;

/// What the person and the cable do.
#[derive(Clone, Debug)]
pub struct Habits {
    /// Tremor: acceleration, m/s², and rate, rad/s.
    tremor: [f64; 2],
    /// When the board is picked up, s.
    picks_up_s: f64,
    /// Turns it about the vertical first.
    yaws: bool,
    /// Standard deviation of the held direction, rad.
    tilt: f64,
    /// Probability of another pose than the requested one, and of a movement during a dwell.
    errs: f64,
    fidgets: f64,
    /// Share of lost lines.
    lost: f64,
    /// Mean times between pulled cables, stalls and resets, s.
    pulled_s: f64,
    stalls_s: f64,
    resets_s: f64,
    /// Rate of the board's clock.
    clock: f64,
}

impl Habits {
    /// Those of a seed. Each fault occurs in about a third of the sessions.
    pub fn of(seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0xc1a5);
        let mut has = || random.even() < 0.35;
        let (strong, early, yaws, tilted, errs, fidgets, lossy, pulled, stalls, resets) = (
            has(),
            has(),
            has(),
            has(),
            has(),
            has(),
            has(),
            has(),
            has(),
            has(),
        );
        let or = |has: bool, with: f64, without: f64| if has { with } else { without };
        Self {
            tremor: if strong { [0.08, 0.035] } else { [0.03, 0.012] },
            picks_up_s: or(early, 2.0 + 6.0 * random.even(), 14.0),
            yaws,
            tilt: or(tilted, 0.12, 0.04),
            errs: or(errs, 0.1, 0.0),
            fidgets: or(fidgets, 0.15, 0.0),
            lost: or(lossy, 0.01, 0.0),
            pulled_s: or(pulled, 150.0, f64::INFINITY),
            stalls_s: or(stalls, 60.0, f64::INFINITY),
            resets_s: or(resets, 200.0, f64::INFINITY),
            clock: 1.0 + 0.001 * random.normal(),
        }
    }

    /// With a trouble that takes a pulled cable.
    pub fn with(mut self, trouble: Option<Trouble>) -> Self {
        if matches!(trouble, Some(Trouble::Steps | Trouble::Swap)) {
            self.pulled_s = PULLED_S;
        }
        self
    }

    /// The faults in words.
    pub fn names(&self) -> Vec<&'static str> {
        let all = [
            (self.tremor[0] > 0.05, "trembles"),
            (self.picks_up_s < 10.0, "moves early"),
            (self.yaws, "yaws first"),
            (self.tilt > 0.1, "tilts"),
            (self.errs > 0.0, "other poses"),
            (self.fidgets > 0.0, "fidgets"),
            (self.lost > 0.0, "1 % lost"),
            (self.pulled_s.is_finite(), "pulls the cable"),
            (self.stalls_s.is_finite(), "stalls"),
            (self.resets_s.is_finite(), "resets"),
        ];
        all.iter()
            .filter(|(is, _)| *is)
            .map(|(_, name)| *name)
            .collect()
    }
}

/// Time from a request to the movement, s.
const REACTION_S: f64 = 0.8;
/// If no dwell ends for this long, the person tries another pose, s.
const PUZZLED_S: f64 = 40.0;
/// Time for which the board is put down when the wizard says so, s.
const PUT_DOWN_S: f64 = 8.0;

/// The person, the board's attitude and the cable.
pub struct Person {
    /// Time by the computer's clock, s.
    pub now_s: f64,
    habits: Habits,
    random: Random,
    attitude: Matrix,
    turn: Option<Turn>,
    /// The requested pose, and when the person moves.
    due: Option<(Vector, f64)>,
    wanted: Option<Vector>,
    /// When the last dwell or movement ended.
    since_s: f64,
    put_down_until_s: f64,
    /// Phases of the tremor.
    phases: [f64; 6],
    /// How much of it there is, 0 to 1, and when the last line was written.
    held: f64,
    written_s: f64,
    /// Lines written by the board so far, and its time at its last start.
    line: u64,
    started_s: f64,
    away_until_s: Option<f64>,
    stalled_until_s: f64,
    last_line: String,
    trouble: Option<Trouble>,
    /// Biases of each power-on beside the board's, the last one of now: rate and force, SI.
    biases: Vec<[Vector; 2]>,
    /// Another unit in its place.
    other: Option<Sensor>,
    seed: u64,
}

impl Person {
    /// At the beginning.
    pub fn new(habits: &Habits, seed: u64, trouble: Option<Trouble>) -> Self {
        let mut random = Random::new(seed ^ 0x9e25);
        let phases = [0.0; 6].map(|_: f64| std::f64::consts::TAU * random.even());
        Self {
            now_s: 0.0,
            habits: habits.clone(),
            random,
            attitude: rotation([0.4, -0.2, 0.3]),
            turn: None,
            due: None,
            wanted: None,
            since_s: 0.0,
            put_down_until_s: 0.0,
            phases,
            held: 0.0,
            written_s: 0.0,
            line: 0,
            started_s: 0.0,
            away_until_s: None,
            stalled_until_s: 0.0,
            last_line: String::new(),
            trouble,
            biases: vec![[[0.0; 3]; 2]],
            other: None,
            seed,
        }
    }

    /// Whether the command is killed now.
    pub fn kills(&mut self) -> bool {
        self.trouble == Some(Trouble::Kills) && self.happens(crate::KILLED_S)
    }

    /// Whether another unit has come.
    pub fn swapped(&self) -> bool {
        self.other.is_some()
    }

    /// The parameters of the unit at the cable, with its biases at each power-on. A calibration has those of the last one before its last dwell.
    pub fn truths(&self, sensor: &Sensor) -> Vec<Truth> {
        let truth = self.other.as_ref().unwrap_or(sensor).board.truth;
        let of = |biases: &[Vector; 2]| {
            let mut own = truth;
            for (triad, step) in own.triads.iter_mut().zip(biases) {
                let by = times(&triad.matrix, *step);
                triad.bias = std::array::from_fn(|i| triad.bias[i] + by[i]);
            }
            own
        };
        self.biases.iter().map(of).collect()
    }

    /// The supply comes back.
    fn powered(&mut self) {
        (self.line, self.started_s) = (0, self.now_s);
        if self.trouble == Some(Trouble::Steps) {
            let random = &mut self.random;
            let step = BIAS_STEPS.map(|sigma| [0.0; 3].map(|_| sigma * random.normal()));
            self.biases.push(step);
        }
        if self.trouble == Some(Trouble::Swap) && self.now_s > SWAPPED_S && !self.swapped() {
            // The same part at the same rate.
            self.other = Some(Sensor::of(self.seed + 30_000));
        }
    }

    /// Another pose is requested.
    pub fn asked(&mut self, up: Vector) {
        let errs = self.random.even() < self.habits.errs;
        let up = match errs {
            true => unit([0.0; 3].map(|_| self.random.normal())),
            false => up,
        };
        self.due = Some((up, self.now_s + REACTION_S * (0.5 + self.random.even())));
        self.wanted = Some(up);
    }

    /// A dwell has ended.
    pub fn finished(&mut self) {
        self.since_s = self.now_s;
    }

    /// The wizard has said why it waits. The person follows advice.
    pub fn told(&mut self, why: &str) {
        if why.contains("put it down") && self.now_s > self.since_s + 10.0 {
            self.put_down_until_s = self.now_s + PUT_DOWN_S;
        }
    }

    fn happens(&mut self, every_s: f64) -> bool {
        self.random.even() < 0.1 / every_s
    }

    /// What comes from the board within the next tenth of a second.
    pub fn tenth(&mut self, first: &Sensor) -> Vec<Stamped> {
        let begin_s = self.now_s;
        let mut out = Vec::new();
        if let Some(until) = self.away_until_s {
            // Without a cable the board has no supply.
            self.now_s += 0.1;
            if self.now_s > until {
                self.away_until_s = None;
                self.powered();
                out.push((self.now_s, Arrival::Opened));
            }
            return out;
        }
        let in_hands = begin_s > self.habits.picks_up_s;
        if in_hands && self.happens(self.habits.pulled_s) {
            self.away_until_s = Some(begin_s + 3.0 + 12.0 * self.random.even());
            out.push((begin_s, Arrival::Lost("the port has vanished".into())));
            return out;
        }
        if self.happens(self.habits.resets_s) {
            (self.line, self.started_s) = (0, begin_s);
        }
        if self.happens(self.habits.stalls_s) {
            self.stalled_until_s = begin_s + 1.2;
        }
        self.decide();
        let other = self.other.take();
        let sensor = other.as_ref().unwrap_or(first);
        let mut text = String::new();
        let until_s = begin_s + 0.1;
        // By its own clock, which begins with its start.
        while self.started_s + self.line as f64 / (sensor.board.rate_hz * self.habits.clock)
            < until_s
        {
            let own_s = self.line as f64 / sensor.board.rate_hz;
            let at_s = self.started_s + own_s / self.habits.clock;
            self.line += 1;
            let written = self.written(sensor, at_s, own_s);
            if self.random.even() >= self.habits.lost {
                text.push_str(&written);
            }
        }
        self.other = other;
        self.now_s = until_s;
        out.push((until_s, Arrival::Bytes(text.into_bytes())));
        out
    }

    /// Begins a turn where one is due.
    fn decide(&mut self) {
        let now_s = self.now_s;
        if now_s < self.habits.picks_up_s || now_s < self.put_down_until_s || self.turn.is_some() {
            return;
        }
        if self.habits.yaws {
            self.habits.yaws = false;
            // About the vertical, in the body frame.
            let by = self.attitude[2].map(|v| 1.5 * v);
            self.begin(Turn {
                from: self.attitude,
                by,
                begin_s: now_s,
                lasts_s: 4.0,
            });
        } else if let Some((up, _)) = self.due.filter(|(_, at_s)| now_s > *at_s) {
            self.due = None;
            let up = unit([0, 1, 2].map(|i| up[i] + self.habits.tilt * self.random.normal()));
            self.turn_to(up);
        } else if self.due.is_none() && now_s > self.since_s + PUZZLED_S {
            let up = match (self.random.even() < 0.5, self.wanted) {
                (true, Some(up)) => up,
                _ => unit([0.0; 3].map(|_| self.random.normal())),
            };
            self.turn_to(up);
        } else if self.random.even() < 0.1 * self.habits.fidgets / 2.0 {
            let by = [0.0; 3].map(|_| 0.15 * self.random.normal());
            self.begin(Turn {
                from: self.attitude,
                by,
                begin_s: now_s,
                lasts_s: 0.8,
            });
        }
    }

    fn turn_to(&mut self, up: Vector) {
        let turn = Turn::to(self.attitude, up, self.now_s, &mut self.random);
        self.begin(turn);
    }

    fn begin(&mut self, turn: Turn) {
        self.turn = Some(turn);
    }

    /// The line of this time, by the computer's clock and by the board's.
    fn written(&mut self, sensor: &Sensor, at_s: f64, own_s: f64) -> String {
        let mut rate = [0.0; 3];
        let mut push = [0.0; 3];
        if let Some(turn) = &self.turn {
            let [done, change] = turn.share(at_s);
            self.attitude = product(&turn.from, &rotation(turn.by.map(|x| x * done)));
            rate = turn.by.map(|x| x * change);
            push = [1.5 * change * (0.5 - done), 0.0, change * (0.5 - done)];
            if done >= 1.0 {
                (self.turn, self.since_s) = (None, self.now_s);
            }
        }
        // In the hands within half a second, and out of them.
        let held = at_s > self.habits.picks_up_s && at_s > self.put_down_until_s;
        let per_s = if held { 2.0 } else { -2.0 };
        let dt = at_s - self.written_s;
        self.written_s = at_s;
        let before = self.held;
        self.held = (before + per_s * dt).clamp(0.0, 1.0);
        let change = if dt > 0.0 {
            (self.held - before) / dt
        } else {
            0.0
        };
        let (mut wobble, mut wobbles) = ([0.0; 3], [0.0; 3]);
        // Two frequencies on each axis, as of a hand and of an arm.
        for k in 0..3 {
            let angular = |hz: f64| std::f64::consts::TAU * hz;
            let at = |hz: f64, phase: f64| angular(hz) * at_s + phase;
            let [push_mps2, rate_radps] = self.habits.tremor;
            let both = at(8.3 + 0.4 * k as f64, self.phases[k]).sin()
                + 0.6 * at(1.7, self.phases[3 + k]).sin();
            push[k] += self.held * push_mps2 * both;
            for (hz, share, phase) in [
                (7.9 - 0.3 * k as f64, 1.0, self.phases[5 - k]),
                (2.1, 0.5, self.phases[k]),
            ] {
                let (sine, cosine) = at(hz, phase).sin_cos();
                let angle = share * rate_radps / angular(hz) * sine;
                wobble[k] += self.held * angle;
                wobbles[k] += self.held * share * rate_radps * cosine + change * angle;
            }
        }
        let wobble = rotation(wobble);
        let attitude = product(&self.attitude, &wobble);
        let turning = times(&transposed(&wobble), rate);
        let rate: Vector = std::array::from_fn(|k| turning[k] + wobbles[k]);
        let force = times(
            &transposed(&attitude),
            [push[0], push[1], GRAVITY + push[2]],
        );
        let [most_dps, most_g] = sensor.range;
        let rate = rate.map(|w| w.clamp(-most_dps.to_radians(), most_dps.to_radians()));
        let force = force.map(|f| f.clamp(-most_g * 9.80665, most_g * 9.80665));
        let with = |input: Vector, bias: Vector| std::array::from_fn(|k| input[k] + bias[k]);
        let [of_rate, of_force] = self.biases.last().copied().unwrap_or_default();
        let (rate, force) = (with(rate, of_rate), with(force, of_force));
        let line = sensor.board.line(own_s, rate, force, &mut self.random);
        // A board that has lost its sensor writes its last readings with new times.
        match (
            at_s < self.stalled_until_s,
            self.last_line.split_once(','),
            line.split_once(','),
        ) {
            (true, Some((_, readings)), Some((stamp, _))) => format!("{stamp},{readings}"),
            _ => {
                self.last_line.clone_from(&line);
                line
            }
        }
    }
}
