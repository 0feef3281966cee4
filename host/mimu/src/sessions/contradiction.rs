//! Sessions that contradict the others, steps between two sessions, and parameters that drift from session to session.
//!
//! All three are judged by how improbable they are without: of a session, given what the others predict; of the difference of the sessions before and after;
//! of a slope. Errors that the fits share are decorrelated first. Each has the tails of Student's distribution that the few sessions give it, and is converted to
//! a normal variable, so that the sum of squares over the parameters has a chi-square distribution. Biases are judged apart, each for itself: a temperature
//! moves them together.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use super::between::{Between, Design, Estimates, Kinds, VariancePrior, fit, fit_ageing};
use super::mixture::Mixture;

/// Probability of a false finding in a set of sessions.
pub const FALSE_FINDING: f64 = 0.01;
/// Sessions from which a step is sought: two on each side, for their scatter.
const LEAST_FOR_STEP: usize = 4;
/// Sessions from which a drift is sought.
const LEAST_FOR_DRIFT: usize = 5;

/// Estimates of one triad in the sessions that have it, for the free parameters.
#[derive(Debug, Clone)]
pub struct Triads {
    /// Number of each session, and its estimates.
    pub sessions: Vec<(usize, Estimates)>,
    /// Whether a parameter is a bias.
    pub bias: Vec<bool>,
    /// Kinds of the parameters.
    pub kinds: Kinds,
    /// Prior of each parameter, where two sessions or fewer are fitted.
    pub priors: Vec<VariancePrior>,
}

/// What does not fit one set of constant parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What it is.
    pub kind: Kind,
    /// Its probability without such a cause, all of this kind that were tried considered.
    pub p: f64,
    /// The parameter that shows it most: triad, and number in it.
    pub most: (usize, usize),
    /// Its change.
    pub change: f64,
}

/// Kinds of findings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// This session differs from the others.
    Session(usize),
    /// The sessions from this one on differ from those before.
    Step(usize),
    /// Parameters change steadily from session to session.
    Drift,
    /// Parameters change from each session to the next, by no step.
    Walk,
}

impl Kind {
    /// Renumbers the sessions from `s` on, because another one takes this number.
    pub(super) fn make_room(&mut self, s: usize) {
        if let Self::Session(k) | Self::Step(k) = self {
            *k += usize::from(*k >= s);
        }
    }
}

impl Triads {
    /// Those of the sessions for which `keep` holds.
    pub fn of(&self, keep: impl Fn(usize) -> bool) -> Self {
        let sessions = self.sessions.iter().filter(|(s, _)| keep(*s)).cloned();
        Self {
            sessions: sessions.collect(),
            ..self.clone()
        }
    }

    /// The model of parameters that age, and of those that drift with the number of the session.
    pub fn fitted(&self, drifting: &[usize], next: f64) -> Option<Between> {
        let estimates = self.estimates();
        let mut numbers: Vec<f64> = self.sessions.iter().map(|(s, _)| *s as f64).collect();
        if numbers.len() < LEAST_FOR_DRIFT {
            // A few sessions do not show which way a unit ages: it adds to the intervals, and does not move the values.
            let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
            numbers.fill(mean);
        }
        let numbers = (&numbers[..], next);
        fit_ageing(
            &estimates,
            numbers,
            drifting,
            &self.kinds,
            self.priors_if_few(),
        )
    }

    fn estimates(&self) -> Vec<Estimates> {
        self.sessions.iter().map(|(_, e)| e.clone()).collect()
    }

    /// Priors replace what one or two sessions cannot show.
    pub fn priors_if_few(&self) -> Option<&[VariancePrior]> {
        (self.sessions.len() <= 2).then_some(&self.priors[..])
    }

