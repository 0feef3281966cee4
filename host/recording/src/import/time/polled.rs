//! Stamps of a loop that reads the sensor once a round.
//!
//! A microcontroller that reads, formats and writes in one loop takes one sample a round: usually after 80 ms, but after 420 ms while a card is busy.
//! No sample is missing or late: each stamp is the time of its reading. The sample count does not give the time: it was off the stamps by 16 s in
//! half an hour.

use serde::Serialize;

use super::gap::{Gap, STALL_S, quantile};

/// An interval shorter than this share of the usual one comes from a hand-over or a repeated row.
const SHORT: f64 = 0.5;
/// Largest share of intervals that may still be shorter.
const ODD: f64 = 1e-3;
/// A late hand-over is followed by a short interval: successive intervals correlate by -0.5. Rounds of a loop do not depend on the round before: 0,
/// or more if the loop is slow for a while (0.6 and 0.7 in recordings).
const CAUGHT_UP: f64 = -0.2;
/// Largest ratio of the mean interval to the usual one, without pauses of more than [`STALL_S`]: 1.02 and 1.15 in recordings. If samples come ten at
/// a time, the usual interval is that within a burst, and the mean is several times that.
const IN_BURSTS: f64 = 2.0;
/// In that correlation, rounds count as at most this many usual ones, so that a single pause does not decide.
const LONG: f64 = 4.0;
/// A longer interval, in usual ones, is not interpolated across.
pub(in super::super) const LONGEST: f64 = 3.0;
/// Fewer intervals do not show the correlation: with 100 it is known to 0.1.
const FEWEST: usize = 100;

/// How long the rounds of a loop take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rounds {
    /// Half of them take longer, s.
    pub usual_s: f64,
    /// The shortest, s.
    pub shortest_s: f64,
    /// The longest, s.
    pub longest_s: f64,
}

/// The rounds of the loop that made `stamps`, s; `None` if no loop did.
pub(super) fn rounds(stamps: &[f64]) -> Option<Rounds> {
    let steps: Vec<f64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.len() < FEWEST {
        return None;
    }
    let mut sorted = steps.clone();
    let usual_s = quantile(&mut sorted, 0.5);
    let short = quantile(&mut sorted, ODD) < SHORT * usual_s;
    let (mut sum_s, mut count) = (0.0, 0.0);
    for step in steps.iter().filter(|step| **step <= STALL_S) {
        (sum_s, count) = (sum_s + step, count + 1.0);
    }
    let in_bursts = sum_s > IN_BURSTS * usual_s * count;
    if !(usual_s > 0.0) || short || in_bursts || correlation(&steps, usual_s) < CAUGHT_UP {
        return None;
    }
    Some(Rounds {
        usual_s,
        shortest_s: steps.iter().copied().fold(f64::INFINITY, f64::min),
        longest_s: steps.iter().copied().fold(0.0, f64::max),
    })
}

/// Correlation of each interval with the next.
fn correlation(steps: &[f64], usual_s: f64) -> f64 {
    let bounded: Vec<f64> = steps.iter().map(|s| s.min(LONG * usual_s)).collect();
    let mean = bounded.iter().sum::<f64>() / bounded.len() as f64;
    let squares: f64 = bounded.iter().map(|s| (s - mean).powi(2)).sum();
    let pairs = bounded.windows(2).map(|p| (p[0] - mean) * (p[1] - mean));
    pairs.sum::<f64>() / squares.max(f64::MIN_POSITIVE)
}

/// The rounds that nothing is interpolated across.
pub(super) fn gaps(stamps: &[f64], rounds: &Rounds) -> Vec<Gap> {
    let steps = stamps.windows(2).enumerate();
    let long = steps.filter_map(|(i, pair)| {
        let step = (pair[1] - pair[0]) / rounds.usual_s;
        (step > LONGEST).then_some(Gap {
            row: i as u64 + 1,
            missing: step.round() as u64 - 1,
        })
    });
    long.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evenly distributed from 0 to 1.
    fn uniform(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    #[test]
    fn rounds_of_a_loop_are_distinguished_from_samples_that_are_handed_over_late() {
        let mut state = 3;
        let (mut t, mut of_loop) = (0.0, Vec::new());
        for _ in 0..2000 {
            of_loop.push(t);
            // One round in twenty writes to a card.
            let card = if uniform(&mut state) < 0.05 {
                0.12
            } else {
                0.0
            };
            t += 0.08 + 0.01 * uniform(&mut state) + card;
        }
        let found = rounds(&of_loop).unwrap();
        assert!((found.usual_s - 0.085).abs() < 0.002, "{found:?}");
        assert!(
            found.shortest_s >= 0.08 && found.longest_s > 0.2,
            "{found:?}"
        );
        // Late stamps of samples that a crystal took.
        let late = |i: u64| 0.08 * i as f64 + 0.03 * uniform(&mut state);
        assert_eq!(rounds(&(0..2000).map(late).collect::<Vec<f64>>()), None);
        // Every tenth row occurs twice.
        let twice: Vec<f64> = (0..2000).map(|i| 0.08 * f64::from(i - i / 10)).collect();
        assert_eq!(rounds(&twice), None);
    }
}
