//! Analyses the samples in blocks of a tenth of a second: whether the unit is at rest, its pose, and its rate.

use std::collections::VecDeque;

use mimu::quantity::Sensor;
use mimu::signal::stillness::{STILL_FACTOR, WINDOW_S};
use mimu_core::compensation::Affine;
use mimu_recording::RAW_COLUMNS;
use mimu_recording::health::{Fault, Finding, Repetition, StuckChannel};
use nalgebra::{Matrix3, Vector3};

use crate::source::Chunk;

/// Length of a block, s.
const BLOCK_S: f64 = 0.1;
/// Time over which the rate of change of temperature is fitted, s. With a noise of 0.05 °C the slope is accurate to 0.05 °C/min.
const TREND_S: f64 = 60.0;
/// Shortest time for this fit, s.
const TREND_LEAST_S: f64 = 15.0;
/// Factor by which the gyro may exceed the limit of rest by hand, as in the detection of dwells in recordings: hands tremble in angle.
const GYRO_TREMOR: f64 = 30.0;

/// Thresholds of the squared change of the mean reading between poses. The first is relative to the squared reading at rest, or to that of a hundred
/// times its noise; a gyro at rest stays below. The second is relative to the noise; every accelerometer exceeds it.
const EXCHANGED: (f64, f64) = (0.1, 100.0);
/// Largest relative change of the size of the gyro's reading: gravity keeps its size from pose to pose, and a rate has none at rest.
const EXCHANGED_SIZE: f64 = 0.3;
/// Time for which the gyro has to read the same, s, and the share of the change by which it may differ: a hand that turns the unit about the vertical
/// does not keep its rate so steadily.
const EXCHANGED_FOR: (f64, f64) = (3.0, 0.05);
/// Time for which the unit has to be as quiet as on a table, at one level, before this level is used as its rest, s. No hand turns so steadily.
const LEARNT_S: f64 = 5.0;
/// Tremor of hands: the accelerometer's, as a share of gravity, and the gyro's, as a share of the largest mean rate so far. A turn by hand
/// reaches 50 to 150 deg/s, so that is 2 to 6 deg/s. With half of it, people with a strong tremor (1.6 deg/s rms) needed 25 to 50 minutes. Without it, a sensor with less noise than hands tremble would never be at rest in them.
const TREMOR: (f64, f64) = (0.01, 0.04);
/// If this share of the rows of a block repeats the row before, and this is no habit of the board, the board repeats its last reading.
const HELD: f64 = 0.5;

/// Means and squared deviations of the six channels.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    mean: [f64; 6],
    squares: [f64; 6],
}

impl Moments {
    fn add(&mut self, row: &[f64; 6]) {
        self.count += 1.0;
        for c in 0..6 {
            let off = row[c] - self.mean[c];
            self.mean[c] += off / self.count;
            self.squares[c] += off * (row[c] - self.mean[c]);
        }
    }

    fn join(&mut self, other: &Self) {
        let count = self.count + other.count;
        if count == 0.0 {
            return;
        }
        for c in 0..6 {
            let off = other.mean[c] - self.mean[c];
            self.squares[c] += other.squares[c] + off * off * self.count * other.count / count;
            self.mean[c] += off * other.count / count;
        }
        self.count = count;
    }
}

/// Statistics of a tenth of a second.
#[derive(Debug, Clone, Copy, Default)]
struct Block {
    moments: Moments,
    saturated: bool,
    /// Rows of each channel at its lowest or highest value so far.
    at_end: [u64; 6],
    missing: u64,
    /// Rows that repeat the row before.
    repeats: f64,
    /// Whether the board repeated its last reading.
    held: bool,
}

/// Statistics of the last second.
#[derive(Debug, Clone, Copy)]
pub struct LastSecond {
    /// Tick after its last sample.
    pub tick: u64,
    /// Mean raw readings.
    pub mean: [f64; 6],
    /// Standard deviations of gyro and accelerometer, relative to the limit of rest; the worst axis.
    pub motion: [f64; 2],
    /// If a reading may be at a rail: the channel that is most often at its extreme, or all.
    pub saturated: Option<Finding>,
    /// Missing samples in this second.
    pub missing: u64,
    /// Temperature, °C.
    pub temp_c: f64,
    /// Rate of change of the temperature over the last minute, °C/min, once there are enough samples.
    pub trend: Option<f64>,
    /// The first channel with a single value that had more before, or that should have changed when the unit was turned.
    pub stuck: Option<Finding>,
    /// Whether the gyro's readings follow the pose and the accelerometer's do not, as if the columns were exchanged.
    pub exchanged: bool,
    /// Whether its level was taken for rest instead of an earlier one.
    pub learnt: bool,
}