    /// Slopes of all parameters by a covariate of the sessions.
    fn slopes(&self, of: impl Fn(usize) -> f64) -> Option<Between> {
        let all: Vec<usize> = (0..self.bias.len()).collect();
        let covariate: Vec<f64> = self.sessions.iter().map(|(s, _)| of(*s)).collect();
        let estimates = self.estimates();
        let design = Design::constant(all.len(), estimates.len(), &all, (&covariate, 1.0));
        fit(&estimates, &design, &self.kinds, None)
    }
}

/// A standardised change of each parameter of a triad.
struct Changes {
    /// As normal variables.
    normal: Vec<f64>,
    /// Changes in their units.
    change: Vec<f64>,
}

/// Changes with these distributions if there is none, and with this covariance between them.
fn changes(change: &DVector<f64>, without: &[Mixture], covariance: &DMatrix<f64>) -> Changes {
    let matched: Vec<_> = without.iter().map(Mixture::matched).collect();
    let n = change.len();
    let full = DMatrix::from_fn(n, n, |i, j| match i == j {
        true => matched[i].variance,
        false => covariance[(i, j)],
    });
    let diagonal = || DMatrix::from_diagonal(&full.diagonal());
    let factor = full.clone().cholesky().or_else(|| diagonal().cholesky());
    let white = factor.and_then(|f| f.l().solve_lower_triangular(change));
    let normal = Normal::standard();
    let of = |(e, m): (&f64, &super::mixture::Matched)| {
        let tail = match m.dof.is_finite() {
            true => StudentsT::new(0.0, 1.0, m.dof).map_or(1.0, |t| t.sf(e.abs())),
            false => normal.sf(e.abs()),
        };
        -normal.inverse_cdf(tail.clamp(1e-300, 0.5))
    };
    let white = white.unwrap_or_else(|| DVector::zeros(n));
    Changes {
        normal: white.iter().zip(&matched).map(of).collect(),
        change: change.iter().copied().collect(),
    }
}

/// Probability of the changes of all triads without a cause, the parameter that shows it most, and its change.
fn judged(all: &[(Changes, &[bool])], biases: bool) -> (f64, (usize, usize), f64) {
    let each = || {
        let triads = all.iter().enumerate();
        triads.flat_map(|(t, (c, bias))| {
            let each = c.normal.iter().zip(*bias).enumerate();
            let each = each.filter(move |(_, (_, bias))| biases || !**bias);
            each.map(move |(i, (z, bias))| ((t, i), *z, *bias, c.change[i]))
        })
    };
    let two_sided = |z: f64| 2.0 * Normal::standard().sf(z);
    let fixed = each().filter(|e| !e.2);
    let (count, sum) = fixed.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e.1 * e.1));
    let of_shape = ChiSquared::new(count).map_or(1.0, |d| d.sf(sum));
    let count_of_biases = each().filter(|e| e.2).count() as f64;
    let largest = each().filter(|e| e.2).map(|e| e.1).fold(0.0, f64::max);
    let of_bias = match count_of_biases > 0.0 {
        true => (count_of_biases * two_sided(largest)).min(1.0),
        false => 1.0,
    };
    let by_bias = of_bias < of_shape;
    let most = each().filter(|e| e.2 == by_bias);
    let most = most.max_by(|a, b| a.1.total_cmp(&b.1));
    let (most, change) = most.map_or(((0, 0), 0.0), |e| (e.0, e.3));
    ((2.0 * of_shape.min(of_bias)).min(1.0), most, change)
}

/// How improbable session `s` is, given the others.
pub fn session(triads: &[Triads], s: usize, biases: bool) -> Option<Finding> {
    let mut all = Vec::new();
    for triad in triads {
        let own = triad.sessions.iter().find(|(k, _)| *k == s);
        let others = triad.of(|k| k != s);
        let Some((_, own)) = own.filter(|_| !others.sessions.is_empty()) else {
            all.push((empty(), &triad.bias[..0]));
            continue;
        };
        let model = others.fitted(&[], s as f64)?;
        let n = own.values.len();
        let change = DVector::from_fn(n, |i, _| own.values[i] - model.parameters[i].next.mean());
        let without = (0..n).map(|i| model.parameters[i].next.plus(own.covariance[(i, i)]));
        let without: Vec<Mixture> = without.collect();
        let covariance = &own.covariance + &model.expected;
        all.push((changes(&change, &without, &covariance), &triad.bias[..]));
    }
    let (p, most, change) = judged(&all, biases);
    Some(Finding {
        kind: Kind::Session(s),
        p,
        most,
        change,
    })
}

