//! Whether the temperature ramps within a dwell.

use crate::signal::blocks::Block;

/// If the temperature changes over a dwell by more than this many standard errors, it ramps.
const RAMPS_SIGMAS: f64 = 5.0;
/// Least change over a dwell that counts, K. At 0.1 deg/s/K it moves a bias by 0.01 deg/s, as much as an analog gyro scatters within a
/// dwell.
const RAMPS_C: f64 = 0.1;

/// Whether the temperature ramps within the dwell of these `blocks`, which lasts `duration_s`: compares the slope of a line through them
/// with their scatter about it.
pub(crate) fn ramps(blocks: &[Block], duration_s: f64) -> bool {
    let known: Vec<(f64, f64)> = blocks
        .iter()
        .filter(|b| b.temp_c.mean.is_finite())
        .map(|b| (0.5 * (b.start_s + b.last_s), b.temp_c.mean))
        .collect();
    let n = known.len() as f64;
    if n < 4.0 {
        return false;
    }
    let (sum_t, sum_c) = known
        .iter()
        .fold((0.0, 0.0), |(a, b), (t, c)| (a + t, b + c));
    let (mean_t, mean_c) = (sum_t / n, sum_c / n);
    let centred = || known.iter().map(|(t, c)| (t - mean_t, c - mean_c));
    let (tt, tc, cc) = centred().fold((0.0, 0.0, 0.0), |(tt, tc, cc), (t, c)| {
        (tt + t * t, tc + t * c, cc + c * c)
    });
    if !(tt > 0.0) {
        return false;
    }
    let slope = tc / tt;
    let scatter = ((cc - slope * tc).max(0.0) / (n - 2.0)).sqrt();
    let change = (slope * duration_s).abs();
    change > RAMPS_C && slope.abs() * tt.sqrt() > RAMPS_SIGMAS * scatter
}
