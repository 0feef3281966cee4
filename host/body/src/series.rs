//! Readings of a triad over time, and between its samples.

use nalgebra::{UnitQuaternion, Vector3};

/// Times and readings; samples that are missing or saturated are left out.
#[derive(Debug, Clone, Default)]
pub(crate) struct Series {
    /// Times, s, increasing.
    pub t: Vec<f64>,
    /// Readings: raw, or SI if they were compensated.
    pub x: Vec<Vector3<f64>>,
    /// Usual time between samples, s.
    pub period: f64,
    /// Whether nothing is known between a sample and the next: there is a gap, or a reading was saturated.
    broken: Vec<bool>,
}

/// Times between samples beyond this many periods are gaps, across which nothing is integrated.
const GAP: f64 = 2.5;
impl Series {
    /// Of the samples whose three readings are numbers, in order of time.
    pub fn new(t: &[f64], axes: [&[f64]; 3]) -> Self {
        let clipped = Clipped::of(axes);
        let (mut times, mut all, mut saturated) = (Vec::new(), Vec::new(), Vec::new());
        let mut is_saturated = false;
        for (k, &at) in t.iter().enumerate() {
            let x = Vector3::new(axes[0][k], axes[1][k], axes[2][k]);
            if clipped.contains(&x) {
                is_saturated = true;
            } else if x.iter().all(|v| v.is_finite()) && times.last().is_none_or(|last| at > *last)
            {
                times.push(at);
                all.push(x);
                saturated.push(std::mem::take(&mut is_saturated));
            }
        }
        Self::of(times, all, &saturated)
    }

    /// Of these samples; before some of them a reading was saturated.
    fn of(t: Vec<f64>, x: Vec<Vector3<f64>>, saturated: &[bool]) -> Self {
        let between = t.windows(2).map(|w| w[1] - w[0]);
        let period = mimu_recording::units::median(between.clone().collect()).unwrap_or(f64::NAN);
        let broken = between.zip(&saturated[1.min(saturated.len())..]);
        Self {
            broken: broken
                .map(|(gap, clip)| *clip || gap > GAP * period)
                .collect(),
            period,
            t,
            x,
        }
    }

    /// Without samples that repeat the one before: a slower triad whose last reading is written again.
    ///
    /// Where the rows repeat it in an uneven rhythm, another clock samples it, and a new reading is on average half a row old when it is first written.
    pub fn without_repeats(self) -> Self {
        let is_new = |k: usize| k == 0 || self.x[k] != self.x[k - 1];
        let new: Vec<usize> = (0..self.len()).filter(|k| is_new(*k)).collect();
        if new.len() * 10 > self.len() * 9 {
            return self;
        }
        let usual = self.len() as f64 / new.len() as f64;
        let runs = new.windows(2).map(|w| (w[1] - w[0]) as f64);
        let even = runs.filter(|run| (run - usual).abs() < 0.2).count();
        let age = if even * 10 > new.len() * 9 {
            0.0
        } else {
            0.5 * self.period
        };
        self.only(&new, age)
    }

    /// Without the samples in these spans of time, s.
    pub fn without(&self, spans: &[[f64; 2]]) -> Self {
        let is_in = |k: &usize| spans.iter().any(|[a, b]| (*a..*b).contains(&self.t[*k]));
        let kept: Vec<usize> = (0..self.len()).filter(|k| !is_in(k)).collect();
        self.only(&kept, 0.0)
    }

    /// Of the samples with these numbers only, so much earlier.
    fn only(&self, kept: &[usize], age: f64) -> Self {
        let (t, x) = kept.iter().map(|k| (self.t[*k] - age, self.x[*k])).unzip();
        let before = kept.iter().take(1).chain(kept).zip(kept);
        let broken: Vec<bool> = before.map(|(a, b)| self.is_broken(*a, *b)).collect();
        Self::of(t, x, &broken)
    }