/// Analyses the samples of one unit while they arrive.
#[derive(Debug)]
pub struct Watch {
    rate_hz: f64,
    by_hand: bool,
    block_rows: f64,
    open: Block,
    window: VecDeque<Block>,
    next: Option<u64>,
    /// Variance of a sample in the quietest second so far, raw.
    floor: Option<[f64; 6]>,
    /// Mean readings at rest, and the sum of the gyro's variances in that second, once two successive seconds have agreed.
    rest: Option<([f64; 6], f64)>,
    channels: [StuckChannel; 6],
    /// Lowest and highest reading of each channel so far.
    extremes: [[f64; 2]; 6],
    /// Whether the unit has moved since [`Self::begin`].
    moved: bool,
    /// The seconds that ended within the last one: means and variances of the gyro.
    before: VecDeque<[[f64; 3]; 2]>,
    /// Whether [`Self::begin`] was called.
    begun: bool,
    /// Mean readings and variances of the seconds that were as quiet as on a table, without an interruption.
    quiet: VecDeque<[[f64; 6]; 2]>,
    /// Mean rates while the columns seemed exchanged, without an interruption.
    seems_exchanged: VecDeque<[f64; 3]>,
    /// Largest mean rate so far relative to rest, raw.
    largest_rate: f64,
    repetition: Repetition,
    temperatures: VecDeque<(u64, f64)>,
}

impl Watch {
    /// For a unit at this rate; `by_hand` allows the gyro the tremor of hands.
    pub fn new(rate_hz: f64, by_hand: bool) -> Self {
        Self {
            rate_hz,
            by_hand,
            block_rows: (BLOCK_S * rate_hz).round().max(4.0),
            open: Block::default(),
            window: VecDeque::new(),
            next: None,
            floor: None,
            rest: None,
            channels: [StuckChannel::default(); 6],
            extremes: [[f64::INFINITY, f64::NEG_INFINITY]; 6],
            moved: false,
            before: VecDeque::new(),
            begun: false,
            quiet: VecDeque::new(),
            seems_exchanged: VecDeque::new(),
            largest_rate: 0.0,
            repetition: Repetition::default(),
            temperatures: VecDeque::new(),
        }
    }

    /// Adds samples. Returns the statistics of the last second, if it is complete.
    pub fn take(&mut self, chunk: &Chunk) -> Option<LastSecond> {
        let missing = chunk.tick.saturating_sub(self.next.unwrap_or(chunk.tick));
        self.next = Some(chunk.end());
        // After a gap of more than a tenth of a second, a new second begins.
        if missing as f64 > self.block_rows {
            (self.open, self.window) = (Block::default(), VecDeque::new());
        }
        self.open.missing += missing;
        let mut seen = None;
        for (k, row) in (1..).zip(&chunk.values) {
            self.open.moments.add(row);
            for (channel, value) in self.channels.iter_mut().zip(row) {
                channel.take(*value);
            }
            for (c, ([low, high], value)) in self.extremes.iter_mut().zip(row).enumerate() {
                (*low, *high) = (low.min(*value), high.max(*value));
                self.open.at_end[c] += u64::from(value == low || value == high);
            }
            self.open.saturated |= chunk.saturated;
            self.open.repeats += f64::from(self.repetition.take(row));
            if self.open.moments.count >= self.block_rows {
                self.count_repeats();
                self.window.push_back(std::mem::take(&mut self.open));
                let whole = (WINDOW_S / BLOCK_S).round() as usize;
                if self.window.len() > whole {
                    self.window.pop_front();
                }
                self.follow(chunk.tick + k, chunk.temp_c);
                if self.window.len() == whole && !chunk.self_test {
                    seen = Some(self.see(chunk.tick + k, chunk.temp_c));
                }
            }
        }
        seen
    }

