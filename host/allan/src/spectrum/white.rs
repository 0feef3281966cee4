//! N from the band in which a spectrum is flat.
//!
//! An Allan curve shows white noise where it falls as 1/√τ. Behind a slow filter, or above a strong flicker noise, it hardly does. The
//! spectrum resolves every frequency, and is still flat in between.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::lines::{Line, Lines};
use super::welch::Welch;
use crate::gamma::{GammaFit, MeanSquare, sets};
use crate::model::PLAUSIBLE;

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
    of: MeanSquare<TERMS>,
}

impl Lines {
    /// N from the band in which the spectrum of the series (samples `dt_s` apart) is white, with an interval of probability `confidence`. The bands of the
    /// lines are excluded, and as much on both sides of each: the slopes of a bump would pass for flicker noise there. `None` if the spectrum fits such
    /// noise in no band, or the series is too short.
    pub fn white_band(&self, dt_s: f64, confidence: f64) -> Option<White> {
        of_spectrum(self.spectrum()?, dt_s, &self.lines, confidence)
    }
}

/// As [`Lines::white_band`]; `welch` has the spectrum.
fn of_spectrum(welch: &Welch, dt_s: f64, lines: &[Line], confidence: f64) -> Option<White> {
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
        let mean = |of: &dyn Fn(f64) -> f64| {
            let all = bins.iter().map(|k| of(hz(*k)));
            all.sum::<f64>() / bins.len() as f64
        };
        // Quantization of an angle, differenced from sample to sample; well below the rate the square of the frequency.
        let bend = |f: f64| (std::f64::consts::PI * f * dt_s).sin().powi(2);
        let (value, dof) = welch.mean(&bins);
        means.push(Mean {
            from_hz: (first as f64 - 0.5) * welch.df_hz,
            to_hz: (to as f64 + 0.5) * welch.df_hz,
            of: MeanSquare {
                value,
                dof,
                basis: [
                    1.0,
                    mean(&|f| 1.0 / f),
                    mean(&|f| 1.0 / (f * f)),
                    mean(&bend),
                ],
            },
        });
    }
    means
}

/// The models of a part of the spectrum; `shortened`: higher frequencies were left out, and the bend remains of them.
fn fit(means: &[Mean], shortened: bool, z: f64) -> Option<White> {
    let squares: Vec<MeanSquare<TERMS>> = means.iter().map(|m| m.of).collect();
    let mut models: Vec<GammaFit<TERMS>> = sets(TERMS)
        .filter(|terms| terms[0] == 0 && (!shortened || terms.contains(&BEND)))
        .filter_map(|terms| GammaFit::of(&squares, terms))
        // Slow terms are not negative.
        .filter(|fitted| (1..BEND).all(|k| fitted.coefficients[k] >= 0.0))
        .collect();
    models.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
    let best = models.first()?;
    let dof = (means.len() - best.terms.len()) as f64;
    if ChiSquared::new(dof).map_or(0.0, |c| c.sf(best.deviance)) < FITS {
        return None;
    }
    let top = means.last()?;
    if -best.coefficients[BEND] * top.of.basis[BEND] > BENT * best.coefficients[0] {
        return None;
    }
    let plausible = |m: &&GammaFit<TERMS>| {
        m.cost() <= best.cost() + PLAUSIBLE && m.deviance <= best.deviance + PLAUSIBLE
    };
    let (mut lower, mut upper) = (f64::INFINITY, 0.0f64);
    for model in models.iter().filter(plausible) {
        let sigma = model.variance.sqrt();
        lower = lower.min((model.coefficients[0] - z * sigma).max(0.0));
        upper = upper.max(model.coefficients[0] + z * sigma);
    }
    let slow = |m: &Mean| {
        (1..BEND)
            .map(|k| best.coefficients[k] * m.of.basis[k])
            .sum::<f64>()
    };
    let is_white = |m: &&Mean| {
        let other = slow(m) + best.coefficients[BEND].max(0.0) * m.of.basis[BEND];
        other < best.coefficients[0]
    };
    let white: Vec<&Mean> = means.iter().filter(is_white).collect();
    let seen = lower > 0.0
        && best.coefficients[0] > SEEN * best.variance.sqrt()
        && white.len() >= FEWEST_WHITE;
    let value = best.coefficients[0].max(0.0).sqrt();
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
