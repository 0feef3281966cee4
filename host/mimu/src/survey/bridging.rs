//! Bridges lost samples of a channel at rest.

/// Largest share of a channel that is masked, or bridged. The replacement has the noise of the neighbours, so N and B are off by about this share. If
/// more is disturbed, the unit was not at rest.
pub(super) const MOST: f64 = 0.01;

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
/// samples before the gap, shifted onto the line between the levels on both sides, as a disturbance is masked.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_in_a_ramp_is_bridged_by_its_ramp_and_the_noise_before_it() {
        let noise = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
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
