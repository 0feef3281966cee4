//! A first-order lag.

/// Behind a first-order lag: `(time in s, value)` in, the lagged value out.
pub fn late(signal: &[(f64, f64)], lag_s: f64) -> Vec<f64> {
    let mut state = signal
        .iter()
        .map(|s| s.1)
        .find(|v| v.is_finite())
        .unwrap_or(f64::NAN);
    let mut before = signal.first().copied().unwrap_or_default();
    let mut out = Vec::with_capacity(signal.len());
    for &(t, v) in signal {
        let dt = (t - before.0).max(0.0);
        let keep = (-dt / lag_s).exp();
        if v.is_finite() && before.1.is_finite() {
            // The input runs straight from one to the next: exact for ramps.
            let slope = if dt > 0.0 { (v - before.1) / dt } else { 0.0 };
            state = v - slope * lag_s + (state - before.1 + slope * lag_s) * keep;
        }
        before = (t, if v.is_finite() { v } else { before.1 });
        out.push(state);
    }
    out
}
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behind_a_lag_a_ramp_is_late_by_the_lag_and_a_step_decays() {
        let ramp: Vec<(f64, f64)> = (0..4000)
            .map(|i| (f64::from(i), 0.5 * f64::from(i)))
            .collect();
        let out = late(&ramp, 60.0);
        assert!((out[3999] - 0.5 * (3999.0 - 60.0)).abs() < 1e-9);
        let step: Vec<(f64, f64)> = (0..100)
            .map(|i| (f64::from(i), f64::from(u8::from(i > 0))))
            .collect();
        // The step is a ramp of a second: exp(-99/20) (exp(1/20) - 1) 20 is left of it.
        let left = 20.0 * (-99.0_f64 / 20.0).exp() * (0.05_f64.exp() - 1.0);
        assert!((1.0 - late(&step, 20.0)[99] - left).abs() < 1e-12);
    }
}
