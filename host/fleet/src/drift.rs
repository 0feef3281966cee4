//! Drift of production: control charts of exponentially weighted moving averages (EWMA), by date.
//!
//! Units of a day are one point: the mean of those that belong to the population, in standard deviations of such a mean. What days differ beyond the scatter of units is estimated
//! of successive days, which a slow drift hardly moves, and added to that. The moving average `z = λ x + (1 - λ) z` of standard points has the variance
//! `λ/(2-λ) (1 - (1-λ)^2t)`: Roberts (1959); Lucas, Saccucci (1990). Limits are such that production without a drift exceeds them in [`FALSE_FINDING`] of charts, all points and
//! all charts considered.

use jiff::civil::Date;
use mimu::sessions::contradiction::FALSE_FINDING;
use statrs::distribution::{ContinuousCDF, Normal};

/// Weight of the newest point.
pub const LAMBDA: f64 = 0.2;
/// Fewest days of a chart.
pub const FEWEST: usize = 8;

/// A day before it is a point of a chart.
#[derive(Debug, Clone, Copy)]
pub struct Day {
    /// Day.
    pub day: Date,
    /// How many values of the standard deviation of one have the variance of the mean.
    pub count: f64,
    /// Mean, minus the centre of the chart.
    pub mean: f64,
}

/// A day of a chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Day.
    pub day: Date,
    /// Mean minus the centre.
    pub mean: f64,
    /// Moving average of the centred means, in the unit of the values.
    pub average: f64,
    /// Largest magnitude of [`Self::average`] without a drift.
    pub limit: f64,
}

/// A control chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Standard deviation of days beyond the scatter of their units.
    pub between_days: f64,
    /// Days in order.
    pub points: Vec<Point>,
    /// The first day beyond the limits, as a number in [`Self::points`].
    pub signal: Option<usize>,
    /// The day after which the average did not return to the centre before the signal.
    pub since: Option<usize>,
}

/// Limit of a standard average, if `points` of all charts are considered.
pub fn limit(points: usize) -> f64 {
    Normal::standard().inverse_cdf(1.0 - 0.5 * FALSE_FINDING / points.max(1) as f64)
}

/// Fewest days on each side of a step.
const BESIDE: usize = 4;

/// The day, as a number, from which on the values differ most from those before, and the mean before.
pub fn step(days: &[Day]) -> Option<(usize, f64)> {
    let sum = |part: &[Day]| part.iter().fold((0.0, 0.0), |(n, s), d| (n + d.count, s + d.count * d.mean));
    let splits = BESIDE..days.len().saturating_sub(BESIDE) + 1;
    let each = splits.map(|k| {
        let (before, after) = (sum(&days[..k]), sum(&days[k..]));
        let difference = after.1 / after.0 - before.1 / before.0;
        let size = difference.abs() / (1.0 / before.0 + 1.0 / after.0).sqrt();
        (k, before.1 / before.0, size)
    });
    each.max_by(|a, b| a.2.total_cmp(&b.2)).map(|(k, before, _)| (k, before))
}

/// The chart of `days`, in their order, where single values have the standard deviation `sigma`. `None` for fewer than [`FEWEST`] days.
pub fn chart(days: &[Day], sigma: f64, limit: f64) -> Option<Chart> {
    if days.len() < FEWEST || !(sigma > 0.0) {
        return None;
    }
    let own = |day: &Day| sigma * sigma / day.count;
    let pairs = days.windows(2).map(|w| {
        let difference = w[1].mean - w[0].mean;
        0.5 * (difference * difference - own(&w[0]) - own(&w[1]))
    });
    let between = pairs.sum::<f64>() / (days.len() - 1) as f64;
    let between = between.max(0.0);
    let (mut standard, mut points) = (0.0, Vec::with_capacity(days.len()));
    for (t, day) in days.iter().enumerate() {
        let scale = (own(day) + between).sqrt();
        standard = LAMBDA * day.mean / scale + (1.0 - LAMBDA) * standard;
        let variance = LAMBDA / (2.0 - LAMBDA) * (1.0 - (1.0 - LAMBDA).powi(2 * (t as i32 + 1)));
        points.push(Point {
            day: day.day,
            mean: day.mean,
            average: standard * scale,
            limit: limit * variance.sqrt() * scale,
        });
    }
    let signal = points.iter().position(|p| p.average.abs() > p.limit);
    let since = signal.map(|s| {
        let side = points[s].average.signum();
        let crossed = points[..s].iter().rposition(|p| p.average.signum() != side);
        crossed.map_or(0, |k| k + 1)
    });
    Some(Chart {
        between_days: between.sqrt(),
        points,
        signal,
        since,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn days(means: impl Iterator<Item = f64>) -> Vec<Day> {
        let first = jiff::civil::date(2026, 1, 1);
        let each = means.enumerate().map(|(k, mean)| Day {
            day: first.checked_add(jiff::Span::new().days(k as i64)).unwrap(),
            count: 4.0,
            mean,
        });
        each.collect()
    }

    #[test]
    fn a_step_of_two_standard_deviations_of_a_day_is_found_where_it_began() {
        // Alternating days have the scatter of means of four values of the standard deviation 2.
        let noise = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let with = days((0..60).map(|k| 0.7 * noise(k) + if k < 40 { 0.0 } else { 2.5 }));
        let found = chart(&with, 2.0, limit(60)).unwrap();
        let signal = found.signal.unwrap();
        assert!((41..55).contains(&signal), "{signal}");
        assert!((39..42).contains(&found.since.unwrap()), "{:?}", found.since);
        let without = chart(&days((0..60).map(|k| 0.7 * noise(k))), 2.0, limit(60)).unwrap();
        assert_eq!((without.signal, without.since), (None, None));
        assert!(chart(&with[..7], 2.0, 3.0).is_none());
    }

    #[test]
    fn the_first_average_is_that_of_the_book_and_its_limit_widens_to_the_asymptote() {
        // NIST/SEMATECH e-Handbook, 6.3.2.4: the limit tends to k σ sqrt(λ/(2-λ)), a third of k σ for 0.2.
        let found = chart(&days((0..50).map(|k| f64::from(k % 2))), 2.0, 3.0).unwrap();
        let scale = (1.0 + found.between_days.powi(2)).sqrt();
        assert!((found.points[0].limit - 3.0 * 0.2 * scale).abs() < 1e-12);
        assert!((found.points[49].limit - scale).abs() < 1e-6);
        assert!((found.points[1].average - 0.2).abs() < 1e-12);
    }
}
