//! The samples as they come, looked at a tenth of a second at a time: is the unit still, which way is up, how fast does it turn.

use std::collections::VecDeque;

use mimu::quantity::Sensor;
use mimu::signal::stillness::{STILL_FACTOR, WINDOW_S};
use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};

use crate::source::Chunk;

/// Length of a block, s.
const BLOCK_S: f64 = 0.1;
/// Over how long the change of temperature is taken, s: with a noise of 0.05 °C the slope is then good to 0.05 °C/min.
const TREND_S: f64 = 60.0;
/// Least of that, s, to say anything.
const TREND_LEAST_S: f64 = 15.0;
/// What the gyro is allowed beyond a still accelerometer by hand: see the stillness of recordings, where hands tremble in angle.
const GYRO_TREMOR: f64 = 30.0;

/// Squares of a change from one pose to another, over that of the reading at rest (and a hundred times its noise), that no gyro has which is
/// held still; and over the noise, that every accelerometer has.
const EXCHANGED: (f64, f64) = (0.1, 100.0);

/// Moments of the six channels.
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

/// What is known of the codes of a channel.
#[derive(Debug, Clone, Copy, Default)]
struct Codes {
    last: Option<f64>,
    /// Smallest change so far; none where there was no change.
    step: Option<f64>,
    /// Whether the first second had one value: a step larger than the noise, or a broken wire.
    constant: Option<bool>,
    /// Variance of the quietest second with more than one value.
    quietest: Option<f64>,
}

impl Codes {
    fn add(&mut self, value: f64) {
        let change = self.last.map_or(0.0, |last| (value - last).abs());
        if change > 0.0 {
            self.step = Some(self.step.map_or(change, |step| step.min(change)));
        }
        self.last = Some(value);
    }

    /// Takes in the variance of a second.
    fn judge(&mut self, variance: f64) {
        self.constant.get_or_insert(variance == 0.0);
        if variance > 0.0 {
            self.quietest = Some(self.quietest.map_or(variance, |least| least.min(variance)));
        }
    }

    /// Whether its step is larger than its noise, so that it may have one value for a second. A channel whose noise is half a step is constant for
    /// a hundred samples once in 1e16 seconds.
    fn is_coarse(&self) -> bool {
        let hides = |(step, variance): (f64, f64)| variance < step * step / 3.0;
        self.constant == Some(true) || self.step.zip(self.quietest).is_some_and(hides)
    }

    /// Whether a second of one value is none of a coarse step. `moved`: the unit was turned since.
    fn is_stuck(&self, moved: bool) -> bool {
        !self.is_coarse() || moved && self.step.is_none()
    }

    /// Variance that a coarse step hides.
    fn hidden(&self) -> f64 {
        let step = self.step.filter(|_| self.is_coarse());
        step.map_or(0.0, |step| step * step / 12.0)
    }
}

/// A tenth of a second.
#[derive(Debug, Clone, Copy, Default)]
struct Block {
    moments: Moments,
    saturated: bool,
    missing: u64,
}

/// What the last second was like.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// Tick after it.
    pub tick: u64,
    /// Means, raw.
    pub mean: [f64; 6],
    /// Standard deviation of gyro and accelerometer over the most that counts as still; the worst axis.
    pub motion: [f64; 2],
    /// Whether a reading may be at the end of its range.
    pub saturated: bool,
    /// Samples that are missing in it.
    pub missing: u64,
    /// °C.
    pub temp_c: f64,
    /// °C/min over the last minute, once there is enough of it.
    pub trend: Option<f64>,
    /// The first channel that has one value only, and once had more or is turned.
    pub stuck: Option<usize>,
    /// Whether the gyro's readings follow the pose and the accelerometer's do not, as if one were taken for the other.
    pub exchanged: bool,
}

/// The samples of one unit, condensed as they come.
#[derive(Debug)]
pub struct Watch {
    rate_hz: f64,
    by_hand: bool,
    block_rows: f64,
    open: Block,
    window: VecDeque<Block>,
    next: Option<u64>,
    /// Variance of one sample in the quietest second so far, raw.
    floor: Option<[f64; 6]>,
    /// Mean readings at rest, and the sum of the gyro's variances in that second, once two seconds in a row have agreed on it.
    rest: Option<([f64; 6], f64)>,
    codes: [Codes; 6],
    /// Whether it has moved since it may be turned.
    moved: bool,
    /// The seconds that ended within the last one: means and variances of the gyro.
    before: VecDeque<[[f64; 3]; 2]>,
    /// Whether the unit may be turned by now.
    begun: bool,
    temperatures: VecDeque<(u64, f64)>,
}

