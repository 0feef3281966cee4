//! Whether the temperature ramps within a dwell.

use crate::signal::blocks::Block;
use mimu_recording::statistics::Line;

/// If the temperature changes over a dwell by more than this many standard errors, it ramps.
const RAMPS_SIGMAS: f64 = 5.0;
/// Least change over a dwell that counts, K. At 0.1 deg/s/K it moves a bias by 0.01 deg/s, as much as an analog gyro scatters within a
/// dwell.
const RAMPS_C: f64 = 0.1;
/// Fewest blocks of a line.
const FEWEST: usize = 4;

/// Whether the temperature ramps within the dwell of these `blocks`, which lasts `duration_s`: compares the slope of a line through them
/// with their scatter about it.
pub(crate) fn ramps(blocks: &[Block], duration_s: f64) -> bool {
    let known = blocks.iter().filter(|b| b.temp_c.mean.is_finite());
    let known = known.map(|b| [0.5 * (b.start_s + b.last_s), b.temp_c.mean]);
    if known.clone().count() < FEWEST {
        return false;
    }
    Line::through(known).is_some_and(|line| {
        (line.slope * duration_s).abs() > RAMPS_C && line.slope.abs() > RAMPS_SIGMAS * line.sigma
    })
}
