//! Reduces bands of a series to the floor of its spectrum.

use realfft::num_complex::Complex;

use super::transform::Transform;

/// A band that is reduced.
pub(super) struct Cut<'a> {
    /// Its ends, Hz.
    pub ends_hz: [f64; 2],
    /// Factor on the amplitude at a frequency (Hz).
    pub gain: Box<dyn Fn(f64) -> f64 + 'a>,
}

/// Removes the share `1 - gain` of every frequency within the bands of `cuts` from `rates`; other frequencies do not change.
///
/// The phases are kept, so the part of a bump that belongs to the floor remains: a notch would leave a hole in the noise. All bands are
/// reduced at once, because the transforms of the whole series are the main cost.
pub(super) fn flatten(rates: &mut [f64], dt_s: f64, cuts: &[Cut]) {
    if cuts.is_empty() {
        return;
    }
    // Without the straight line through both ends, which would be a step at the end of the series.
    let (first, last) = (rates[0], rates[rates.len() - 1]);
    let slope = (last - first) / (rates.len() - 1) as f64;
    let mut off = Transform::of(rates, [first, slope]);
    let length = off.length as f64;
    let df_hz = 1.0 / (length * dt_s);
    let mut ends: Vec<(usize, usize, &Cut)> = cuts
        .iter()
        .map(|cut| {
            let [low, high] = cut.ends_hz.map(|hz| hz / df_hz);
            let last = off.bins.len() - 1;
            (low.ceil().max(0.0) as usize, (high as usize).min(last), cut)
        })
        .collect();
    ends.sort_by_key(|(low, ..)| *low);
    let mut next = 0;
    for (low, high, cut) in ends {
        if low > next {
            off.bins[next..low].fill(Complex::default());
        }
        for k in low.max(next)..=high {
            off.bins[k] *= (1.0 - (cut.gain)(k as f64 * df_hz)) / length;
        }
        next = next.max(high + 1);
    }
    off.bins[next..].fill(Complex::default());
    for (rate, off) in rates.iter_mut().zip(off.inverse()) {
        *rate -= off;
    }
}
