//! Faults of a log after which its readings mean something else: the accelerometer has another range, or the columns have changed places.
//!
//! No calibration holds before and after such a row. Both show at rest. The magnitude of specific force is that of gravity in every pose,
//! so two magnitudes whose ratio is a power of two are two ranges. And a gyro at rest reads the same in every pose, while an accelerometer
//! does not: if the columns with a constant level are others from some row on, columns have changed places.

use std::ops::Range;

use nalgebra::{Matrix4, Vector3, Vector4};

use crate::quantity::Sensor;
use crate::signal::blocks::{Condensed, pool, quantile};
use mimu_recording::health::{Fault, Finding};
use mimu_recording::{Manifest, RAW_COLUMNS, RawUnit};

/// Ranges of accelerometers double from one to the next: 2, 4, 8, 16 g. Largest deviation of the ratio of two magnitudes at rest from a
/// power of two, in powers of two: an offset of 0.1 g moves the magnitudes by up to a tenth. A larger one is found as the centre of all rests.
const OF_POWER: f64 = 0.25;
/// Least number of rests with each magnitude, and with each order of the columns: one rest may be a turn, or a part in free fall.
const FEWEST: usize = 3;
/// Least number of rests that show whether one sphere has them all: it has four numbers.
const FEWEST_OF_SPHERE: usize = 10;
/// Largest deviation from the sphere, as a share of its radius, of nine rests in ten: scale factors and angles are within some percent, and two ranges
/// differ by half.
const ON_SPHERE: f64 = 0.08;
/// Largest difference between two levels of a gyro at rest, as a share of the range of the accelerometer's levels.
const SAME_LEVEL: f64 = 0.03;

/// One segment in so many of the shorter part may be on the wrong side of a change of columns.
const MOST_WRONG: usize = 4;

/// A still segment.
struct Still {
    blocks: Range<usize>,
    mean: [f64; 6],
}

/// The first fault that the still `segments` of a recording by hand show, and the block that contains its row.
pub(crate) fn find(
    segments: &[Range<usize>],
    condensed: &Condensed,
    manifest: &Manifest,
) -> Option<(Finding, usize)> {
    let still: Vec<Still> = segments
        .iter()
        .map(|blocks| {
            let of = |c: usize| pool(condensed.blocks[blocks.clone()].iter().map(|b| b.raw[c]));
            Still {
                blocks: blocks.clone(),
                mean: [0, 1, 2, 3, 4, 5].map(|c| of(c).mean),
            }
        })
        .collect();
    let columns = columns(&still, condensed);
    let ([last, next], fault) = columns.or_else(|| range(&still, manifest))?;
    let between = middle(&still[last].blocks)..middle(&still[next].blocks) + 1;
    let largest = between.max_by(|a, b| {
        let [a, b] = [a, b].map(|i| condensed.blocks[*i].jump.size);
        a.total_cmp(&b)
    })?;
    let row = condensed.blocks[largest].jump.row;
    let found = Finding::of_all(condensed.rows - row, fault).from_row(row + 1);
    Some((found, largest))
}

fn middle(blocks: &Range<usize>) -> usize {
    (blocks.start + blocks.end) / 2
}

/// The segments before and after the range changes, and the change.
fn range(still: &[Still], manifest: &Manifest) -> Option<([usize; 2], Fault)> {
    // The zero of unsigned codes and of volts is not known yet.
    let about_zero = match manifest.raw_unit {
        RawUnit::Si => true,
        RawUnit::Count => still.iter().any(|s| s.mean[3..].iter().any(|u| *u < 0.0)),
        RawUnit::Volt => false,
    };
    if !about_zero {
        return None;
    }
    let magnitude = |s: &Still| s.mean[3..].iter().map(|u| u * u).sum::<f64>().sqrt();
    let all: Vec<f64> = still.iter().map(magnitude).collect();
    // In powers of two of the median, so that one of the two ranges has zero.
    let median = quantile(&mut all.clone(), 0.5)?;
    let of_median: Vec<f64> = all.iter().map(|m| (m / median).log2()).collect();
    let near = |power: f64| {
        of_median
            .iter()
            .filter(|p| (*p - power).abs() <= OF_POWER)
            .count()
    };
    let others = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0];
    let other = others.into_iter().find(|power| near(*power) >= FEWEST)?;
    if near(0.0) < FEWEST || on_one_sphere(still) {
        return None;
    }
    let class = |k: usize| {
        let is = |power: f64| (of_median[k] - power).abs() <= OF_POWER;
        match (is(0.0), is(other)) {
            (true, _) => Some(false),
            (_, true) => Some(true),
            _ => None,
        }
    };
    let classed: Vec<(usize, bool)> = (0..still.len())
        .filter_map(|k| Some((k, class(k)?)))
        .collect();
    let pair = classed.windows(2).find(|pair| pair[0].1 != pair[1].1)?;
    let ratio = 2f64.powf(if pair[1].1 { other } else { -other });
    Some(([pair[0].0, pair[1].0], Fault::RangeChanged { ratio }))
}

