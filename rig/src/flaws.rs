//! Flaws of real recordings that no tolerance of a data sheet covers.
//!
//! Each flaw has a separate random stream and is off by default: switching one on does not change the rest of a recording.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::motion::{Instant, Motion};
use crate::random::Random;
use crate::refusal::{Refusal, within};
use crate::rotation::{Vector, add, scale};

/// `[flaws]` of a rig file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlawsTruth {
    /// Jitter of the time stamps, standard deviation, s. The samples themselves are evenly spaced.
    pub stamp_jitter_s: f64,
    /// Number of samples that are fetched and stamped at once; 1: no bursts.
    pub stamp_burst: u32,
    /// Share of lost samples, each drawn separately; the time stamps of the others are right.
    pub lost_share: f64,
    /// After this many samples the logger pauses and records none; 0 is never.
    pub pause_after: u32,
    /// Length of each pause, s, rounded to whole samples.
    pub pause_s: f64,
    /// Number of turns by hand that contain a violent shake.
    pub shake_turns: u32,
    /// Band of the shake, Hz.
    pub shake_hz: [f64; 2],
    /// Rms shake about each axis in the middle of the turn.
    pub shake_mrad: f64,
    /// Slow settling of the hand after each turn, standard deviation about each axis.
    pub settle_mrad: f64,
    /// Its duration, s, cut short by the next turn.
    pub settle_s: f64,
    /// Number of dwells by hand in which the unit turns evenly instead of resting.
    pub turning_rests: u32,
    /// Rate of these turns, deg/s, about random axes.
    pub turning_dps: f64,
    /// Number of turns between dwells in which the biases of the gyros are disturbed.
    pub upset_turns: u32,
    /// Size of the disturbance, deg/s, in a random direction.
    pub upset_dps: f64,
    /// Start and end of the time in which the thermometer is stuck at its last value, s of the recording.
    pub thermometer_sticks_s: [f64; 2],
    /// When the thermometer jumps, s of the recording.
    pub thermometer_jumps_s: f64,
    /// Size of the jump, K.
    pub thermometer_jump_c: f64,
    /// Frequency at which the building sways, Hz.
    pub building_hz: f64,
    /// Amplitude of its acceleration along both level axes, mg.
    pub building_mg: f64,
}

impl Default for FlawsTruth {
    fn default() -> Self {
        Self {
            stamp_jitter_s: 0.0,
            stamp_burst: 1,
            lost_share: 0.0,
            pause_after: 0,
            pause_s: 1.0,
            shake_turns: 0,
            shake_hz: [4.0, 6.0],
            shake_mrad: 250.0,
            settle_mrad: 0.0,
            settle_s: 2.0,
            turning_rests: 0,
            turning_dps: 5.0,
            upset_turns: 0,
            upset_dps: 5.0,
            thermometer_sticks_s: [0.0; 2],
            thermometer_jumps_s: 0.0,
            thermometer_jump_c: 0.0,
            building_hz: 0.56,
            building_mg: 0.0,
        }
    }
}

impl FlawsTruth {
    /// Refuses impossible values.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        let (size, time) = ([0.0, 1000.0], [0.0, 48.0 * 3600.0]);
        let [from, to] = self.thermometer_sticks_s;
        if from > to {
            return Err(Refusal::new(
                "flaws.thermometer_sticks_s",
                format!("`thermometer_sticks_s` ends at {to} s, before it begins"),
                "give [from, to]",
            ));
        }
        for (key, values, range) in [
            ("stamp_jitter_s", &[self.stamp_jitter_s][..], [0.0, 1.0]),
            (
                "stamp_burst",
                &[f64::from(self.stamp_burst)],
                [1.0, 10_000.0],
            ),
            ("lost_share", &[self.lost_share], [0.0, 0.9]),
            ("pause_s", &[self.pause_s], [0.0, 3600.0]),
            ("shake_hz", &self.shake_hz, [0.1, 100.0]),
            ("shake_mrad", &[self.shake_mrad], [0.0, 3000.0]),
            ("settle_mrad", &[self.settle_mrad], size),
            ("settle_s", &[self.settle_s], [0.01, 600.0]),
            ("turning_dps", &[self.turning_dps], size),
            ("upset_dps", &[self.upset_dps], size),
            ("thermometer_sticks_s", &self.thermometer_sticks_s, time),
            ("thermometer_jumps_s", &[self.thermometer_jumps_s], time),
            (
                "thermometer_jump_c",
                &[self.thermometer_jump_c],
                [-100.0, 100.0],
            ),
            ("building_hz", &[self.building_hz], [0.0, 100.0]),
            ("building_mg", &[self.building_mg], size),
        ] {
            within(&format!("flaws.{key}"), values, range)?;
        }
        Ok(())
    }
}

/// Selects at random `count` of `n` things for a flaw.
pub(crate) fn pick(count: u32, n: usize, random: &mut Random) -> Vec<bool> {
    let mut order: Vec<usize> = (0..n).collect();
    let mut picked = vec![false; n];
    for k in 0..n.min(count as usize) {
        let other = k + (random.uniform() * (n - k) as f64) as usize;
        order.swap(k, other);
        picked[order[k]] = true;
    }
    picked
}

/// A random direction, uniformly distributed.
pub(crate) fn direction(random: &mut Random) -> Vector {
    random.attitude().turn([0.0, 0.0, 1.0])
}

