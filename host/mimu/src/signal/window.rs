//! Windows of a second: mean and variance of the raw channels, by which stillness is judged.

use crate::signal::blocks::{Block, pool, quantile};

/// This many bursts are a way of recording; fewer pauses are a loss of samples.
const BURSTS: usize = 20;
/// Largest median of the bursts, and smallest median of the pauses between them, s. Longer bursts show by themselves that they are still,
/// and are separate dwells. Joined, 25 bursts of 5 s in a cooling chamber became four dwells whose noise was their drift.
const BURST_S: f64 = 2.0;
const PAUSE_S: f64 = 1.0;

/// Whether samples were taken in short bursts, with pauses. A single burst may be too short to show that it is still; joined with its
/// neighbours it is long enough.
pub(crate) fn in_bursts(blocks: &[Block]) -> bool {
    let starts = (1..blocks.len()).filter(|i| blocks[*i].after_gap);
    let starts: Vec<usize> = [0].into_iter().chain(starts).collect();
    let ends = starts[1..].iter().copied().chain([blocks.len()]);
    let mut lengths: Vec<f64> = starts
        .iter()
        .zip(ends)
        .map(|(from, to)| blocks[to - 1].last_s - blocks[*from].start_s)
        .collect();
    let mut pauses: Vec<f64> = starts[1..]
        .iter()
        .map(|i| blocks[*i].start_s - blocks[i - 1].last_s)
        .collect();
    let median = |values: &mut Vec<f64>| quantile(values, 0.5);
    starts.len() >= BURSTS
        && median(&mut lengths).is_some_and(|s| s < BURST_S)
        && median(&mut pauses).is_some_and(|s| s > PAUSE_S)
}

/// The six raw channels over [`WINDOW_S`](crate::signal::stillness::WINDOW_S), and the temperature.
pub(crate) struct Window {
    /// Means.
    pub mean: [f64; 6],
    /// Variances of a sample.
    pub variance: [f64; 6],
    /// Shares of these variances that are between the means of the blocks: small for noise, near one for motion slower than a block.
    pub between: [f64; 6],
    /// Temperature in the middle, °C.
    pub temp_c: f64,
}

/// The window that begins at each block; `None` where there is a gap in it, unless samples come in bursts.
pub(crate) fn windows(
    blocks: &[Block],
    width: usize,
    channels: &[usize],
    bursts: bool,
) -> Vec<Option<Window>> {
    let window = |window: &[Block]| {
        let (mut mean, mut variance, mut between) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        for &c in channels {
            let pooled = pool(window.iter().map(|b| b.raw[c]));
            let within: f64 = window.iter().map(|b| b.raw[c].m2).sum();
            mean[c] = pooled.mean;
            between[c] = match pooled.m2 > 0.0 {
                true => 1.0 - within / pooled.m2,
                false => 0.0,
            };
            variance[c] = match pooled.n {
                0 | 1 => f64::INFINITY,
                n => pooled.m2 / f64::from(n - 1),
            };
        }
        Window {
            mean,
            variance,
            between,
            temp_c: window[width / 2].temp_c.mean,
        }
    };
    let whole = |w: &[Block]| bursts || !w[1..].iter().any(|b| b.after_gap);
    blocks
        .windows(width)
        .map(|w| whole(w).then(|| window(w)))
        .collect()
}
