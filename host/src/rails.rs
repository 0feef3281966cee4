//! Channels that do not follow their input: at a rail of the converter, stuck, or dead.

use crate::blocks::{Condensed, Rails};
use crate::dwell::quantile;
use crate::error::{Error, Result};
use crate::recording::{Manifest, RAW_COLUMNS};

/// Natural logarithm of the odds against a run of equal samples by chance in the whole recording.
const RUN_LOG_ODDS: f64 = 14.0;

/// Longest run of equal samples that chance explains in channel `c`, from how often neighbours are
/// equal where the channel works. `None`: they mostly are, and nothing can be told.
pub(crate) fn longest_run_by_chance(condensed: &Condensed, c: usize) -> Option<f64> {
    let mut shares: Vec<f64> = condensed
        .blocks
        .iter()
        .map(|b| b.raw[c])
        .filter(|m| m.n > 1)
        .map(|m| f64::from(m.repeats) / f64::from(m.n - 1))
        .collect();
    let share = quantile(&mut shares, 0.5)?.max(1e-3);
    let odds = RUN_LOG_ODDS + (condensed.rows as f64).ln();
    (share < 0.8).then(|| (1.0 + odds / -share.ln()).max(5.0))
}

/// Rails of the six channels: as declared, or where the largest or smallest
/// value of a whole recording is repeated more often in a row than chance allows.
pub(crate) fn find(
    condensed: &Condensed,
    manifest: &Manifest,
    longest_run: &[f64; 6],
    warnings: &mut Vec<String>,
) -> [Rails; 6] {
    let mut rails = [Rails::default(); 6];
    for (c, rail) in rails.iter_mut().enumerate() {
        if !condensed.has_raw[c] {
            continue;
        }
        let declared = manifest
            .rails
            .and_then(|r| if c < 3 { r.gyro } else { r.accel });
        if let Some([low, high]) = declared {
            *rail = Rails {
                low: Some(low),
                high: Some(high),
            };
            continue;
        }
        let moments = || {
            condensed
                .blocks
                .iter()
                .map(move |b| b.raw[c])
                .filter(|m| m.n > 0)
        };
        let high = moments().map(|m| m.max).fold(f64::NEG_INFINITY, f64::max);
        let low = moments().map(|m| m.min).fold(f64::INFINITY, f64::min);
        let chance = longest_run[c];
        if low == high {
            continue;
        }
        for (value, name) in [(high, "highest"), (low, "lowest")] {
            // Blocks are short: a run goes on through those that hold nothing else.
            let (mut longest, mut run) = (0.0_f64, 0.0);
            for m in moments() {
                if m.min == m.max && m.max == value {
                    run += f64::from(m.n);
                } else {
                    run = 0.0;
                    if m.run_value == value {
                        longest = longest.max(f64::from(m.run));
                    }
                }
                longest = longest.max(run);
            }
            if longest > chance {
                warnings.push(format!(
                    "{}: the {name} value {value} comes {longest} times in a row, chance explains {:.0}: taken for a rail",
                    RAW_COLUMNS[c], chance.floor()
                ));
                if value == high {
                    rail.high = Some(value)
                } else {
                    rail.low = Some(value)
                }
            }
        }
    }
    rails
}

/// Refuses a recording in which a channel never changes.
pub fn refuse_dead_channels(condensed: &Condensed, place: &str) -> Result<()> {
    for c in 0..6 {
        if !condensed.has_raw[c] {
            continue;
        }
        let mut moments = condensed
            .blocks
            .iter()
            .map(|b| b.raw[c])
            .filter(|m| m.n > 0);
        let Some(first) = moments.next() else {
            return Err(Error::new(
                format!("{place}, column {}", RAW_COLUMNS[c]),
                "every cell is empty or not a number",
                "leave the sensor's columns out, or import the right ones",
            ));
        };
        if first.min == first.max && moments.all(|m| m.min == first.min && m.max == first.min) {
            return Err(Error::new(
                format!("{place}, column {}", RAW_COLUMNS[c]),
                format!("the channel is stuck at {} throughout", first.min),
                "check its wiring, or that the right column was imported",
            ));
        }
    }
    Ok(())
}