/// Which samples are missing in a recording.
#[derive(Debug, Clone)]
pub(crate) struct Lost {
    share: f64,
    random: Random,
    /// Samples between two pauses, and in one; `None` without pauses.
    pauses: Option<[usize; 2]>,
}

impl Lost {
    /// For a recording with a sample every `period_s`.
    pub(crate) fn new(truth: &FlawsTruth, period_s: f64, seed: u64) -> Self {
        let in_pause = (truth.pause_s / period_s).round() as usize;
        let between = truth.pause_after as usize;
        Self {
            share: truth.lost_share,
            random: Random::new(seed, "lost samples"),
            pauses: (between > 0 && in_pause > 0).then_some([between, in_pause]),
        }
    }

    /// Whether sample `index` is missing; must be called for each sample in order.
    pub(crate) fn lacks(&mut self, index: usize) -> bool {
        let pauses = |[between, in_pause]: [usize; 2]| index % (between + in_pause) >= between;
        let lost = self.share > 0.0 && self.random.uniform() < self.share;
        lost || self.pauses.is_some_and(pauses)
    }

    /// Number of recorded samples among the first `count`.
    pub(crate) fn recorded(&self, count: usize) -> usize {
        let mut again = self.clone();
        (0..count).filter(|&index| !again.lacks(index)).count()
    }
}

/// Distance of the time stamps of two samples that are fetched together, s; at most a tenth of a period.
const FETCH_S: f64 = 1e-4;
/// Smallest difference of successive time stamps, s.
const STAMP_STEP_S: f64 = 1e-6;

/// The flaws between the motion and the samples, applied sample by sample.
#[derive(Debug, Clone)]
pub(crate) struct Flaws {
    truth: FlawsTruth,
    period_s: f64,
    jitter: Random,
    last_stamp_s: f64,
    /// Disturbance of the gyros' biases after each dwell, rad/s.
    upset: Vec<Vector>,
    last_step: Option<u32>,
    phase: [f64; 2],
    stuck_c: Option<f64>,
}

impl Flaws {
    /// For a recording with `dwells`, a sample every `period_s`.
    pub(crate) fn new(truth: &FlawsTruth, dwells: u64, period_s: f64, seed: u64) -> Self {
        let mut random = Random::new(seed, "upset turns");
        let turns = (dwells as usize).saturating_sub(1);
        let picked = pick(truth.upset_turns, turns, &mut random);
        let size = truth.upset_dps.to_radians();
        let upset = |s: bool| match s {
            true => scale(size, direction(&mut random)),
            false => [0.0; 3],
        };
        let upset = picked.into_iter().map(upset).collect();
        let mut building = Random::new(seed, "building");
        Self {
            truth: truth.clone(),
            period_s,
            jitter: Random::new(seed, "stamp jitter"),
            last_stamp_s: f64::NEG_INFINITY,
            upset,
            last_step: None,
            phase: [0; 2].map(|_| TAU * building.uniform()),
            stuck_c: None,
        }
    }

    /// Adds the building's sway to the motion.
    pub(crate) fn sway(&self, instant: &mut Instant) {
        if self.truth.building_mg == 0.0 {
            return;
        }
        let motion = &mut instant.motion;
        let angle = TAU * self.truth.building_hz * motion.t_s;
        let [east, north] = self
            .phase
            .map(|phase| 9.80665e-3 * self.truth.building_mg * (angle + phase).sin());
        let sway = motion.attitude.inverse().turn([east, north, 0.0]);
        motion.force = add(motion.force, sway);
    }

    /// The motion as sensed: a disturbed gyro has an additional rate.
    pub(crate) fn sensed(&mut self, instant: &Instant) -> Motion {
        self.last_step = instant.step.or(self.last_step);
        let before = self.last_step.filter(|_| instant.step.is_none());
        let upset = before.and_then(|step| self.upset.get(step as usize));
        Motion {
            rate: add(instant.motion.rate, upset.copied().unwrap_or_default()),
            ..instant.motion
        }
    }

    /// Reported temperature, where a sound thermometer would report `temp_c`.
    pub(crate) fn thermometer(&mut self, t_s: f64, temp_c: f64) -> f64 {
        let truth = &self.truth;
        let mut reported = temp_c;
        if truth.thermometer_jump_c != 0.0 && t_s >= truth.thermometer_jumps_s {
            reported += truth.thermometer_jump_c;
        }
        let [from, to] = truth.thermometer_sticks_s;
        if t_s >= from && t_s < to {
            return *self.stuck_c.get_or_insert(reported);
        }
        reported
    }

    /// Time stamp of sample `index`, which was taken at `t_s`. Always later than the one before.
    pub(crate) fn stamp(&mut self, index: usize, t_s: f64) -> f64 {
        let mut stamp_s = t_s;
        let burst = self.truth.stamp_burst as usize;
        if burst > 1 {
            let (behind, of_burst) = (index % burst, burst - 1);
            let fetched_s = t_s + (of_burst - behind) as f64 * self.period_s;
            let apart_s = FETCH_S.min(0.1 * self.period_s);
            stamp_s = fetched_s + behind as f64 * apart_s;
        }
        if self.truth.stamp_jitter_s > 0.0 {
            stamp_s += self.truth.stamp_jitter_s * self.jitter.normal();
            stamp_s = stamp_s.max(self.last_stamp_s + STAMP_STEP_S);
        }
        self.last_stamp_s = stamp_s;
        stamp_s
    }
}