    /// Finds whether the board repeated its last reading in the open block.
    fn count_repeats(&mut self) {
        let (count, repeats) = (self.open.moments.count, self.open.repeats);
        let held = repeats > HELD * count && self.repetition.is_fault(self.rate_hz);
        if !held {
            self.repetition.count(count, repeats);
        }
        self.open.held = held;
    }

    /// Discards the last second: later samples are unrelated to it.
    pub fn interrupted(&mut self) {
        (self.open, self.window) = (Block::default(), VecDeque::new());
        self.before.clear();
        self.quiet.clear();
        self.seems_exchanged.clear();
        self.temperatures.clear();
    }

    /// Discards the reading and noise at rest: the unit may have been turning.
    pub fn was_turning(&mut self) {
        self.interrupted();
        (self.floor, self.rest) = (None, None);
    }

    /// From now on the unit may be turned: the gyro's reading at rest is known.
    pub fn begin(&mut self) {
        self.begun = true;
    }

    /// Whether the noise at rest is known.
    pub fn knows_rest(&self) -> bool {
        self.rest.is_some()
    }

    /// Uses a second as rest if it agrees with the second before in mean and variance of each gyro axis. A table that slows down fails this. It may
    /// report rest while samples of its motion still arrive.
    fn find_rest(&mut self, means: [f64; 6], variances: [f64; 6]) {
        let first = |of: [f64; 6]| [of[0], of[1], of[2]];
        let (mean, variance) = (first(means), first(variances));
        let whole = (WINDOW_S / BLOCK_S).round() as usize;
        let agrees = |[mean_0, variance_0]: &[[f64; 3]; 2]| {
            (0..3).all(|c| {
                let least = variance[c].min(variance_0[c]);
                let most = variance[c].max(variance_0[c]);
                (mean[c] - mean_0[c]).powi(2) <= least && most <= STILL_FACTOR * least
            })
        };
        let agreed = self.before.len() == whole && self.before.front().is_some_and(agrees);
        let sum = variance.iter().sum();
        if agreed && self.rest.is_none_or(|(_, quietest)| sum <= quietest) {
            self.rest = Some((means, sum));
        }
        if self.before.len() == whole {
            self.before.pop_front();
        }
        self.before.push_back([mean, variance]);
    }

    /// Uses the present level as rest, if the unit has been as quiet as on a table for [`LEARNT_S`] at one level, and the present rest is another one:
    /// the unit may have moved when it was measured, and biases change. Returns whether it did.
    fn learn_rest(&mut self, means: [f64; 6], variances: [f64; 6], floor: &[f64; 6]) -> bool {
        if (0..6).any(|c| variances[c] > STILL_FACTOR * floor[c]) {
            self.quiet.clear();
            return false;
        }
        self.quiet.push_back([means, variances]);
        if (self.quiet.len() as f64) < LEARNT_S / BLOCK_S {
            return false;
        }
        let first = self.quiet[0];
        let agrees = |[mean, variance]: &[[f64; 6]; 2]| {
            (0..6).all(|c| {
                let least = variance[c].min(first[1][c]).max(floor[c]);
                (mean[c] - first[0][c]).powi(2) <= least
            })
        };
        let steady = self.quiet.iter().all(agrees);
        self.quiet.pop_front();
        let is_rest = self.rest.is_some_and(|(rest, _)| {
            (0..3).all(|c| (means[c] - rest[c]).powi(2) <= 9.0 * variances[c].max(floor[c]))
        });
        if !steady || is_rest {
            return false;
        }
        self.rest = Some((means, variances[..3].iter().sum()));
        true
    }

    /// Whether the columns have seemed exchanged, with one reading of the gyro, for long enough. `rate`: mean rates of the last second relative to
    /// rest, if they seem so now.
    fn are_exchanged(&mut self, rate: Option<[f64; 3]>) -> bool {
        let Some(rate) = rate else {
            self.seems_exchanged.clear();
            return false;
        };
        self.seems_exchanged.push_back(rate);
        if (self.seems_exchanged.len() as f64) < EXCHANGED_FOR.0 / BLOCK_S {
            return false;
        }
        let first = Vector3::from(self.seems_exchanged[0]);
        let near =
            |now: &[f64; 3]| (Vector3::from(*now) - first).norm() < EXCHANGED_FOR.1 * first.norm();
        let same = self.seems_exchanged.iter().all(near);
        self.seems_exchanged.pop_front();
        same
    }

