//! N from the band in which a spectrum is flat.
//!
//! An Allan curve shows white noise where it falls as 1/√τ. Behind a slow filter, or above a strong flicker noise, it hardly does. The
//! spectrum resolves every frequency, and is still flat in between.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::lines::Line;
use super::welch::{BIN_OVERLAP, Welch};

/// Means of the spectrum in an octave.
const PER_OCTAVE: f64 = 6.0;
/// Least number of bins in a mean. The lowest mean begins at bin 2: below, the window mixes in the mean of the segment.
const FEWEST_BINS: usize = 4;
/// Least number of means that must remain.
const FEWEST: usize = 10;
/// Least number of these in which the spectrum is white.
const FEWEST_WHITE: usize = 6;
/// If the misfit has a lower probability, the ends are left out.
const FITS: f64 = 1e-3;
/// Least drop in deviance for another term, and margin of the plausible models: as in the model of the Allan curve.
const TERM_DEVIANCE: f64 = 8.0;
const PLAUSIBLE: f64 = 5.3;
/// Largest share of N² that a filter may remove at the upper end: up to there the square of the frequency represents it. At 0.3, N behind a
/// filter of first order was 0.9 % too low, two thirds of its standard deviation.
const BENT: f64 = 0.1;
/// N² is seen if it exceeds this many of its standard deviations.
const SEEN: f64 = 3.0;

/// Terms of a density: white, flicker, random walk, and one that grows or falls with the square of the frequency.
const TERMS: usize = 4;
const BEND: usize = 3;

/// White noise from the spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct White {
    /// N, unit/√Hz.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Ends of its confidence interval.
    pub interval: [f64; 2],
    /// Band in which it is more than half of the density, Hz; if `None`, only the upper end has a meaning.
    pub band_hz: Option<[f64; 2]>,
}

/// Mean of neighbouring bins.
struct Mean {
    from_hz: f64,
    to_hz: f64,
    density: f64,
    dof: f64,
    basis: [f64; TERMS],
}

struct Fitted {
    terms: Vec<usize>,
    a: [f64; TERMS],
    /// Variance of the white term.
    variance: f64,
    deviance: f64,
}

/// As [`super::Lines::white_band`]; `welch` has the spectrum.
pub(super) fn of_spectrum(
    welch: &Welch,
    dt_s: f64,
    lines: &[Line],
    confidence: f64,
) -> Option<White> {
    let beside = |line: &Line| {
        let [low, high] = line.band_hz;
        [2.0 * low - high, 2.0 * high - low]
    };
    let out: Vec<[f64; 2]> = lines.iter().map(beside).collect();
    let means = means(welch, dt_s, &out);
    let z = Normal::standard().inverse_cdf(0.5 + 0.5 * confidence);
    // The widest band that the terms describe; of two equally wide ones, that with lower frequencies, which show the slow terms.
    for less in 0..=means.len().checked_sub(FEWEST)? {
        for low in 0..=less {
            let part = &means[low..means.len() - (less - low)];
            if let Some(white) = fit(part, less > low, z) {
                return Some(white);
            }
        }
    }
    None
}

fn means(welch: &Welch, dt_s: f64, out: &[[f64; 2]]) -> Vec<Mean> {
    let last = welch.power.len() - 2;
    let mut means = Vec::new();
    let mut from = 2;
    while from <= last {
        let next = (from as f64 * 2f64.powf(1.0 / PER_OCTAVE)).round() as usize;
        let to = next.max(from + FEWEST_BINS) - 1;
        if to > last {
            break;
        }
        let hz = |k: usize| k as f64 * welch.df_hz;
        let counts = |k: &usize| {
            !out.iter()
                .any(|[low, high]| (*low..=*high).contains(&hz(*k)))
        };
        let bins: Vec<usize> = (from..=to).filter(counts).collect();
        let first = from;
        from = to + 1;
        if bins.len() < FEWEST_BINS {
            continue;
        }
        let n = bins.len() as f64;
        let mean = |of: &dyn Fn(f64) -> f64| {
            let all = bins.iter().map(|k| of(hz(*k)));
            all.sum::<f64>() / n
        };
        // Quantization of an angle, differenced from sample to sample; well below the rate the square of the frequency.
        let bend = |f: f64| (std::f64::consts::PI * f * dt_s).sin().powi(2);
        means.push(Mean {
            from_hz: (first as f64 - 0.5) * welch.df_hz,
            to_hz: (to as f64 + 0.5) * welch.df_hz,
            density: bins.iter().map(|k| welch.power[*k]).sum::<f64>() / n,
            // Segments that overlap by half share 1/6 of the variance of a band; the bins of one, less at the ends of a band.
            dof: welch.dof * n / (BIN_OVERLAP * (1.0 - 0.5 / n) + 2.0 / 6.0),
            basis: [
                1.0,
                mean(&|f| 1.0 / f),
                mean(&|f| 1.0 / (f * f)),
                mean(&bend),
            ],
        });
    }
    means
}

