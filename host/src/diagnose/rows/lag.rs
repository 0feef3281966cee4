//! What temperature does over time: behind a lag, and whether it ever comes back.

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
/// Spearman's rank correlation of the values of a signal with time; `None` where fewer than three values are known or all are one.
pub fn order(signal: &[(f64, f64)]) -> Option<f64> {
    let mut known: Vec<(usize, f64)> = signal
        .iter()
        .map(|s| s.1)
        .filter(|v| v.is_finite())
        .enumerate()
        .collect();
    let n = known.len();
    known.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (first, last) = (known.first()?.1, known.last()?.1);
    if n < 3 || first == last {
        return None;
    }
    // Equal values share the mean of their ranks.
    let mut ranks = vec![0.0; n];
    for same in known.chunk_by(|a, b| a.1 == b.1) {
        let at = known.partition_point(|k| k.1 < same[0].1);
        for (index, _) in same {
            ranks[*index] = at as f64 + 0.5 * (same.len() - 1) as f64;
        }
    }
    let middle = 0.5 * (n - 1) as f64;
    let (mut both, mut time, mut value) = (0.0, 0.0, 0.0);
    for (i, rank) in ranks.iter().enumerate() {
        let (t, v) = (i as f64 - middle, rank - middle);
        both += t * v;
        time += t * t;
        value += v * v;
    }
    Some(both / (time * value).sqrt())
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

    #[test]
    fn order_is_one_for_a_bent_ramp_and_none_for_there_and_back() {
        let signal = |value: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
            (0..101)
                .map(|i| (f64::from(i), value(f64::from(i))))
                .collect()
        };
        let falls = signal(&|t| (-t / 20.0).exp());
        assert!((order(&falls).unwrap() + 1.0).abs() < 1e-12);
        let returns = signal(&|t| -(t - 50.0).abs());
        assert!(order(&returns).unwrap().abs() < 1e-12);
        // Ties: ranks 0.5, 0.5, 2.5, 2.5 against 0, 1, 2, 3 correlate by 4/sqrt(5 * 4).
        let steps = [(0.0, 1.0), (1.0, 1.0), (2.0, 5.0), (3.0, 5.0)];
        assert!((order(&steps).unwrap() - 4.0 / 20f64.sqrt()).abs() < 1e-12);
        assert_eq!(order(&signal(&|_| 3.0)), None);
    }
}
