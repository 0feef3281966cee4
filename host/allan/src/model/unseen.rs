//! Bounds for a term that a record does not show.

use super::covariance::Covariances;
use super::differences::Differences;
use super::estimate::{Curve, Fitted};
use super::estimator::{Estimator, points};
use super::selection::{SEEN, Selection};
use super::terms::{Reason, Term, Unseen};

impl Estimator {
    /// Upper end of the interval of a `term` that is not shown, and why.
    pub(super) fn unseen(&self, selection: &Selection, term: Term, instead: Vec<Term>) -> Unseen {
        let (k, curve, excess) = (term as usize, &selection.curve, selection.excess);
        let upper = |model: &Fitted| match model.terms.contains(&k) {
            true => curve.end(model, k, -self.z, excess),
            false => curve.end(&curve.beside(model, k)?, k, -self.z, excess),
        };
        let ends = selection.plausible().into_iter().filter_map(upper);
        let Some(most) = ends.reduce(f64::max) else {
            return Unseen {
                at_most: None,
                why: Reason::Small {
                    instead,
                    longer_s: None,
                },
            };
        };
        // A longer record only adds long times.
        let longer_s = match (term, selection.without(term)) {
            (Term::Q | Term::N, _) | (_, None) => None,
            // A quarter of the variance, which is half the coefficient.
            (_, Some(without)) => self.longer_s(curve, without, k, 0.25 * most, excess),
        };
        Unseen {
            at_most: Some(term.coefficient(most, self.dt_s)),
            why: Reason::Small { instead, longer_s },
        }
    }

    /// Additional length that the record of `curve` needs for a term of amplitude `a`, in addition to those of `without`, to reach [`SEEN`]
    /// sigmas, s.
    fn longer_s(
        &self,
        curve: &Curve,
        without: &Fitted,
        term: usize,
        a: f64,
        excess: f64,
    ) -> Option<f64> {
        let longer = self.longer.get_or_init(|| {
            let table = |factor| {
                let samples = factor * self.samples;
                Covariances::new(points(samples), samples)
            };
            [2, 4, 8].map(table).into()
        });
        let sigmas = |covariances: &Covariances| {
            // Times that are too short for the model remain so.
            let used = |d: &&Differences| d.m as f64 >= curve.shortest();
            let curve = Curve {
                y: Vec::new(),
                range: 0..covariances.points().iter().take_while(used).count(),
                covariances,
            };
            Some(a / (excess.sqrt() * curve.error_of(without, term, a)?))
        };
        let mut before = (1.0, sigmas(&self.covariances)?);
        let mut slope: f64 = 0.5;
        for (i, covariances) in longer.iter().enumerate() {
            let now = sigmas(covariances)?;
            slope = (now / before.1).log2().max(0.1);
            if now >= SEEN {
                break;
            }
            before = (f64::from(2u32 << i), now);
        }
        let factor = before.0 * (SEEN / before.1).powf(1.0 / slope);
        Some((factor - 1.0) * self.samples as f64 * self.dt_s).filter(|s| *s > 0.0)
    }
}
