//! Drift of production: control charts of exponentially weighted moving averages (EWMA), by date.
//!
//! Units of a day are one point: the mean of those that belong to the population, in standard deviations of such a mean. What days differ beyond the scatter of units is estimated
//! of successive days, which a slow drift hardly moves, and added to that. The moving average `z = λ x + (1 - λ) z` of standard points has the variance
//! `λ/(2-λ) (1 - (1-λ)^2t)`: Roberts (1959); Lucas, Saccucci (1990). Limits are such that production without a drift exceeds them in [`FALSE_FINDING`] of charts, all points and
//! all charts considered.

use jiff::civil::Date;
use mimu::sessions::contradiction::FALSE_FINDING;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::robust::median;

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
    /// Moving average of the centred means in their standard deviations, times that of a usual day.
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
    /// The day after which the average did not return to the centre before the signal; for a step the day of it.
    pub since: Option<usize>,
}

/// Limit of a standard average, if `points` of all charts are considered.
pub fn limit(points: usize) -> f64 {
    Normal::standard().inverse_cdf(1.0 - 0.5 * FALSE_FINDING / points.max(1) as f64)
}

/// Fewest days on each side of a step.
const BESIDE: usize = 4;

/// A step of the mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// The first day after it, as a number.
    pub first: usize,
    /// Mean before.
    pub before: f64,
    /// Mean after.
    pub after: f64,
    /// Their difference in its standard deviations.
    pub size: f64,
}

/// The largest step, in standard deviations, of all days with `BESIDE` on both sides. Without a step [`limit`] of the number of days is exceeded in [`FALSE_FINDING`] of cases at most.
pub fn step(days: &[Day], sigma: f64) -> Option<Step> {
    let between = between_days(days, sigma);
    let weight = |day: &Day| 1.0 / (sigma * sigma / day.count + between);
    let sum = |part: &[Day]| {
        part.iter().fold((0.0, 0.0), |(w, s), d| {
            (w + weight(d), s + weight(d) * d.mean)
        })
    };
    let all = sum(days);
    let splits = BESIDE..(days.len() + 1).saturating_sub(BESIDE);
    let mut before = sum(&days[..BESIDE.min(days.len())]);
    let each = splits.map(|first| {
        let after = (all.0 - before.0, all.1 - before.1);
        let means = [before.1 / before.0, after.1 / after.0];
        let step = Step {
            first,
            before: means[0],
            after: means[1],
            size: (means[1] - means[0]).abs() / (1.0 / before.0 + 1.0 / after.0).sqrt(),
        };
        before = (
            before.0 + weight(&days[first]),
            before.1 + weight(&days[first]) * days[first].mean,
        );
        step
    });
    each.max_by(|a, b| a.size.total_cmp(&b.size))
}

/// The chart about the centre; if it has a signal, about the mean of the days before the drift. The median of all days is neither that before it nor that after.
pub fn chart_about_beginning(days: &mut [Day], sigma: f64, limit: f64) -> Option<Chart> {
    let about_centre = chart(days, sigma, limit)?;
    let Some(mut first) = about_centre
        .signal
        .and_then(|_| Some(step(days, sigma)?.first))
    else {
        return Some(about_centre);
    };
    let mut best = about_centre;
    // The largest step of a slow drift is in its middle: its beginning is found from there.
    for _ in 0..BEGINNINGS {
        let part = &days[..first.max(BESIDE)];
        let sum = part
            .iter()
            .fold((0.0, 0.0), |(n, s), d| (n + d.count, s + d.count * d.mean));
        let before = sum.1 / sum.0;
        days.iter_mut().for_each(|d| d.mean -= before);
        let Some(next) = chart(days, sigma, limit).filter(|c| c.signal.is_some()) else {
            break;
        };
        let since = next.since.unwrap_or(first);
        best = next;
        if since >= first {
            break;
        }
        first = since;
    }
    Some(best)
}

/// Rounds in which the beginning of a drift is found.
const BEGINNINGS: usize = 3;

/// Variance of days beyond the scatter of their values, by successive days.
fn between_days(days: &[Day], sigma: f64) -> f64 {
    let own = |day: &Day| sigma * sigma / day.count;
    let pairs = days.windows(2).map(|w| {
        let difference = w[1].mean - w[0].mean;
        0.5 * (difference * difference - own(&w[0]) - own(&w[1]))
    });
    (pairs.sum::<f64>() / (days.len() as f64 - 1.0)).max(0.0)
}

/// The chart of `days`, in their order, where single values have the standard deviation `sigma`. `None` for fewer than [`FEWEST`] days.
pub fn chart(days: &[Day], sigma: f64, limit: f64) -> Option<Chart> {
    if days.len() < FEWEST || !(sigma > 0.0) {
        return None;
    }
    let own = |day: &Day| sigma * sigma / day.count;
    let between = between_days(days, sigma);
    let (mut standard, mut points) = (0.0, Vec::with_capacity(days.len()));
    // Averages and limits of standard points, in the unit of the values by the scale of a usual day: otherwise a day with a single unit would be a spike in both.
    let mut scales: Vec<f64> = days.iter().map(|d| (own(d) + between).sqrt()).collect();
    let usual = median(&mut scales);
    for (t, day) in days.iter().enumerate() {
        let scale = (own(day) + between).sqrt();
        standard = LAMBDA * day.mean / scale + (1.0 - LAMBDA) * standard;
        let variance = LAMBDA / (2.0 - LAMBDA) * (1.0 - (1.0 - LAMBDA).powi(2 * (t as i32 + 1)));
        points.push(Point {
            day: day.day,
            mean: day.mean,
            average: standard * usual,
            limit: limit * variance.sqrt() * usual,
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
        assert!(
            (39..42).contains(&found.since.unwrap()),
            "{:?}",
            found.since
        );
        let without = chart(&days((0..60).map(|k| 0.7 * noise(k))), 2.0, limit(60)).unwrap();
        assert_eq!((without.signal, without.since), (None, None));
        assert!(chart(&with[..7], 2.0, 3.0).is_none());
    }

    #[test]
    fn a_step_in_the_middle_has_the_size_of_a_test_of_two_means() {
        let noise = |k: usize| if k.is_multiple_of(2) { 0.7 } else { -0.7 };
        let found = step(
            &days((0..40).map(|k| noise(k) + if k < 20 { 0.0 } else { 1.0 })),
            2.0,
        )
        .unwrap();
        assert_eq!(found.first, 20);
        assert!((found.after - found.before - 1.0).abs() < 1e-9);
        // Means of four values of the standard deviation 2 have one of 1; successive days differ by no more than 1.96, so nothing is added.
        assert!(
            (found.size - 1.0 / (2.0 / 20.0f64).sqrt()).abs() < 0.05,
            "{}",
            found.size
        );
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
