//! Readings of a triad over time, between which a straight line is taken.

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
}

/// Times between samples beyond this many periods are gaps, across which nothing is integrated.
const GAP: f64 = 2.5;
/// Equal samples at the end of a channel's range that are called saturated.
const AT_RAIL: usize = 3;

impl Series {
    /// Of the samples whose three readings are numbers, in order of time.
    pub fn new(t: &[f64], axes: [&[f64]; 3]) -> Self {
        let clipped = Clipped::of(axes);
        let mut series = Self::default();
        for (k, &at) in t.iter().enumerate() {
            let x = Vector3::new(axes[0][k], axes[1][k], axes[2][k]);
            let later = series.t.last().is_none_or(|last| at > *last);
            if later && x.iter().all(|v| v.is_finite()) && !clipped.contains(&x) {
                series.t.push(at);
                series.x.push(x);
            }
        }
        let gaps = series.t.windows(2).map(|w| w[1] - w[0]).collect();
        series.period = mimu_recording::units::median(gaps).unwrap_or(f64::NAN);
        series
    }

    /// Without samples that repeat the one before: a slower triad whose last reading is written again.
    pub fn without_repeats(mut self) -> Self {
        let mut last = Vector3::repeat(f64::NAN);
        let new: Vec<bool> = self
            .x
            .iter()
            .map(|x| {
                let is = *x != last;
                last = *x;
                is
            })
            .collect();
        if new.iter().filter(|n| **n).count() * 10 > new.len() * 9 {
            return self;
        }
        let mut keep = new.iter();
        self.t.retain(|_| *keep.next().unwrap_or(&true));
        let mut keep = new.iter();
        self.x.retain(|_| *keep.next().unwrap_or(&true));
        let gaps = self.t.windows(2).map(|w| w[1] - w[0]).collect();
        self.period = mimu_recording::units::median(gaps).unwrap_or(f64::NAN);
        self
    }

    /// Each reading through `map`.
    pub fn map(&self, map: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        Self {
            t: self.t.clone(),
            x: self.x.iter().map(map).collect(),
            period: self.period,
        }
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
        (between <= GAP * self.period).then(|| (at, (t - self.t[at]) / between))
    }

    /// The reading at a time; `None` outside, or in a gap.
    pub fn at(&self, t: f64) -> Option<Vector3<f64>> {
        let (at, share) = self.before(t)?;
        Some(self.x[at].lerp(&self.x[at + 1], share))
    }

    /// Whether there is a gap between two samples.
    pub fn is_broken(&self, from: usize, to: usize) -> bool {
        // Gaps are rare and windows short.
        (from..to).any(|k| self.t[k + 1] - self.t[k] > GAP * self.period)
    }

    /// Variance of white noise of a reading, mean over the axes: that of third differences, by the quietest quarter of the pieces. What moves slowly against
    /// four samples cancels.
    pub fn noise(&self) -> f64 {
        let third = self.x.windows(4).map(|w| {
            let difference = w[3] - w[0] + 3.0 * (w[1] - w[2]);
            difference.norm_squared() / (3.0 * 20.0)
        });
        let third: Vec<f64> = third.collect();
        let mut pieces: Vec<f64> = third
            .chunks(50)
            .map(|c| c.iter().sum::<f64>() / c.len() as f64)
            .collect();
        mimu_recording::statistics::quantile(&mut pieces, 0.25).unwrap_or(f64::NAN)
    }
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
            ends.map(|end| {
                let mut runs = values.windows(AT_RAIL);
                let is_held = runs.any(|w| w.iter().all(|v| *v == end));
                match is_held && is_full_scale(end) {
                    true => end,
                    false => f64::NAN,
                }
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
                piece += u32::from(between > GAP * rate.period);
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
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_between_samples_and_nothing_across_a_gap() {
        let t = [0.0, 1.0, 2.0, 7.0, 8.0];
        let x = [0.0, 1.0, 2.0, 7.0, f64::NAN];
        let series = Series::new(&t, [&x, &x, &x]);
        assert_eq!(series.at(1.25), Some(Vector3::repeat(1.25)));
        assert_eq!(series.at(3.0), None);
        assert_eq!(series.at(7.5), None);
        assert!(series.is_broken(1, 3) && !series.is_broken(0, 2));
    }

    #[test]
    fn saturated_samples_are_left_out_and_an_extreme_that_was_reached_is_not() {
        let mut x: Vec<f64> = (0..100).map(|k| f64::from(k) * 10.0).collect();
        x.extend([32767.0; 5]);
        let t: Vec<f64> = (0..105).map(f64::from).collect();
        assert_eq!(Series::new(&t, [&x, &x, &x]).len(), 100);
        x.truncate(100);
        assert_eq!(Series::new(&t[..100], [&x, &x, &x]).len(), 100);
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
        let noise = |k: usize| 0.1 * ((k as f64 * 12.9898).sin() * 43758.5453).fract();
        let t: Vec<f64> = (0..4000).map(|k| 0.01 * k as f64).collect();
        let x: Vec<f64> = (0..4000)
            .map(|k| (0.01 * k as f64).sin() + noise(k))
            .collect();
        let found = Series::new(&t, [&x, &x, &x]).noise();
        // Uniform within ± 0.1: a variance of 0.1² / 3.
        assert!((found / (0.01 / 3.0) - 1.0).abs() < 0.25, "{found}");
    }
}