/// Whether one bias makes the specific force alike in all rests. A bias of half a g, which some parts have, gives magnitudes of 0.5 and 1.5 g in one range.
fn on_one_sphere(still: &[Still]) -> bool {
    if still.len() < FEWEST_OF_SPHERE {
        return false;
    }
    let rests = || {
        still
            .iter()
            .map(|s| Vector3::from_column_slice(&s.mean[3..]))
    };
    // |u|^2 = 2 b u + (r^2 - b^2): b and the rest by least squares.
    let (mut square, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for u in rests() {
        let row = (2.0 * u).push(1.0);
        square += row * row.transpose();
        right += row * u.norm_squared();
    }
    let Some(found) = square.cholesky().map(|of| of.solve(&right)) else {
        return false;
    };
    let bias = found.xyz();
    let radius = (found.w + bias.norm_squared()).sqrt();
    let mut off: Vec<f64> = rests()
        .map(|u| ((u - bias).norm() / radius - 1.0).abs())
        .collect();
    quantile(&mut off, 0.9).is_some_and(|most| most < ON_SPHERE)
}

/// The segments before and after the columns change places, and the change.
fn columns(still: &[Still], condensed: &Condensed) -> Option<([usize; 2], Fault)> {
    if still.len() < 2 * FEWEST || !condensed.has_raw.iter().all(|has| *has) {
        return None;
    }
    let levels = |part: Range<usize>, c: usize| -> Vec<f64> {
        still[part].iter().map(|s| s.mean[c]).collect()
    };
    let span = |part: Range<usize>, c: usize| {
        let low = quantile(&mut levels(part.clone(), c), 0.1);
        let high = quantile(&mut levels(part, c), 0.9);
        low.zip(high).map_or(0.0, |(low, high)| high - low)
    };
    let widest = (0..6).map(|c| span(0..still.len(), c)).fold(0.0, f64::max);
    let same = |a: f64, b: f64| (a - b).abs() <= SAME_LEVEL * widest;
    let gyro = Sensor::Gyro.channels();
    // The level of each channel of the gyro while it is constant: that of the first segments.
    let level = |c: usize| quantile(&mut levels(0..FEWEST, c), 0.5).unwrap_or(f64::NAN);
    let at_rest: Vec<f64> = gyro.clone().map(level).collect();
    let departs = |k: usize| {
        let s = &still[k];
        gyro.clone().any(|c| !same(s.mean[c], at_rest[c]))
    };
    // Before the change hardly a segment departs, and from it on most do: even turns are few, and so are poses in which the exchanged column
    // happens to read the level of before. The change is where fewest segments are on the wrong side.
    let departing: Vec<bool> = (0..still.len()).map(departs).collect();
    let mut wrong = departing.iter().filter(|departs| !**departs).count();
    let mut best: Option<(usize, usize)> = None;
    for (first, departs) in departing.iter().enumerate() {
        let between = (FEWEST..=still.len() - FEWEST).contains(&first);
        if between && *departs && best.is_none_or(|(fewest, _)| wrong < fewest) {
            best = Some((wrong, first));
        }
        match departs {
            true => wrong += 1,
            false => wrong -= 1,
        }
    }
    let (wrong, first) = best?;
    let (before, after) = (0..first, first..still.len());
    if MOST_WRONG * wrong > before.len().min(after.len()) {
        return None;
    }
    let constant = |part: &Range<usize>, c: usize| span(part.clone(), c) <= SAME_LEVEL * widest;
    let constants = |part: &Range<usize>| (0..6).filter(|c| constant(part, *c)).collect::<Vec<_>>();
    if constants(&before) != gyro.collect::<Vec<_>>() {
        return None;
    }
    let now = constants(&after);
    // Each constant column reads what one of the gyro's read before.
    let mut read: Vec<(usize, usize)> = Vec::new();
    for &c in &now {
        let level = quantile(&mut levels(after.clone(), c), 0.5)?;
        let nearest = Sensor::Gyro
            .channels()
            .filter(|g| !read.iter().any(|(_, taken)| taken == g))
            .min_by(|a, b| {
                let [a, b] = [a, b].map(|g| (at_rest[*g] - level).abs());
                a.total_cmp(&b)
            })?;
        if !same(at_rest[nearest], level) {
            return None;
        }
        read.push((c, nearest));
    }
    let of_accel = read
        .into_iter()
        .find(|(c, _)| Sensor::Accel.channels().contains(c));
    let (now, before) = of_accel.filter(|_| now.len() == 3)?;
    let [now, before] = [now, before].map(|c| RAW_COLUMNS[c]);
    Some(([first - 1, first], Fault::ColumnsMoved { now, before }))
}
