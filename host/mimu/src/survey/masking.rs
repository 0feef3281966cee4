//! Masks short disturbances of a channel at rest (a door, a footstep, a few samples of a failed bus), and bridges lost samples.

use super::suitability::Suitability;

/// Largest share of a channel that is masked, or bridged. The replacement has the noise of the neighbours, so N and B are off by about this share. If
/// more is disturbed, the unit was not at rest.
pub(super) const MOST: f64 = 0.01;

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

/// Whether the gaps `lost` in `kept` samples can be bridged: few samples are missing, and each gap has as many before it.
pub(super) fn bridges(lost: &[(usize, usize)], kept: usize) -> bool {
    let missing: usize = lost.iter().map(|(_, count)| count).sum();
    let mut from = 0;
    let reach = lost.iter().all(|&(after, count)| {
        let before = after - std::mem::replace(&mut from, after);
        before >= count
    });
    reach && from < kept && missing as f64 <= MOST * kept as f64
}

/// Puts samples into `raw` where some were lost: `lost` has the index of the sample after each gap, and the number of those that are missing. They are the
/// samples before the gap, shifted onto the line between the levels on both sides, as [`mask`] does it.
///
/// A level is the mean of as many samples as are missing: the sum over the gap then errs by no more than the noise of a sum of as many samples.
pub(super) fn bridge(raw: &[f64], lost: &[(usize, usize)]) -> Vec<f64> {
    let missing: usize = lost.iter().map(|(_, count)| count).sum();
    let mut whole = Vec::with_capacity(raw.len() + missing);
    let mut from = 0;
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    for (k, &(after, count)) in lost.iter().enumerate() {
        whole.extend_from_slice(&raw[from..after]);
        let next = lost.get(k + 1).map_or(raw.len(), |(next, _)| *next);
        let before = &raw[after - count..after];
        let level = mean(before);
        let slope = mean(&raw[after..next.min(after + count)]) - level;
        for (i, own) in before.iter().enumerate() {
            // From the middle of the samples before to that of those after are two lengths of the gap.
            let along = 0.25 + 0.5 * (i as f64 + 0.5) / count as f64;
            whole.push(own + along * slope);
        }
        from = after;
    }
    whole.extend_from_slice(&raw[from..]);
    whole
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_in_a_ramp_is_bridged_by_its_ramp_and_the_noise_before_it() {
        let noise = |k: usize| if k % 2 == 0 { 1.0 } else { -1.0 };
        let all: Vec<f64> = (0..40).map(|k| 0.5 * k as f64 + noise(k)).collect();
        let kept: Vec<f64> = [&all[..20], &all[24..]].concat();
        let whole = bridge(&kept, &[(20, 4)]);
        assert_eq!(whole.len(), 40);
        let deviation = |k: usize| whole[k] - 0.5 * k as f64;
        // The copy repeats the slope of the four samples before on top of the line between the levels.
        let mean = (20..24).map(deviation).sum::<f64>() / 4.0;
        assert!(mean.abs() < 1e-9, "{mean}");
        assert!((20..24).all(|k| deviation(k) * noise(k) > 0.0));
    }
}
