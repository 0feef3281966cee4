//! A band of a series brought down to the floor of its spectrum.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Takes off `rates` the share `1 - gain` of every frequency (Hz) between both ends; elsewhere they stay as they are.
///
/// The phases are kept, and so of a bump that rises above the floor what belongs to the floor is still there: a notch would leave a
/// hole in the noise.
pub(super) fn flatten(rates: &mut [f64], dt_s: f64, ends_hz: [f64; 2], gain: impl Fn(f64) -> f64) {
    let n = rates.len();
    let mut planner = RealFftPlanner::new();
    let (forward, inverse) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n));
    let mut input = rates.to_vec();
    // Without the straight line through both ends, which would be a step where the series is joined to itself.
    let (first, last) = (rates[0], rates[n - 1]);
    for (i, rate) in input.iter_mut().enumerate() {
        *rate -= first + (last - first) * i as f64 / (n - 1) as f64;
    }
    let mut bins = forward.make_output_vec();
    // Refused only for buffers of another length than its own.
    let _ = forward.process(&mut input, &mut bins);
    let df_hz = 1.0 / (n as f64 * dt_s);
    for (k, bin) in bins.iter_mut().enumerate() {
        let frequency = k as f64 * df_hz;
        *bin = match (ends_hz[0]..=ends_hz[1]).contains(&frequency) {
            true => *bin * (1.0 - gain(frequency)) / n as f64,
            false => Complex::default(),
        };
    }
    if n.is_multiple_of(2) {
        bins[n / 2].im = 0.0;
    }
    let _ = inverse.process(&mut bins, &mut input);
    for (rate, off) in rates.iter_mut().zip(&input) {
        *rate -= off;
    }
}