/// The models of a part of the spectrum; `shortened`: higher frequencies were left out, and the bend remains of them.
fn fit(means: &[Mean], shortened: bool, z: f64) -> Option<White> {
    let mut models: Vec<Fitted> = (0..1usize << (TERMS - 1))
        .map(|set| (0..TERMS).filter(move |k| *k == 0 || set & (1 << (k - 1)) != 0))
        .map(Iterator::collect::<Vec<usize>>)
        .filter(|terms| !shortened || terms.contains(&BEND))
        .filter_map(|terms| solve(means, &terms))
        .collect();
    let cost = |m: &Fitted| m.deviance + TERM_DEVIANCE * m.terms.len() as f64;
    models.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    let best = models.first()?;
    let dof = (means.len() - best.terms.len()) as f64;
    if ChiSquared::new(dof).map_or(0.0, |c| c.sf(best.deviance)) < FITS {
        return None;
    }
    let top = means.last()?;
    if -best.a[BEND] * top.basis[BEND] > BENT * best.a[0] {
        return None;
    }
    let plausible =
        |m: &&Fitted| cost(m) <= cost(best) + PLAUSIBLE && m.deviance <= best.deviance + PLAUSIBLE;
    let (mut lower, mut upper) = (f64::INFINITY, 0.0f64);
    for model in models.iter().filter(plausible) {
        let sigma = model.variance.sqrt();
        lower = lower.min((model.a[0] - z * sigma).max(0.0));
        upper = upper.max(model.a[0] + z * sigma);
    }
    let slow = |m: &Mean| (1..BEND).map(|k| best.a[k] * m.basis[k]).sum::<f64>();
    let is_white = |m: &&Mean| {
        let other = slow(m) + best.a[BEND].max(0.0) * m.basis[BEND];
        other < best.a[0]
    };
    let white: Vec<&Mean> = means.iter().filter(is_white).collect();
    let seen =
        lower > 0.0 && best.a[0] > SEEN * best.variance.sqrt() && white.len() >= FEWEST_WHITE;
    let value = best.a[0].max(0.0).sqrt();
    Some(White {
        value,
        sigma: 0.5 * best.variance.sqrt() / value,
        interval: [lower.sqrt(), upper.sqrt()],
        band_hz: match (seen, white.first(), white.last()) {
            (true, Some(first), Some(last)) => Some([first.from_hz, last.to_hz]),
            _ => None,
        },
    })
}

/// Maximum likelihood of gamma-distributed means by iterated weights; `None` if a slow term would be negative.
fn solve(means: &[Mean], terms: &[usize]) -> Option<Fitted> {
    let n = means.len();
    let mut mu: Vec<f64> = means.iter().map(|m| m.density).collect();
    let mut a = [0.0; TERMS];
    let mut variance = f64::NAN;
    for _ in 0..30 {
        if mu.iter().any(|m| !(*m > 0.0)) {
            return None;
        }
        let weight = |i: usize| (0.5 * means[i].dof).sqrt() / mu[i];
        let mut matrix =
            DMatrix::from_fn(n, terms.len(), |i, k| means[i].basis[terms[k]] * weight(i));
        let scale: Vec<f64> = matrix.column_iter().map(|c| c.norm()).collect();
        for (mut column, s) in matrix.column_iter_mut().zip(&scale) {
            column /= *s;
        }
        let right = DVector::from_fn(n, |i, _| means[i].density * weight(i));
        let inverse = matrix.tr_mul(&matrix).cholesky()?.inverse();
        let solution = &inverse * matrix.tr_mul(&right);
        let before = a;
        for (k, term) in terms.iter().enumerate() {
            a[*term] = solution[k] / scale[k];
        }
        variance = inverse[(0, 0)] / (scale[0] * scale[0]);
        for (mu, mean) in mu.iter_mut().zip(means) {
            let next: f64 = a.iter().zip(&mean.basis).map(|(a, b)| a * b).sum();
            // A step to zero or below is shortened.
            *mu = next.max(0.1 * *mu);
        }
        if (a[0] - before[0]).abs() < 1e-6 * variance.sqrt() {
            break;
        }
    }
    let allowed = terms.iter().all(|k| a[*k] > 0.0 || *k == BEND || *k == 0);
    let deviance = means.iter().zip(&mu).map(|(m, mu)| {
        let ratio = m.density / mu;
        m.dof * (ratio - 1.0 - ratio.ln())
    });
    (allowed && a[0].is_finite()).then(|| Fitted {
        terms: terms.to_vec(),
        a,
        variance,
        deviance: deviance.sum(),
    })
}
