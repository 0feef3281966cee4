//! Candidates as parts of a model, and their scores.

use nalgebra::DMatrix;
use serde::Serialize;

use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;

/// A candidate as part of a model.
#[derive(Debug, Clone, Serialize)]
pub struct Chosen {
    /// The candidate.
    #[serde(skip)]
    pub candidate: Candidate,
    /// Value of its nonlinear parameter, 0 if it has none.
    #[serde(skip)]
    pub parameter: f64,
    /// Its columns.
    #[serde(skip)]
    pub columns: DMatrix<f64>,
    /// Probability by chance, corrected for the number of tests.
    #[serde(rename = "chance")]
    pub p: f64,
    /// By how much the deviance grows without it.
    #[serde(skip)]
    pub drop: f64,
    /// Standard deviation that its coefficients have before the rows are seen, SI; `None` if nothing is assumed. The three axes of a nonlinearity stay
    /// together, and one that the rows hardly show is as large as the others may be.
    #[serde(skip)]
    pub size: Option<f64>,
    /// Penalty for implausible sizes of its coefficients, in units of the deviance.
    #[serde(skip)]
    pub unlikely: f64,
    /// Other candidates that would explain the rows nearly as well in its place.
    pub alternatives: Vec<Alternative>,
}

impl Chosen {
    /// The true input, such as Earth rate, that would explain the rows nearly as well in its place.
    pub fn or_true_input(&self) -> Option<&'static Effect> {
        let alternatives = self.alternatives.iter();
        let effects = alternatives.filter_map(|a| match a.kind {
            CandidateKind::Effect(effect) => Some(effect),
            _ => None,
        });
        let mut inputs = effects.filter(|e| !e.is_error());
        inputs.next().filter(|_| self.candidate.is_error())
    }
}

/// The others of `all`.
pub(in crate::diagnose) fn without(all: &[Chosen], k: usize) -> Vec<Chosen> {
    [&all[..k], &all[k + 1..]].concat()
}

/// A candidate that would explain the rows nearly as well in the place of another.
#[derive(Debug, Clone, Serialize)]
pub struct Alternative {
    /// Public id.
    pub id: String,
    /// What it is.
    #[serde(skip)]
    pub kind: CandidateKind,
    /// How much lower its score is.
    pub score_worse_by: f64,
}

impl Alternative {
    /// A candidate whose score is lower by `score_worse_by`.
    pub fn of(candidate: &Candidate, score_worse_by: f64) -> Self {
        Self {
            id: candidate.id(),
            kind: candidate.kind.clone(),
            score_worse_by,
        }
    }
}

/// Score of a candidate: the drop in deviance, minus a cost for each coefficient (Akaike's two, doubled, because each is one of several
/// candidates), minus the penalty for implausible sizes. Products also cost their order: of those that are equal in this recording, the
/// shortest wins.
///
/// A nonlinear parameter costs two coefficients. It has a limit: an infinite time constant, for example, is a straight line. The effect
/// should differ from that limit by two sigmas.
pub(super) fn score(c: &Chosen) -> f64 {
    let coefficients = c.columns.ncols() as f64 + if c.parameter > 0.0 { 2.0 } else { 0.0 };
    let order = match &c.candidate.kind {
        CandidateKind::Term(_, product) => f64::from(product.order()),
        _ => 0.0,
    };
    c.drop - COEFFICIENT * coefficients - order - c.unlikely
}

/// What a coefficient costs.
pub const COEFFICIENT: f64 = 4.0;
