//! From the curves of a record to its noise model.

use std::sync::OnceLock;

use statrs::distribution::{ContinuousCDF, Normal};

use super::covariance::Covariances;
use super::differences::Differences;
use super::estimate::Curve;
use super::selection::{FEWEST, SEEN, Selection};
use super::terms::{Coefficient, NoiseModel, Reason, Term, Unseen};
use crate::{Deviation, Point};

/// Ratio of third to second differences that are only rounding errors.
const ROUNDING: f64 = 1e-6;

/// Fits models to the curves of one record: several channels have the same times, and so the same covariances.
pub struct Estimator {
    pub(super) samples: usize,
    pub(super) dt_s: f64,
    /// Normal deviate of the upper end of an interval.
    pub(super) z: f64,
    pub(super) covariances: Covariances,
    /// For records two, four and eight times as long.
    pub(super) longer: OnceLock<Vec<Covariances>>,
}

/// Averaging factors of the Allan curve that a model is fitted to: octaves up to a quarter of the record, and half of it.
///
/// Times between the octaves would repeat their information, because every difference series contains every sample: they would only make
/// the covariance of the points nearly singular. Half of the record gives a single difference, but the only one over the whole record: the
/// squares of shorter ones do not distinguish a ramp from a random walk that goes and returns. Of 1000 weak ramps ("N, weak R" in
/// `tests/all/model.rs`) 457 were found with it and 35 without.
pub fn allan_factors(samples: usize) -> Vec<usize> {
    octaves(samples)
        .chain((samples >= 4).then_some(samples / 2))
        .collect()
}

/// Averaging factors of the Hadamard curve that a model is also fitted to: the three longest octaves that fit six times into the record.
///
/// They contain all terms except the ramp. Without them 376 of the same ramps were found. Of 1000 weak random walks ("N, weak K") 384 were
/// found without them, and 431 with them.
pub fn hadamard_factors(samples: usize) -> Vec<usize> {
    let mut all: Vec<usize> = octaves(samples).filter(|m| 6 * m <= samples).collect();
    all.split_off(all.len().saturating_sub(3))
}

fn octaves(samples: usize) -> impl Iterator<Item = usize> {
    (0..usize::BITS - 3)
        .map(|k| 1 << k)
        .take_while(move |m| 4 * m <= samples)
}

/// Points that a model is fitted to, the longest of each curve first.
pub(super) fn points(samples: usize) -> Vec<Differences> {
    let over = |kind| move |m| Differences { kind, m };
    let third = hadamard_factors(samples).into_iter().rev();
    let second = allan_factors(samples).into_iter().rev();
    third
        .map(over(Deviation::Hadamard))
        .chain(second.map(over(Deviation::Allan)))
        .collect()
}

impl Estimator {
    /// For records of `samples` at steps of `dt_s`, with intervals of probability `confidence`.
    pub fn new(samples: usize, dt_s: f64, confidence: f64) -> Self {
        Self {
            covariances: Covariances::new(points(samples), samples),
            z: Normal::standard().inverse_cdf(0.5 + 0.5 * confidence),
            samples,
            dt_s,
            longer: OnceLock::new(),
        }
    }

    /// Fits a model to an overlapping Allan curve that has the points of [`allan_factors`] and a Hadamard curve that has those of
    /// [`hadamard_factors`].
    ///
    /// `None` if the Allan curve has fewer than six such points above zero.
    pub fn fit(&self, allan: &[Point], hadamard: &[Point]) -> Option<NoiseModel> {
        let at = |curve: &[Point], m| {
            let found = curve.binary_search_by_key(&m, |p| p.m).ok();
            found.map(|i| curve[i].deviation)
        };
        let mut whole = Curve {
            y: Vec::new(),
            range: 0..0,
            covariances: &self.covariances,
        };
        for (index, point) in self.covariances.points().iter().enumerate() {
            let second = at(allan, point.m)?;
            let deviation = match point.kind {
                Deviation::Hadamard => at(hadamard, point.m)?,
                Deviation::Allan | Deviation::Modified => second,
            };
            match point.kind {
                // The third differences of a ramp without noise are rounding errors.
                Deviation::Hadamard if !(deviation > ROUNDING * second) => {
                    whole.y.clear();
                    whole.range.start = index + 1;
                }
                _ if !(deviation > 0.0) => break,
                _ => whole.y.push(deviation.powi(2)),
            }
            whole.range.end = index + 1;
        }
        if whole.allan_points() < FEWEST {
            return None;
        }
        let shortest = (whole.shortest(), *whole.y.last()?);
        let selection = Selection::of(whole)?;
        let filtered = selection.filtered(shortest);
        let (curve, best) = (&selection.curve, selection.best());
        let coefficients = Term::ALL.map(|term| {
            if term == Term::Q && (filtered || selection.shortened) {
                let why = match filtered {
                    true => Reason::Filtered,
                    false => Reason::Hidden,
                };
                return Err(Unseen { at_most: None, why });
            }
            let instead = selection.instead_of(term);
            // A term of a model that does not fit may only compensate the misfit.
            let k = term as usize;
            let misfit = selection.excess.sqrt() * best.sigma(k);
            let shown = selection.excess == 1.0 || best.a[k] > SEEN * misfit;
            if best.a[k] > 0.0 && instead.is_empty() && shown {
                return Ok(self.coefficient(&selection, term));
            }
            Err(self.unseen(&selection, term, instead))
        });
        Some(NoiseModel {
            coefficients,
            filtered,
            range_s: [curve.shortest(), curve.longest()].map(|m| m * self.dt_s),
            excess: (selection.excess > 1.0).then_some(selection.excess),
            amplitudes: best.a,
            dt_s: self.dt_s,
        })
    }

    fn coefficient(&self, selection: &Selection, term: Term) -> Coefficient {
        let (k, curve, excess) = (term as usize, &selection.curve, selection.excess);
        let best = selection.best();
        let of = |a: f64| term.coefficient(a, self.dt_s);
        let value = of(best.a[k]);
        let sigma = excess.sqrt() * best.sigma(k);
        let (mut lower, mut upper) = (best.a[k], best.a[k]);
        for model in selection.plausible() {
            if model.a[k] > 0.0 {
                lower = lower.min(curve.end(model, k, self.z, excess).unwrap_or(0.0));
                let end = curve.end(model, k, -self.z, excess);
                upper = upper.max(end.unwrap_or(f64::INFINITY));
            }
        }
        Coefficient {
            value,
            sigma: 0.5 * value * sigma / best.a[k],
            lower: of(lower),
            upper: of(upper),
        }
    }
}