    /// Each reading through `map`, in its place: hours of a triad are hundreds of megabytes.
    pub fn map(mut self, map: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        self.x.iter_mut().for_each(|x| *x = map(x));
        self
    }

    /// Numbers of the samples in a span of time, s.
    pub fn within(&self, [from, to]: [f64; 2]) -> std::ops::Range<usize> {
        let before = |end: f64| self.t.partition_point(|t| *t < end);
        before(from)..before(to)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// The sample before a time, and the share of the way to the next; `None` outside, or in a gap.
    fn before(&self, t: f64) -> Option<(usize, f64)> {
        let next = self.t.partition_point(|of| *of <= t);
        let at = next.checked_sub(1)?;
        if next == self.len() {
            return (self.t[at] == t && at > 0).then(|| (at - 1, 1.0));
        }
        let between = self.t[next] - self.t[at];
        (!self.broken[at]).then(|| (at, (t - self.t[at]) / between))
    }

    /// The reading at a time, by the cubic through four samples; `None` outside, or in a gap.
    ///
    /// A straight line between two would make a motion of 1 Hz smaller by up to 0.05 % at 100 Hz, and with it the scale factor of what is compared with it.
    pub fn at(&self, t: f64) -> Option<Vector3<f64>> {
        let (at, share) = self.before(t)?;
        let four = at.checked_sub(1).filter(|first| first + 3 < self.len());
        let Some(first) = four.filter(|first| !self.is_broken(*first, first + 3)) else {
            return Some(self.x[at].lerp(&self.x[at + 1], share));
        };
        let mut sum = Vector3::zeros();
        for k in first..first + 4 {
            let others = (first..first + 4).filter(|other| *other != k);
            let weight = others.map(|o| (t - self.t[o]) / (self.t[k] - self.t[o]));
            sum += weight.product::<f64>() * self.x[k];
        }
        Some(sum)
    }

    /// The reading at a time by a straight line; `None` outside, or in a gap.
    pub fn line_at(&self, t: f64) -> Option<Vector3<f64>> {
        let (at, share) = self.before(t)?;
        Some(self.x[at].lerp(&self.x[at + 1], share))
    }

    /// Times and readings from one time to another, with those at both ends between samples; `None` if a gap or a saturated reading lies between.
    pub fn between(&self, from: f64, to: f64) -> Option<Vec<(f64, Vector3<f64>)>> {
        let first = self.t.partition_point(|of| *of <= from);
        let last = self.t.partition_point(|of| *of < to);
        if first > last || self.is_broken(first.checked_sub(1)?, last.min(self.broken.len())) {
            return None;
        }
        let inner = (first..last).map(|k| (self.t[k], self.x[k]));
        let ends = [(from, self.at(from)?), (to, self.at(to)?)];
        Some(
            ends[..1]
                .iter()
                .copied()
                .chain(inner)
                .chain(ends[1..].iter().copied())
                .collect(),
        )
    }

    /// Whether there is a gap, or a saturated reading, between two samples.
    pub fn is_broken(&self, from: usize, to: usize) -> bool {
        self.broken[from..to].contains(&true)
    }

    /// Variance of the noise of a reading, mean over the axes. Readings that lie [`APART_S`] apart are compared: the noise of neighbours is alike behind a filter.
    pub fn noise(&self) -> f64 {
        let stride = (APART_S / self.period).ceil().max(1.0) as usize;
        let apart: Vec<Vector3<f64>> = self.x.iter().step_by(stride).copied().collect();
        noise_at_rest(&apart)
    }

    /// Variance of the noise of a mean of so many neighbours, mean over the axes.
    pub fn noise_of_means(&self, count: usize) -> f64 {
        let means = self.x.chunks_exact(count.max(1));
        let means = means.map(|of| of.iter().sum::<Vector3<f64>>() / of.len() as f64);
        noise_at_rest(&means.collect::<Vec<_>>())
    }
}

/// Time between readings whose noise is independent, s: a filter of 10 Hz forgets in less.
const APART_S: f64 = 0.05;

/// Variance of the noise of these, mean over the axes: that of third differences, in which what moves slowly cancels, by the quiet pieces of time.
fn noise_at_rest(x: &[Vector3<f64>]) -> f64 {
    let third = x.windows(4).map(|w| {
        let difference = w[3] - w[0] + 3.0 * (w[1] - w[2]);
        difference.norm_squared() / (3.0 * 20.0)
    });
    let third: Vec<f64> = third.collect();
    let pieces = third.chunks(8);
    let pieces: Vec<f64> = pieces
        .map(|c| c.iter().sum::<f64>() / c.len() as f64)
        .collect();
    // A tenth of the pieces is at rest, at least. Noise alone scatters up to three times their decile: less would be its lower half.
    let decile = mimu_recording::statistics::quantile(&mut pieces.clone(), 0.1);
    let quiet = pieces
        .iter()
        .filter(|p| **p <= 3.0 * decile.unwrap_or(f64::NAN));
    let (sum, count) = quiet.fold((0.0, 0.0), |(sum, count), p| (sum + p, count + 1.0));
    sum / count
}

/// Ends of the ranges of three channels, where they saturate: the ends of a word of bits. A channel in SI may repeat its extreme by chance.
struct Clipped([[f64; 2]; 3]);

impl Clipped {
    fn of(axes: [&[f64]; 3]) -> Self {
        Self(axes.map(|values| {
            let finite = || values.iter().copied().filter(|v| v.is_finite());
            let ends = [
                finite().fold(f64::INFINITY, f64::min),
                finite().fold(f64::NEG_INFINITY, f64::max),
            ];
            ends.map(|end| match is_full_scale(end) {
                true => end,
                false => f64::NAN,
            })
        }))
    }

