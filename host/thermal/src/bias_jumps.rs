//! Jumps of a gyro's bias while the unit does not move: the stress in a die relaxes. No row is left out for them.

use mimu_recording::statistics::OF_MEDIAN;
use mimu_recording::units::median;
use nalgebra::Vector3;

use crate::row::Row;

/// Rows on each side whose mean is a level: ten seconds.
const LEVEL_ROWS: usize = 4;
/// A jump is this many times as large as the usual difference between levels without their trend, and
const JUMP_SIGMAS: f64 = 10.0;
/// larger than the change by the trend from one level to the other, because trends bend.
const JUMP_TRENDS: f64 = 1.0;

/// A jump of the bias.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasJump {
    /// Time, s: the middle between the last row before the jump and the first row after it.
    pub at_s: f64,
    /// Change of the reading without its trend, raw.
    pub change: Vector3<f64>,
}

/// Mean time and mean reading of `rows`.
fn level(rows: &[Row]) -> (f64, Vector3<f64>) {
    let n = rows.len() as f64;
    let time = rows.iter().map(|r| r.middle_s).sum::<f64>() / n;
    (time, rows.iter().map(|r| r.raw).sum::<Vector3<f64>>() / n)
}

/// Jumps in the rows of a gyro, except at the times `moved_s`, when the unit was put into another pose.
pub(crate) fn find(rows: &[Row], moved_s: &[f64]) -> Vec<BiasJump> {
    let reach = 2 * LEVEL_ROWS;
    if rows.len() < 4 * reach {
        return Vec::new();
    }
    // For each boundary: its row, the jump, the change by the trend, and the jump over its standard deviation in levels.
    let mut boundaries = Vec::new();
    for k in reach..=rows.len() - reach {
        let parts = [k - reach, k - LEVEL_ROWS, k, k + LEVEL_ROWS];
        let [a, b, c, d] = parts.map(|from| level(&rows[from..from + LEVEL_ROWS]));
        let (before_s, over_s, after_s) = (b.0 - a.0, c.0 - b.0, d.0 - c.0);
        let trend = ((b.1 - a.1) / before_s + (d.1 - c.1) / after_s) * (0.5 * over_s);
        let change = c.1 - b.1 - trend;
        let slopes = before_s.powi(-2) + after_s.powi(-2);
        let sigma = (2.0 + 0.5 * slopes * over_s * over_s).sqrt();
        boundaries.push((k, change, trend, change / sigma));
    }
    let usual = Vector3::from_fn(|axis, _| {
        let sizes = boundaries.iter().map(|b| b.3[axis].abs());
        OF_MEDIAN * median(sizes.collect()).unwrap_or(0.0)
    });
    let excess = |(_, change, trend, over): &(usize, Vector3<f64>, Vector3<f64>, Vector3<f64>)| {
        let each = (0..3).filter(|a| change[*a].abs() > JUMP_TRENDS * trend[*a].abs());
        each.map(|a| over[a].abs() / usual[a].max(f64::MIN_POSITIVE))
            .fold(0.0, f64::max)
    };
    let mut jumps: Vec<(usize, f64, BiasJump)> = Vec::new();
    for boundary in &boundaries {
        let (k, size) = (boundary.0, excess(boundary));
        let [from, to] = [rows[k - 1].middle_s, rows[k].middle_s];
        let moved = |t: &f64| (rows[k - reach].middle_s..rows[k + reach - 1].middle_s).contains(t);
        if size <= JUMP_SIGMAS || moved_s.iter().any(moved) {
            continue;
        }
        let jump = BiasJump {
            at_s: 0.5 * (from + to),
            change: boundary.1,
        };
        // The boundaries around a jump contain part of it.
        match jumps.last_mut().filter(|last| k - last.0 < reach) {
            Some(last) if last.1 >= size => {}
            Some(last) => *last = (k, size, jump),
            None => jumps.push((k, size, jump)),
        }
    }
    jumps.into_iter().map(|(_, _, jump)| jump).collect()
}