fn empty() -> Changes {
    Changes {
        normal: Vec::new(),
        change: Vec::new(),
    }
}

/// How improbable the difference is between the sessions from `first` on and those before.
fn step(triads: &[Triads], first: usize, biases: bool) -> Option<Finding> {
    let mut all = Vec::new();
    for triad in triads {
        let after = triad.sessions.iter().filter(|(s, _)| *s >= first).count();
        if after < 2 || triad.sessions.len() < after + 2 {
            all.push((empty(), &triad.bias[..0]));
            continue;
        }
        let model = triad.slopes(|s| f64::from(u8::from(s >= first)))?;
        let n = triad.bias.len();
        let change = DVector::from_fn(n, |i, _| model.slopes[i].mean());
        let covariance = model.covariance.view((n, n), (n, n)).into_owned();
        all.push((
            changes(&change, &model.slopes, &covariance),
            &triad.bias[..],
        ));
    }
    let (p, most, change) = judged(&all, biases);
    Some(Finding {
        kind: Kind::Step(first),
        p,
        most,
        change,
    })
}

/// For each triad the parameters that drift with the number of the session; and the most significant finding.
pub fn drift(triads: &[Triads], sessions: &[usize]) -> Option<(Finding, Vec<Vec<usize>>)> {
    if sessions.len() < LEAST_FOR_DRIFT {
        return None;
    }
    let mut all = Vec::new();
    for (t, triad) in triads.iter().enumerate() {
        if triad.sessions.len() < LEAST_FOR_DRIFT {
            continue;
        }
        let model = triad.slopes(|s| s as f64)?;
        for (i, slope) in model.slopes.iter().enumerate() {
            let mean = slope.mean();
            all.push(((t, i), slope.beyond(mean, mean.abs()), mean));
        }
    }
    let count = all.len() as f64;
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (most, p, change) = *all.first()?;
    let named = all.iter().enumerate();
    // Holm: the least probable first.
    let named = named.take_while(|(rank, d)| d.1 < FALSE_FINDING / (count - *rank as f64));
    let mut drifting = vec![Vec::new(); triads.len()];
    for (_, ((t, i), ..)) in named {
        drifting[*t].push(*i);
    }
    let finding = Finding {
        kind: Kind::Drift,
        p: (count * p).min(1.0),
        most,
        change,
    };
    Some((finding, drifting))
}

/// The least probable session, and the least probable step, of `sessions`; their probabilities consider how many were tried. Without `biases`, which a
/// temperature moves together, only scale factors and angles count.
pub fn search(triads: &[Triads], sessions: &[usize], biases: bool) -> Vec<Finding> {
    let several = |tried: f64, found: Finding| Finding {
        p: (tried * found.p).min(1.0),
        ..found
    };
    let least = |all: Vec<Finding>| {
        let tried = all.len() as f64;
        let least = all.into_iter().min_by(|a, b| a.p.total_cmp(&b.p));
        least.map(|f| several(tried, f))
    };
    let each = sessions.iter().filter_map(|s| session(triads, *s, biases));
    let mut found: Vec<Finding> = least(each.collect()).into_iter().collect();
    if sessions.len() >= LEAST_FOR_STEP {
        let splits = &sessions[2..sessions.len() - 1];
        let each = splits
            .iter()
            .filter_map(|first| step(triads, *first, biases));
        found.extend(least(each.collect()));
    }
    found
}
