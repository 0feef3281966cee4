//! The temperature that an effect follows: as recorded, behind a lag, and without the thermometer's self-heating.

use nalgebra::{DMatrix, DVector};

use super::quantity::REFERENCE_C;
use crate::signal::blocks::Block;

/// The temperature that an effect follows, if it is not the recorded one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// Lag, s, if it has one.
    pub lag_s: Option<f64>,
    /// Whether the thermometer is on another die, whose self-heating after power-on the sensor does not share.
    pub without_self_heating: bool,
}

/// Middle of each block, s, and its temperature above [`REFERENCE_C`], °C. A block without one has that of the block before, as on the device; before
/// the first it is not a number.
pub fn offsets(blocks: &[Block]) -> Vec<(f64, f64)> {
    let mut held = f64::NAN;
    let each = blocks.iter().map(|b| {
        if b.temp_c.mean.is_finite() {
            held = b.temp_c.mean - REFERENCE_C;
        }
        (0.5 * (b.start_s + b.last_s), held)
    });
    each.collect()
}

/// A first-order lag: `(time in s, value)` in, the lagged values out.
pub fn lagged(signal: &[(f64, f64)], lag_s: f64) -> Vec<f64> {
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
            // The input is linear between two values: exact for ramps.
            let slope = if dt > 0.0 { (v - before.1) / dt } else { 0.0 };
            state = v - slope * lag_s + (state - before.1 + slope * lag_s) * keep;
        }
        before = (t, if v.is_finite() { v } else { before.1 });
        out.push(state);
    }
    out
}

/// Time after the start in which a thermometer heats itself, s. The dies of such parts need 3 to 10 s.
const START_S: f64 = 60.0;
/// Time constants of the self-heating that are tried first: the smallest, s, the ratio of each to the one before, and their number.
const SELF_HEATING_S: (f64, f64, i32) = (2.0, 1.33, 9);
/// Smallest self-heating that counts, K.
const SELF_HEATING_C: f64 = 0.2;
/// Smallest F statistic: the thermometer alone has to show self-heating beyond doubt.
const SELF_HEATING_F: f64 = 50.0;

/// A temperature without the self-heating of its thermometer after power-on, which a sensor on another die does not share. Over the first minute an
/// exponential is fitted beside a parabola, the slower course of the board. `None` if no self-heating shows.
pub fn without_self_heating(signal: &[(f64, f64)]) -> Option<Vec<(f64, f64)>> {
    let first = signal.first()?.0;
    let start: Vec<(f64, f64)> = signal
        .iter()
        .map(|s| (s.0 - first, s.1))
        .take_while(|s| s.0 < START_S)
        .filter(|s| s.1.is_finite())
        .collect();
    let n = start.len();
    if n < 20 || start.last()?.0 < 0.5 * START_S {
        return None;
    }
    let y = DVector::from_fn(n, |i, _| start[i].1);
    let fit = |own_s: Option<f64>| {
        let columns = 3 + usize::from(own_s.is_some());
        let design = DMatrix::from_fn(n, columns, |i, k| match (k, own_s) {
            (3, Some(own_s)) => (-start[i].0 / own_s).exp(),
            (k, _) => (start[i].0 / START_S).powi(k as i32),
        });
        let x = design.clone().svd(true, true).solve(&y, 1e-12).ok()?;
        Some(((&y - design * &x).norm_squared(), x))
    };
    let (without, _) = fit(None)?;
    let (least, mut ratio, count) = SELF_HEATING_S;
    let at = |own_s: f64| Some((own_s, fit(Some(own_s))?));
    let tried = (0..count).filter_map(|k| at(least * ratio.powi(k)));
    let mut best = tried.min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    while ratio > 1.005 {
        ratio = ratio.sqrt();
        let beside = [best.0 * ratio, best.0 / ratio];
        let better = beside.into_iter().filter_map(at);
        if let Some(other) = better.min_by(|a, b| a.1.0.total_cmp(&b.1.0))
            && other.1.0 < best.1.0
        {
            best = other;
        }
    }
    let (own_s, (with, x)) = best;
    let f = (without - with) / 2.0 / (with / (n as f64 - 5.0)).max(f64::MIN_POSITIVE);
    if f < SELF_HEATING_F || x[3] > -SELF_HEATING_C {
        return None;
    }
    let without = signal
        .iter()
        .map(|(t, v)| (*t, v - x[3] * (-(t - first) / own_s).exp()));
    Some(without.collect())
}

/// Spearman's rank correlation of the values of a signal with time; `None` if fewer than three values are known or all are equal.
pub fn rank_correlation(signal: &[(f64, f64)]) -> Option<f64> {
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
        let out = lagged(&ramp, 60.0);
        assert!((out[3999] - 0.5 * (3999.0 - 60.0)).abs() < 1e-9);
        let step: Vec<(f64, f64)> = (0..100)
            .map(|i| (f64::from(i), f64::from(u8::from(i > 0))))
            .collect();
        // The step is a ramp of one second: exp(-99/20) (exp(1/20) - 1) 20 of it remains.
        let left = 20.0 * (-99.0_f64 / 20.0).exp() * (0.05_f64.exp() - 1.0);
        assert!((1.0 - lagged(&step, 20.0)[99] - left).abs() < 1e-12);
    }

    #[test]
    fn what_a_thermometer_warms_up_by_itself_is_taken_out_and_a_board_that_warms_is_left() {
        let noise = |i: i32| 0.02 * f64::from((i * 7919) % 101 - 50) / 50.0;
        let board = |t: f64| 20.0 - 4.0 * (-t / 300.0).exp();
        let signal = |own_c: f64| -> Vec<(f64, f64)> {
            let at = |i: i32| {
                let t = f64::from(i);
                (100.0 + t, board(t) - own_c * (-t / 5.0).exp() + noise(i))
            };
            (0..300).map(at).collect()
        };
        let without = without_self_heating(&signal(6.0)).unwrap();
        for (t, v) in &without {
            assert!((v - board(t - 100.0)).abs() < 0.1, "{t} {v}");
        }
        assert!(without_self_heating(&signal(0.0)).is_none());
    }

    #[test]
    fn order_is_one_for_a_bent_ramp_and_none_for_there_and_back() {
        let signal = |value: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
            (0..101)
                .map(|i| (f64::from(i), value(f64::from(i))))
                .collect()
        };
        let falls = signal(&|t| (-t / 20.0).exp());
        assert!((rank_correlation(&falls).unwrap() + 1.0).abs() < 1e-12);
        let returns = signal(&|t| -(t - 50.0).abs());
        assert!(rank_correlation(&returns).unwrap().abs() < 1e-12);
        // Ties: ranks 0.5, 0.5, 2.5, 2.5 against 0, 1, 2, 3 correlate by 4/sqrt(5 * 4).
        let steps = [(0.0, 1.0), (1.0, 1.0), (2.0, 5.0), (3.0, 5.0)];
        assert!((rank_correlation(&steps).unwrap() - 4.0 / 20f64.sqrt()).abs() < 1e-12);
        assert_eq!(rank_correlation(&signal(&|_| 3.0)), None);
    }
}
