//! Joining a later file onto the times of the first one.

use super::source::Source;
use super::time::Times;

/// Two stamps nearer than this part of a sample period are the same instant.
const SAME: f64 = 0.1;

/// Longest gap, in sample periods of the later file, that is interpolated across.
const LONGEST_GAP: f64 = 3.0;

/// What became of one row of the first file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Joined {
    /// The later file has the same instant.
    Exactly,
    /// Between two rows of the later file.
    Interpolated,
    /// Before the later file's first row or after its last.
    Outside,
    /// In a gap of the later file.
    Gap,
}

/// The values of `source` at the times `t_s` of the first file, whose rows are `first_period_s` apart, and how they were found; not a number where there
/// are none. For these no row is dropped if they are of further triads: a magnetometer must not cost readings of gyro and accelerometer.
///
/// A logger may write a slow sensor's last reading again in each row. Such readings are kept: without the sensor's own stamps a repeated one cannot be
/// distinguished from a new one of the same value.
pub(super) fn joined(
    source: &Source,
    t_s: &[f64],
    first_period_s: f64,
) -> (Vec<Vec<f64>>, Vec<Joined>) {
    let period_s = source
        .times
        .as_ref()
        .map_or(first_period_s, Times::period_s);
    let tolerance_s = SAME * period_s.min(first_period_s);
    // A hair more, as stamps are rounded.
    let longest_gap_s = LONGEST_GAP * period_s * (1.0 + 1e-6);
    let (own, mut after) = (&source.t_s, 0);
    let place = |t: &f64| {
        while own.get(after).is_some_and(|later| later <= t) {
            after += 1;
        }
        let before = after.checked_sub(1);
        let distance = |row: Option<usize>| row.map_or(f64::INFINITY, |row| (own[row] - t).abs());
        let next = (after < own.len()).then_some(after);
        let [to_before, to_after] = [before, next].map(distance);
        let nearest = if to_before <= to_after { before } else { next };
        match (nearest, before, next) {
            (Some(row), ..) if to_before.min(to_after) <= tolerance_s => {
                (Joined::Exactly, row, row, 0.0)
            }
            (_, Some(a), Some(b)) if own[b] - own[a] > longest_gap_s => {
                (Joined::Gap, a, b, f64::NAN)
            }
            (_, Some(a), Some(b)) => (Joined::Interpolated, a, b, (t - own[a]) / (own[b] - own[a])),
            _ => (Joined::Outside, 0, 0, f64::NAN),
        }
    };
    let places: Vec<(Joined, usize, usize, f64)> = t_s.iter().map(place).collect();
    let of = |values: &Vec<f64>| {
        let at = |&(how, a, b, part): &(Joined, usize, usize, f64)| match how {
            Joined::Exactly => values[a],
            Joined::Interpolated => values[a] + (values[b] - values[a]) * part,
            Joined::Outside | Joined::Gap => f64::NAN,
        };
        places.iter().map(at).collect()
    };
    let further = source.is_further();
    let how = places
        .iter()
        .map(|place| if further { Joined::Exactly } else { place.0 });
    (source.values.iter().map(of).collect(), how.collect())
}