    fn contains(&self, x: &Vector3<f64>) -> bool {
        (0..3).any(|i| self.0[i].contains(&x[i]))
    }
}

/// Whether a reading is the end of a word of bits, which a converter holds when its input is beyond.
fn is_full_scale(end: f64) -> bool {
    let size = if end < 0.0 { -end } else { end + 1.0 };
    size >= 2048.0 && size.fract() == 0.0 && (size as u64).is_power_of_two()
}

/// A gyro's rates and the attitude that they give.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    /// Rates in the frame of the body, rad/s.
    pub rate: Series,
    /// Attitude at each sample, body to where it began; after a gap it begins anew, and [`Self::turn`] is `None` across it.
    attitude: Vec<UnitQuaternion<f64>>,
    /// Number of gaps before each sample.
    pieces: Vec<u32>,
}

impl Motion {
    /// Integrates compensated rates.
    pub fn new(rate: Series) -> Self {
        let mut attitude = Vec::with_capacity(rate.len());
        let mut pieces = Vec::with_capacity(rate.len());
        let (mut now, mut piece) = (UnitQuaternion::identity(), 0);
        for k in 0..rate.len() {
            if k > 0 {
                let between = rate.t[k] - rate.t[k - 1];
                piece += u32::from(rate.is_broken(k - 1, k));
                let mean = 0.5 * (rate.x[k] + rate.x[k - 1]);
                now *= UnitQuaternion::from_scaled_axis(mean * between);
            }
            attitude.push(now);
            pieces.push(piece);
        }
        Self {
            rate,
            attitude,
            pieces,
        }
    }

    fn at(&self, t: f64) -> Option<(UnitQuaternion<f64>, u32)> {
        let (at, share) = self.rate.before(t)?;
        let since = t - self.rate.t[at];
        let mean = self.rate.x[at].lerp(&self.rate.x[at + 1], 0.5 * share);
        let turned = UnitQuaternion::from_scaled_axis(mean * since);
        Some((self.attitude[at] * turned, self.pieces[at]))
    }