    fn follow(&mut self, tick: u64, temp_c: f64) {
        if temp_c.is_finite() {
            self.temperatures.push_back((tick, temp_c));
        }
        let from = tick.saturating_sub((TREND_S * self.rate_hz) as u64);
        while self.temperatures.front().is_some_and(|(t, _)| *t < from) {
            self.temperatures.pop_front();
        }
    }

    /// Slope of a straight line, °C/min.
    fn trend(&self) -> Option<f64> {
        let (first, last) = (self.temperatures.front()?, self.temperatures.back()?);
        if ((last.0 - first.0) as f64) < TREND_LEAST_S * self.rate_hz {
            return None;
        }
        let n = self.temperatures.len() as f64;
        let minutes = |t: u64| (t - first.0) as f64 / self.rate_hz / 60.0;
        let (t, c) = self
            .temperatures
            .iter()
            .fold((0.0, 0.0), |(t, c), x| (t + minutes(x.0) / n, c + x.1 / n));
        let products = self.temperatures.iter().map(|x| {
            let off = minutes(x.0) - t;
            (off * (x.1 - c), off * off)
        });
        let (tc, tt) = products.fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
        Some(tc / tt)
    }

    fn see(&mut self, tick: u64, temp_c: f64) -> LastSecond {
        let mut all = Moments::default();
        let (mut saturated, mut missing, mut held) = (false, 0, false);
        for block in &self.window {
            all.join(&block.moments);
            saturated |= block.saturated;
            missing += block.missing;
            held |= block.held;
        }
        let own = all.squares.map(|s| s / (all.count - 1.0));
        for (channel, own) in self.channels.iter_mut().zip(&own) {
            // A reading that is repeated says nothing about the noise.
            if !held {
                channel.second(*own);
            }
        }
        let (channels, rows) = (self.channels, all.count as u64);
        let constant = (0..6).filter(|&c| own[c] == 0.0);
        let stuck = constant
            .filter_map(|c| channels[c].found(c, rows, self.moved))
            .next();
        // A coarse step hides at least this variance.
        let variance: [f64; 6] = std::array::from_fn(|c| own[c].max(channels[c].hidden()));
        let saturated = saturated.then(|| self.at_end());
        let sound = stuck.is_none() && saturated.is_none() && !held;
        if sound {
            // Only before the unit may be turned: a table's steady rate is as quiet as rest.
            if !self.begun {
                self.find_rest(all.mean, variance);
            }
            let floor = self.floor.get_or_insert(variance);
            for c in 0..6 {
                floor[c] = floor[c].min(variance[c]);
            }
        }
        let floor = self.floor.unwrap_or(variance);
        let floor: [f64; 6] = std::array::from_fn(|c| floor[c].max(channels[c].hidden()));
        let force = Vector3::from_fn(|c, _| all.mean[3 + c]).norm();
        let motion = Sensor::BOTH.map(|sensor| {
            let (factor, tremor) = match (sensor, self.by_hand) {
                (_, false) => (STILL_FACTOR, 0.0),
                (Sensor::Gyro, true) => (GYRO_TREMOR * STILL_FACTOR, TREMOR.1 * self.largest_rate),
                (Sensor::Accel, true) => (STILL_FACTOR, TREMOR.0 * force),
            };
            let allowed = |c: usize| (factor * floor[c]).max(tremor * tremor);
            // A constant channel gives 0 / 0, which counts as rest.
            let ratio = |c: usize| (variance[c] / allowed(c)).sqrt();
            sensor.channels().map(ratio).fold(0.0, f64::max)
        });
        let moves = motion.iter().any(|m| *m > 1.0);
        self.moved |= self.begun && moves;
        let rate = self
            .rest
            .map(|(rest, _)| [0, 1, 2].map(|c| all.mean[c] - rest[c]));
        if let Some(rate) = rate.filter(|_| self.begun && saturated.is_none()) {
            self.largest_rate = self.largest_rate.max(Vector3::from(rate).norm());
        }
        let seems_exchanged = self.rest.is_some_and(|(rest, _)| {
            let of = |sensor: Sensor, squares: &dyn Fn(usize) -> f64| {
                sensor.channels().map(squares).sum::<f64>()
            };
            let changed = |sensor| of(sensor, &|c| (all.mean[c] - rest[c]).powi(2));
            let size = |sensor| of(sensor, &|c| rest[c] * rest[c]);
            let noise = |sensor| of(sensor, &|c| floor[c]);
            let size_of = |row: [f64; 6]| Vector3::new(row[0], row[1], row[2]).norm();
            self.by_hand
                && !moves
                && (size_of(all.mean) / size_of(rest) - 1.0).abs() < EXCHANGED_SIZE
                && changed(Sensor::Gyro)
                    > EXCHANGED.0 * size(Sensor::Gyro).max(1e4 * noise(Sensor::Gyro))
                && changed(Sensor::Accel) < EXCHANGED.1 * noise(Sensor::Accel)
        });
        let learns = sound && self.begun && self.by_hand && !seems_exchanged;
        let learnt = learns && self.learn_rest(all.mean, variance, &floor);
        let exchanged = self.are_exchanged(rate.filter(|_| seems_exchanged));
        LastSecond {
            tick,
            mean: all.mean,
            motion,
            saturated,
            missing,
            temp_c,
            trend: self.trend(),
            stuck,
            exchanged,
            learnt,
        }
    }

