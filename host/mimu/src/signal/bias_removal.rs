//! Firmware that removes the gyro's bias before it is recorded.
//!
//! Some units send the gyro through a high-pass filter, others learn the bias whenever they are still. Either way the readings at rest no longer
//! contain the bias of the sensor, so a calibration cannot give it. A high-pass also removes a share of every turn, as a scale factor
//! that is too small would; its inverse is known, and is applied before the dwells are sought.

mod high_pass;
mod zeroed;

use std::ops::Range;

use crate::bias_removal::{BiasRemoval, HighPass, Zeroed};
use crate::quantity::Sensor;
use crate::signal::blocks::{Block, Condensed, quantile};

/// Variance of a block at rest, relative to that of the quietest fifth.
const STILL: f64 = 9.0;
/// Standard deviations of a gyro within a block that firmware may cause, relative to its mean, and not a motion: by a filter of a second or more, and by
/// a bias that is learnt within a second. With the second limit the rests of a filter would contain the ends of turns: its decay within the rests came
/// out 10 % too fast.
const FILTERED: f64 = 0.05;
const LEARNT: f64 = 0.15;
/// Fewest blocks of a rest.
const FEWEST: usize = 12;
/// Blocks left out at both ends of a rest, where the unit may still move.
const GUARD: usize = 2;

/// What firmware did to the gyro in a recording by hand; `None` if nothing shows.
pub(crate) fn find(condensed: &Condensed) -> Option<BiasRemoval> {
    if !(0..6).all(|c| condensed.has_raw[c]) {
        return None;
    }
    let blocks = &condensed.blocks;
    let filter = HighPass::find(condensed, &rests(blocks, FILTERED)?);
    let zeroed = || Zeroed::find(blocks, &rests(blocks, LEARNT)?);
    let filter = filter.map(BiasRemoval::HighPass);
    filter.or_else(|| zeroed().map(BiasRemoval::Zeroed))
}

/// Segments in which neither sensor moves. Within a block the gyro may change by `changes`, relative to its mean, because that is what firmware does. It
/// may also jump once, in a single block in which the accelerometer shows nothing.
fn rests(blocks: &[Block], changes: f64) -> Option<Vec<Range<usize>>> {
    let variance = |b: &Block, c: usize| b.raw[c].m2 / f64::from(b.raw[c].n.max(2) - 1);
    let mut floor = [0.0; 6];
    for (c, floor) in floor.iter_mut().enumerate() {
        let mut all: Vec<f64> = blocks.iter().map(|b| variance(b, c)).collect();
        *floor = quantile(&mut all, 0.2)?;
    }
    let is_still = |b: &Block, sensor: Sensor| {
        let of_channel = |c: usize| {
            let change = sensor.pick((changes * b.raw[c].mean).powi(2), 0.0);
            b.raw[c].n > 1 && variance(b, c) <= (STILL * floor[c]).max(change)
        };
        sensor.channels().all(of_channel)
    };
    let of = |sensor| -> Vec<bool> { blocks.iter().map(|b| is_still(b, sensor)).collect() };
    let (gyro, accel) = (of(Sensor::Gyro), of(Sensor::Accel));
    let beside = |i: usize| i > 0 && gyro[i - 1] && gyro.get(i + 1).is_some_and(|g| *g);
    let mut found: Vec<Range<usize>> = Vec::new();
    for (i, block) in blocks.iter().enumerate() {
        if !(accel[i] && (gyro[i] || beside(i))) {
            continue;
        }
        match found.last_mut() {
            Some(last) if last.end == i && !block.after_gap => last.end = i + 1,
            _ => found.push(i..i + 1),
        }
    }
    found.retain(|r| r.len() >= FEWEST);
    Some(found)
}

/// Mean reading of the gyro over some blocks, raw.
fn mean(blocks: &[Block]) -> [f64; 3] {
    let count = blocks.len() as f64;
    [0, 1, 2].map(|axis| blocks.iter().map(|b| b.raw[axis].mean).sum::<f64>() / count)
}