impl Watch {
    /// Of a unit; `by_hand` allows the gyro the tremor of hands.
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
            codes: [Codes::default(); 6],
            moved: false,
            before: VecDeque::new(),
            begun: false,
            temperatures: VecDeque::new(),
        }
    }

    /// Variances of single readings in the quietest second so far, raw.
    pub fn noise(&self) -> Option<[f64; 6]> {
        self.floor
    }

    /// Takes samples in; what the last second was like, if one is whole.
    pub fn take(&mut self, chunk: &Chunk) -> Option<Seen> {
        let missing = chunk.tick.saturating_sub(self.next.unwrap_or(chunk.tick));
        self.next = Some(chunk.tick + chunk.values.len() as u64);
        // After more than a tenth of a second without samples it is another second.
        if missing as f64 > self.block_rows {
            (self.open, self.window) = (Block::default(), VecDeque::new());
        }
        self.open.missing += missing;
        let mut seen = None;
        for (k, row) in (1..).zip(&chunk.values) {
            self.open.moments.add(row);
            for (codes, value) in self.codes.iter_mut().zip(row) {
                codes.add(*value);
            }
            self.open.saturated |= chunk.saturated;
            if self.open.moments.count >= self.block_rows {
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

    /// Forgets what it has seen of the last second: what comes next has nothing to do with it.
    pub fn interrupted(&mut self) {
        (self.open, self.window) = (Block::default(), VecDeque::new());
        self.before.clear();
        self.temperatures.clear();
    }

    /// Forgets what it knows of rest: the unit may have been turning.
    pub fn was_turning(&mut self) {
        self.interrupted();
        (self.floor, self.rest) = (None, None);
    }

    /// From now on the unit may be turned: what the gyro reads at rest is known.
    pub fn begin(&mut self) {
        self.begun = true;
    }

    /// Whether it knows yet how quiet the unit can be.
    pub fn knows_rest(&self) -> bool {
        self.rest.is_some()
    }

    /// Looks whether a second of the gyro (mean and variance of each axis) is rest: as that before it, which a table that slows down is not.
    /// A table may report that it is at rest while samples of its motion still arrive.
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

    fn follow(&mut self, tick: u64, temp_c: f64) {
        if temp_c.is_finite() {
            self.temperatures.push_back((tick, temp_c));
        }
        let from = tick.saturating_sub((TREND_S * self.rate_hz) as u64);
        while self.temperatures.front().is_some_and(|(t, _)| *t < from) {
            self.temperatures.pop_front();
        }
    }

    /// °C/min by a straight line.
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

    fn see(&mut self, tick: u64, temp_c: f64) -> Seen {
        let mut all = Moments::default();
        let (mut saturated, mut missing) = (false, 0);
        for block in &self.window {
            all.join(&block.moments);
            saturated |= block.saturated;
            missing += block.missing;
        }
        let own = all.squares.map(|s| s / (all.count - 1.0));
        for (codes, own) in self.codes.iter_mut().zip(&own) {
            codes.judge(*own);
        }
        let (codes, moved) = (self.codes, self.moved);
        let stuck = (0..6).find(|&c| own[c] == 0.0 && codes[c].is_stuck(moved));
        // A mean is known to no less than what a step hides.
        let variance: [f64; 6] = std::array::from_fn(|c| own[c].max(codes[c].hidden()));
        if stuck.is_none() && !saturated {
            // Before anything was to turn: a steady rate is as quiet as rest.
            if !self.begun {
                self.find_rest(all.mean, variance);
            }
            let floor = self.floor.get_or_insert(variance);
            for c in 0..6 {
                floor[c] = floor[c].min(variance[c]);
            }
        }
        let floor = self.floor.unwrap_or(variance);
        let floor: [f64; 6] = std::array::from_fn(|c| floor[c].max(codes[c].hidden()));
        let motion = Sensor::BOTH.map(|sensor| {
            let allowed = match sensor {
                Sensor::Gyro if self.by_hand => GYRO_TREMOR * STILL_FACTOR,
                _ => STILL_FACTOR,
            };
            // Of a constant 0 / 0, which is still.
            let ratio = |c: usize| (variance[c] / (allowed * floor[c])).sqrt();
            sensor.channels().map(ratio).fold(0.0, f64::max)
        });
        self.moved |= self.begun && motion.iter().any(|m| *m > 1.0);
        let exchanged = self.rest.is_some_and(|(rest, _)| {
            let of = |sensor: Sensor, squares: &dyn Fn(usize) -> f64| {
                sensor.channels().map(squares).sum::<f64>()
            };
            let changed = |sensor| of(sensor, &|c| (all.mean[c] - rest[c]).powi(2));
            let size = |sensor| of(sensor, &|c| rest[c] * rest[c]);
            let noise = |sensor| of(sensor, &|c| floor[c]);
            self.by_hand
                && changed(Sensor::Gyro)
                    > EXCHANGED.0 * size(Sensor::Gyro).max(1e4 * noise(Sensor::Gyro))
                && changed(Sensor::Accel) < EXCHANGED.1 * noise(Sensor::Accel)
        });
        Seen {
            tick,
            mean: all.mean,
            motion,
            saturated,
            missing,
            temp_c,
            trend: self.trend(),
            stuck,
            exchanged,
        }
    }

    /// Rate of a second against that of rest, rad/s, by `gyro`, raw to SI.
    pub fn rate(&self, seen: &Seen, gyro: &Affine<f64>) -> Vector3<f64> {
        let rest = self.rest.map_or([0.0; 6], |r| r.0);
        gyro.matrix * Vector3::from_fn(|c, _| seen.mean[c] - rest[c])
    }

    /// Standard deviation of one sample of the gyro at rest, by `gyro`, rad/s; the noisiest axis.
    pub fn gyro_noise(&self, gyro: &Affine<f64>) -> f64 {
        let floor = self.floor.unwrap_or_default();
        let of = |i: usize| gyro.matrix.row(i).norm() * floor[i].sqrt();
        (0..3).map(of).fold(0.0, f64::max)
    }
}

/// Specific force by `accel`, raw to SI.
pub fn force(seen: &Seen, accel: &Affine<f64>) -> Vector3<f64> {
    accel.apply(&Vector3::from_fn(|c, _| seen.mean[3 + c]))
}

/// What a board must be of which no data sheet is known: at rest its accelerometer reads gravity, by the size of `seen`; its gyro is
/// taken to be in units of a thousandth of that which makes 1 rad/s, so that only directions mean anything.
pub fn guessed(seen: &Seen, gravity_mps2: f64) -> [Affine<f64>; 2] {
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
            temp_c: 20.0 + tick as f64 / 60e3,
            saturated: false,
            self_test: false,
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

    /// A second and a half at rest of a board whose noise is less than its step, at `level`.
    fn coarse(watch: &mut Watch, tick: u64, level: [f64; 6]) -> Option<Seen> {
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
        // Turned, and held again: all but gyro z, whose wire is broken, have changed.
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
        assert_eq!(seen.stuck, Some(2), "{seen:?}");
        assert!(
            seen.motion.iter().all(|m| *m <= 1.0) && !seen.exchanged,
            "{seen:?}"
        );
    }

    #[test]
    fn a_gyro_that_reads_the_pose_is_an_accelerometer() {
        let mut watch = Watch::new(1000.0, true);
        let at = |watch: &mut Watch, tick: u64, gyro: [f64; 3]| {
            let mut one = chunk(tick, 2500, 0.0, 0.01);
            for row in &mut one.values {
                (row[0], row[1], row[2]) = (gyro[0] + row[0], gyro[1] + row[1], gyro[2] + row[2]);
            }
            watch.take(&one).unwrap()
        };
        assert!(!at(&mut watch, 0, [0.1, 0.2, 9.8]).exchanged);
        watch.begin();
        assert!(at(&mut watch, 5000, [9.8, 0.1, 0.2]).exchanged);
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
