//! Masks short disturbances of a channel at rest: a door, a footstep, a few samples of a failed bus.

use super::bridging::MOST;
use super::suitability::Suitability;

/// What was masked of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Masked {
    /// Number of samples that were replaced.
    pub samples: usize,
    /// Share of all samples of the channel.
    pub share: f64,
    /// Time of the first from the beginning of the channel, s.
    pub first_s: f64,
}

/// Replaces the disturbed windows of `raw` (samples `period_s` apart) by the quiet windows before them, shifted onto the line between the
/// levels on both sides. Lines alone would remove noise.
///
/// Returns `None` and changes nothing if nothing is disturbed, if too much is, or if the level does not return: the unit was then put down
/// in another way.
pub(super) fn mask(raw: &mut [f64], seen: &mut Suitability, period_s: f64) -> Option<Masked> {
    let window = seen.window;
    let runs = runs(&seen.moving);
    let windows = runs.iter().map(|run| run.len()).sum::<usize>();
    let share = windows as f64 / seen.moving.len().max(1) as f64;
    if windows == 0 || share > MOST {
        return None;
    }
    let quiet =
        |from: usize, to: usize| to <= seen.moving.len() && !seen.moving[from..to].contains(&true);
    // Each run needs as many quiet windows before it as it has itself, and at least one after it.
    for run in &runs {
        let before = run.start.checked_sub(run.len())?;
        let returns = (seen.means.get(run.end)? - seen.means[run.start - 1]).abs();
        let as_far = seen.reach * ((run.len() + 1) as f64).sqrt();
        if !quiet(before, run.start) || !quiet(run.end, run.end + 1) || returns > as_far {
            return None;
        }
    }
    for run in &runs {
        let (from, length) = (run.start * window, run.len() * window);
        let (level, next) = (seen.means[run.start - 1], seen.means[run.end]);
        let (before, at) = raw.split_at_mut(from);
        let noise = &before[from - length..];
        for (i, (put, quiet)) in at.iter_mut().zip(noise).enumerate() {
            let k = run.start - run.len() + i / window;
            let along = (i as f64 + 0.5) / length as f64;
            *put = quiet - seen.means[k] + level + along * (next - level);
        }
        seen.moving[run.clone()].fill(false);
    }
    let first = runs.first()?.start * window;
    Some(Masked {
        samples: windows * window,
        share,
        first_s: first as f64 * period_s,
    })
}

/// The runs of disturbed windows.
fn runs(moving: &[bool]) -> Vec<std::ops::Range<usize>> {
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for (k, _) in moving.iter().enumerate().filter(|(_, moving)| **moving) {
        match runs.last_mut().filter(|run| run.end == k) {
            Some(run) => run.end = k + 1,
            None => runs.push(k..k + 1),
        }
    }
    runs
}
