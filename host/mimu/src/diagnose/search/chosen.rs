//! Candidates as parts of a model, and how good each is.

use nalgebra::DMatrix;
use serde::Serialize;

use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;

/// A candidate as part of a model.
#[derive(Debug, Clone, Serialize)]
pub struct Chosen {
    /// Which.
    #[serde(skip)]
    pub candidate: Candidate,
    /// Value of its nonlinear constant, 0 if it has none.
    #[serde(skip)]
    pub parameter: f64,
    /// Its columns.
    #[serde(skip)]
    pub columns: DMatrix<f64>,
    /// Probability of chance, after the whole search.
    #[serde(rename = "chance")]
    pub p: f64,
    /// By how much the deviance grows without it.
    #[serde(skip)]
    pub drop: f64,
    /// By how much the sizes of its coefficients speak against it, in units of the deviance.
    #[serde(skip)]
    pub unlikely: f64,
    /// Others that would do nearly as well in its place.
    pub alternatives: Vec<Alternative>,
}

impl Chosen {
    /// The true input, such as Earth rate, that would do nearly as well in its place.
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

/// A candidate that would do nearly as well in the place of another.
#[derive(Debug, Clone, Serialize)]
pub struct Alternative {
    /// Public id.
    pub id: String,
    /// What it is.
    #[serde(skip)]
    pub kind: CandidateKind,
    /// By how much its score is worse.
    pub score_worse_by: f64,
}

impl Alternative {
    /// A candidate whose score is worse by `score_worse_by`.
    pub fn of(candidate: &Candidate, score_worse_by: f64) -> Self {
        Self {
            id: candidate.id(),
            kind: candidate.kind.clone(),
            score_worse_by,
        }
    }
}

impl From<(&'static Effect, f64)> for Alternative {
    fn from((effect, score_worse_by): (&'static Effect, f64)) -> Self {
        Self {
            id: effect.id.into(),
            kind: CandidateKind::Effect(effect),
            score_worse_by,
        }
    }
}

/// How good a candidate is among others with more or fewer coefficients: the drop of the deviance less what each coefficient
/// costs (Akaike's two, doubled, as for each there are several candidates), and what speaks against their sizes. Of products that are the
/// same in this recording the shortest is told.
///
/// A nonlinear parameter costs two coefficients. It has a limit, as a time constant that is infinite is a straight line, and should be
/// told from it by two sigmas.
pub(super) fn score(c: &Chosen) -> f64 {
    let coefficients = c.columns.ncols() as f64 + if c.parameter > 0.0 { 2.0 } else { 0.0 };
    let order = match &c.candidate.kind {
        CandidateKind::Term(_, product) => f64::from(product.order()),
        _ => 0.0,
    };
    c.drop - price(&c.candidate) * coefficients - order - c.unlikely
}

/// What a coefficient costs.
pub const COEFFICIENT: f64 = 4.0;

/// The same of a candidate. Where no bit of a code would be seen at the size of data sheets, the search is among up to 36, and the best of
/// so many nothings is worth 7.
pub(super) fn price(candidate: &Candidate) -> f64 {
    match candidate.reads_code() && candidate.excited.is_empty() {
        true => COEFFICIENT + 2.0 * (candidate.offered.len().max(1) as f64).ln(),
        false => COEFFICIENT,
    }
}