    /// Takes a vector that is constant in space from its components in the body at `from` to those at `to`; `None` across a gap.
    pub fn turn(&self, from: f64, to: f64) -> Option<UnitQuaternion<f64>> {
        let ((a, piece), (b, other)) = (self.at(from)?, self.at(to)?);
        (piece == other).then(|| b.inverse() * a)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A number between 0 and 1 that depends on `k` as if by chance (Steele, Lea, Flood: SplitMix).
    fn uniform(k: usize) -> f64 {
        let mut z = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The same with a normal distribution.
    pub(crate) fn normal(k: usize) -> f64 {
        let [size, angle] = [2 * k, 2 * k + 1].map(uniform);
        (-2.0 * (1.0 - size).ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
    }

    #[test]
    fn a_curve_is_read_between_samples_and_nothing_across_a_gap() {
        let t = [0.0, 1.0, 2.0, 7.0, 8.0];
        let x = [0.0, 1.0, 2.0, 7.0, f64::NAN];
        let series = Series::new(&t, [&x, &x, &x]);
        assert_eq!(series.at(1.25), Some(Vector3::repeat(1.25)));
        assert_eq!(series.at(3.0), None);
        assert_eq!(series.at(7.5), None);
        assert!(series.is_broken(1, 3) && !series.is_broken(0, 2));
        let t: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let x: Vec<f64> = t.iter().map(|t| (6.0 * t).sin()).collect();
        let read = Series::new(&t, [&x, &x, &x]).at(0.255).unwrap();
        assert!((read.x - 1.53f64.sin()).abs() < 1e-6, "{read}");
    }

    #[test]
    fn saturated_samples_are_left_out_and_an_extreme_that_was_reached_is_not() {
        let mut x: Vec<f64> = (0..100).map(|k| f64::from(k) * 10.0).collect();
        x.extend([32767.0; 5]);
        let t: Vec<f64> = (0..106).map(f64::from).collect();
        x.push(1000.0);
        let series = Series::new(&t, [&x, &x, &x]);
        assert_eq!(series.len(), 101);
        assert!(series.is_broken(99, 100) && !series.is_broken(0, 99));
        x.truncate(100);
        assert_eq!(Series::new(&t[..100], [&x, &x, &x]).len(), 100);
    }

    #[test]
    fn readings_that_are_written_again_are_left_out_and_those_of_an_uneven_rhythm_are_half_a_row_old()
     {
        let t: Vec<f64> = (0..700).map(|k| 0.01 * f64::from(k)).collect();
        for (share, age) in [(1.0, 0.0), (0.5, 0.0), (5.0 / 7.0, 0.005)] {
            let x: Vec<f64> = (0..700).map(|k| (share * f64::from(k)).floor()).collect();
            let left = Series::new(&t, [&x, &x, &x]).without_repeats();
            assert_eq!(left.len(), (700.0 * share) as usize);
            assert!((left.t[0] + age).abs() < 1e-12, "{share}: {}", left.t[0]);
        }
    }

    #[test]
    fn a_turn_is_that_of_the_integrated_rate() {
        let t: Vec<f64> = (0..101).map(|k| 0.01 * f64::from(k)).collect();
        let (rate, none) = (vec![0.5; 101], vec![0.0; 101]);
        let motion = Motion::new(Series::new(&t, [&none, &none, &rate]));
        // A body that turns left sees what is fixed turn right.
        let seen = motion.turn(0.1, 0.9).unwrap() * Vector3::x();
        let expected = Vector3::new(0.4f64.cos(), -(0.4f64.sin()), 0.0);
        assert!((seen - expected).norm() < 1e-9, "{seen}");
    }

    #[test]
    fn noise_is_found_beside_a_slow_motion() {
        let t: Vec<f64> = (0..4000).map(|k| 0.01 * k as f64).collect();
        let axis = |axis: usize| -> Vec<f64> {
            let each = t.iter().enumerate();
            each.map(|(k, t)| t.sin() + 0.1 * normal(3 * k + axis))
                .collect()
        };
        let [x, y, z] = [0, 1, 2].map(axis);
        let found = Series::new(&t, [&x, &y, &z]).noise();
        assert!((found / 0.01 - 1.0).abs() < 0.2, "{found}");
    }
}