    /// The finding about the channel that was most often at its extreme in the last second, of those that have had several values.
    fn at_end(&self) -> Finding {
        let count = |c: usize| self.window.iter().map(|b| b.at_end[c]).sum::<u64>();
        let varied = (0..6).filter(|c| self.extremes[*c][0] < self.extremes[*c][1]);
        match varied.max_by_key(|c| count(*c)) {
            Some(c) => Finding::new(RAW_COLUMNS[c], count(c), Fault::AtEnd),
            None => Finding::of_all(0, Fault::AtEnd),
        }
    }

    /// Rate of a second relative to rest, rad/s; `gyro` is the model raw to SI.
    pub fn rate(&self, seen: &LastSecond, gyro: &Affine<f64>) -> Vector3<f64> {
        let rest = self.rest.map_or([0.0; 6], |r| r.0);
        gyro.matrix * Vector3::from_fn(|c, _| seen.mean[c] - rest[c])
    }
}

/// Specific force; `accel` is the model raw to SI.
pub fn force(seen: &LastSecond, accel: &Affine<f64>) -> Vector3<f64> {
    accel.apply(&Vector3::from_fn(|c, _| seen.mean[3 + c]))
}

/// Model of a board without a data sheet. At rest its accelerometer reads gravity, which gives the scale. The gyro's scale is set to 1 rad/s per raw
/// unit, so only its directions are meaningful.
pub fn guessed(seen: &LastSecond, gravity_mps2: f64) -> [Affine<f64>; 2] {
    let size = Vector3::from_fn(|c, _| seen.mean[3 + c]).norm();
    let plain = |factor: f64| Affine {
        matrix: Matrix3::identity() * factor,
        offset: Vector3::zeros(),
    };
    [
        plain(1.0),
        plain(gravity_mps2 / size.max(f64::MIN_POSITIVE)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(tick: u64, rows: usize, offset: f64, spread: f64) -> Chunk {
        let row = |k: usize| {
            let noise = ((tick as usize + k) as f64 * 0.618_034).fract() - 0.5;
            [0, 1, 2, 3, 4, 5].map(|c| offset + spread * noise * (1.0 + 0.1 * c as f64))
        };
        Chunk {
            tick,
            values: (0..rows).map(row).collect(),
            mag: Vec::new(),
            temp_c: 20.0 + tick as f64 / 60e3,
            saturated: false,
            self_test: false,
            crystal_ns: None,
            power_on_s: None,
        }
    }

    #[test]
    fn what_is_five_times_as_noisy_as_the_quietest_second_is_no_rest() {
        let mut watch = Watch::new(1000.0, false);
        let mut last = None;
        for k in 0..100 {
            last = watch.take(&chunk(20 * k, 20, 1.0, 0.01)).or(last);
        }
        assert!(last.unwrap().motion.iter().all(|m| *m < 0.5), "{last:?}");
        for k in 100..150 {
            last = watch.take(&chunk(20 * k, 20, 1.0, 0.05)).or(last);
        }
        assert!(last.unwrap().motion.iter().all(|m| *m > 1.0), "{last:?}");
    }

    #[test]
    fn a_second_in_which_the_table_slows_down_is_not_rest() {
        let mut watch = Watch::new(1000.0, false);
        for k in 0..60 {
            let turning = 1.0 + 0.01 * (50.0 - k as f64).max(0.0);
            watch.take(&chunk(20 * k, 20, turning, 0.01));
        }
        assert!(!watch.knows_rest());
        let mut last = None;
        for k in 60..200 {
            last = watch.take(&chunk(20 * k, 20, 1.0, 0.01)).or(last);
        }
        let plain = guessed(&last.unwrap(), 9.8)[0];
        assert!(watch.knows_rest() && watch.rate(&last.unwrap(), &plain).norm() < 1e-3);
        watch.was_turning();
        assert!(!watch.knows_rest());
    }

    #[test]
    fn a_steady_rate_is_not_taken_for_rest_because_it_is_quieter() {
        let mut watch = Watch::new(1000.0, false);
        for k in 0..100 {
            watch.take(&chunk(20 * k, 20, 1.0, 0.01));
        }
        watch.begin();
        let mut last = None;
        for k in 100..200 {
            last = watch.take(&chunk(20 * k, 20, 1.5, 0.009)).or(last);
        }
        let plain = guessed(&last.unwrap(), 9.8)[0];
        assert!((watch.rate(&last.unwrap(), &plain).x - 0.5).abs() < 1e-3);
    }

    #[test]
    fn the_trend_of_the_temperature_is_in_degrees_a_minute() {
        let mut watch = Watch::new(1000.0, false);
        let mut last = None;
        for k in 0..2000 {
            last = watch.take(&chunk(20 * k, 20, 1.0, 0.01)).or(last);
        }
        assert!(
            (last.unwrap().trend.unwrap() - 1.0).abs() < 1e-6,
            "{last:?}"
        );
    }

    /// A second and a half at rest of a board with less noise than its step, at `level`.
    fn coarse(watch: &mut Watch, tick: u64, level: [f64; 6]) -> Option<LastSecond> {
        let mut one = chunk(tick, 150, 0.0, 0.0);
        one.values.fill(level);
        watch.take(&one)
    }

    #[test]
    fn a_board_whose_step_is_coarser_than_its_noise_comes_to_rest_and_a_dead_channel_does_not_turn()
    {
        let mut watch = Watch::new(100.0, true);
        coarse(&mut watch, 0, [1.0, 2.0, 0.0, 3.0, 0.0, 250.0]);
        let seen = coarse(&mut watch, 150, [1.0, 2.0, 0.0, 3.0, 0.0, 250.0]).unwrap();
        assert!(watch.knows_rest() && seen.stuck.is_none(), "{seen:?}");
        watch.begin();
        // Turned and held again. All channels have changed except gyro z, whose wire is broken.
        for k in 0..10 {
            let turning = 20.0 * f64::from(k % 3);
            coarse(
                &mut watch,
                300 + 15 * k as u64,
                [
                    turning,
                    2.0 + turning,
                    0.0,
                    turning,
                    turning,
                    250.0 - turning,
                ],
            );
        }
        let seen = coarse(&mut watch, 3000, [1.0, 2.0, 0.0, 251.0, 2.0, 4.0]).unwrap();
        let stuck = seen.stuck.as_ref().and_then(|stuck| stuck.about);
        assert_eq!(stuck, Some("gyro_z"), "{seen:?}");
        assert!(
            seen.motion.iter().all(|m| *m <= 1.0) && !seen.exchanged,
            "{seen:?}"
        );
    }

    #[test]
    fn a_gyro_that_reads_the_pose_is_an_accelerometer() {
        let mut watch = Watch::new(1000.0, true);
        let at = |watch: &mut Watch, tick: u64, gyro: [f64; 3]| {
            let mut one = chunk(tick, 6000, 0.0, 0.01);
            for row in &mut one.values {
                (row[0], row[1], row[2]) = (gyro[0] + row[0], gyro[1] + row[1], gyro[2] + row[2]);
            }
            watch.take(&one).unwrap()
        };
        assert!(!at(&mut watch, 0, [0.1, 0.2, 9.8]).exchanged);
        watch.begin();
        assert!(at(&mut watch, 6000, [9.8, 0.1, 0.2]).exchanged);
    }

    /// Rows whose gyro reads `rate(s)` beside noise; the accelerometer reads gravity.
    fn in_hand(
        watch: &mut Watch,
        ticks: std::ops::Range<u64>,
        rate: impl Fn(f64) -> f64,
    ) -> Vec<LastSecond> {
        ticks
            .step_by(20)
            .filter_map(|tick| {
                let mut one = chunk(tick, 20, 0.0, 0.01);
                for (k, row) in (tick..).zip(&mut one.values) {
                    row[2] += rate(k as f64 / 1000.0);
                    row[5] += 9.8;
                }
                watch.take(&one)
            })
            .collect()
    }

    #[test]
    fn a_unit_that_is_yawed_by_hand_has_no_exchanged_columns() {
        let mut watch = Watch::new(1000.0, true);
        in_hand(&mut watch, 0..3000, |_| 0.0);
        watch.begin();
        // A turn about the vertical within six seconds, faster in its middle.
        let seen = in_hand(&mut watch, 3000..12_000, |s| {
            (1.0 + 0.3 * (1.7 * s).sin()) * f64::from(u8::from((4.0..10.0).contains(&s)))
        });
        assert!(seen.iter().all(|s| !s.exchanged));
    }

    #[test]
    fn a_rest_that_was_measured_in_motion_is_learned_again_where_the_unit_lies_still() {
        let mut watch = Watch::new(1000.0, true);
        in_hand(&mut watch, 0..2000, |_| 0.0);
        in_hand(&mut watch, 2000..10_000, |s| 0.3 + 0.02 * (9.0 * s).sin());
        watch.was_turning();
        in_hand(&mut watch, 10_000..14_000, |s| 0.3 + 0.02 * (9.0 * s).sin());
        assert!(watch.knows_rest());
        watch.begin();
        let plain = guessed(&in_hand(&mut watch, 14_000..16_000, |_| 0.0)[0], 9.8)[0];
        let seen = in_hand(&mut watch, 16_000..26_000, |_| 0.0);
        let learnt = seen.iter().position(|s| s.learnt).unwrap();
        assert!(learnt < 60, "{learnt}");
        assert_eq!(seen.iter().filter(|s| s.learnt).count(), 1);
        assert!(watch.rate(&seen[seen.len() - 1], &plain).norm() < 0.01);
    }

    #[test]
    fn a_reading_that_is_repeated_for_a_second_does_not_lower_the_noise() {
        let mut watch = Watch::new(1000.0, true);
        in_hand(&mut watch, 0..5000, |_| 0.0);
        let noise = watch.floor.unwrap();
        watch.begin();
        let mut last = chunk(4999, 1, 0.0, 0.01).values[0];
        last[5] += 9.8;
        let mut held = chunk(5000, 1000, 0.0, 0.0);
        held.values.fill(last);
        watch.take(&held);
        let after = in_hand(&mut watch, 6000..9000, |_| 0.0);
        assert!(after[after.len() - 1].motion.iter().all(|m| *m < 1.0));
        let now = watch.floor.unwrap();
        assert!((0..6).all(|c| now[c] > 0.9 * noise[c]), "{noise:?} {now:?}");
    }

    #[test]
    fn a_sensor_with_less_noise_than_hands_tremble_comes_to_rest_in_them() {
        let mut watch = Watch::new(1000.0, true);
        in_hand(&mut watch, 0..3000, |_| 0.0);
        watch.begin();
        in_hand(&mut watch, 3000..5000, |_| 100.0);
        // 2 units of rate, where the noise is 0.003.
        let seen = in_hand(&mut watch, 5000..9000, |s| 2.0 * (40.0 * s).sin());
        assert!(seen[seen.len() - 1].motion[0] < 1.0, "{:?}", seen.last());
        let seen = in_hand(&mut watch, 9000..12_000, |s| 20.0 * (40.0 * s).sin());
        assert!(seen[seen.len() - 1].motion[0] > 1.0);
    }

    #[test]
    fn a_gap_begins_another_second() {
        let mut watch = Watch::new(1000.0, false);
        for k in 0..60 {
            watch.take(&chunk(20 * k, 20, 1.0, 0.01));
        }
        assert!(watch.take(&chunk(5000, 100, 1.0, 0.01)).is_none());
    }
}
