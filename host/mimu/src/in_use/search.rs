//! The most likely variances, and the ranges that the likelihood leaves them.

use super::likelihood::{Model, Session};

/// Logarithms of a value between which it is searched, in its unit.
const RANGE: [f64; 2] = [-9.0, 18.0];
/// Coordinates are searched in turn until a round gains less than this in log-likelihood.
const GAIN: f64 = 0.01;
const ROUNDS: usize = 10;
/// Half of the 95 % quantile of chi-square of one degree of freedom; and of a variance that is 0 in truth, whose deviance is 0 in every other
/// recording (Self and Liang 1987).
const HALF_DEVIANCE: f64 = 1.920_729;
const HALF_DEVIANCE_AT_0: f64 = 1.352_772;
/// Steps of a search over the whole range, and the step of a local one.
const COARSE: u32 = 12;
const LOCAL: f64 = 0.5;

/// A model with its log-likelihood.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub model: Model,
    pub log_likelihood: f64,
}

/// Fits variances of a session to the segments that `counts` accepts.
pub(super) struct Search<'a, F: Fn(usize) -> bool + Sync> {
    pub session: &'a Session,
    pub counts: F,
}

impl<F: Fn(usize) -> bool + Sync> Search<'_, F> {
    fn at(&self, model: &Model) -> f64 {
        let value = self.session.log_likelihood(model, &self.counts);
        value.unwrap_or(f64::NEG_INFINITY)
    }

    /// The likelihood of `model` as it is.
    pub fn fitted(&self, model: Model) -> Fitted {
        let log_likelihood = self.at(&model);
        Fitted {
            model,
            log_likelihood,
        }
    }

    /// The most likely values of `free`, from those of `start`.
    pub fn maximise(&self, start: Fitted, free: &[usize]) -> Fitted {
        let mut best = start;
        for round in 0..ROUNDS {
            let before = best.log_likelihood;
            for &k in free {
                best = self.along(best, k, round > 0);
            }
            if best.log_likelihood - before < GAIN {
                break;
            }
        }
        best
    }

    /// The same, searched only near `start`.
    fn maximise_near(&self, start: Fitted, free: &[usize]) -> Fitted {
        let mut best = start;
        for _ in 0..4 {
            let before = best.log_likelihood;
            for &k in free {
                best = self.along(best, k, true);
            }
            if best.log_likelihood - before < 0.1 {
                break;
            }
        }
        best
    }

    /// The most likely value of component `k`, with the others as they are; if `near`, only around the present one, unless that is 0.
    pub fn along(&self, mut best: Fitted, k: usize, near: bool) -> Fitted {
        let now = best.model.values[k];
        let near = (near && now > 0.0).then(|| now.ln());
        let mut try_value = |value: f64| {
            let mut model = best.model.clone();
            model.values[k] = value.min(self.session.components[k].most);
            let log_likelihood = self.at(&model);
            if log_likelihood > best.log_likelihood {
                best = Fitted {
                    model,
                    log_likelihood,
                };
            }
            log_likelihood
        };
        try_value(0.0);
        look_for_best(&mut try_value, near);
        best
    }

    /// The 95 % range of component `k`: the values whose likelihood, with `free` fitted to each, is near the largest.
    pub fn range(&self, best: &Fitted, k: usize, free: &[usize]) -> [f64; 2] {
        let others: Vec<usize> = free.iter().copied().filter(|j| *j != k).collect();
        let fall = |value: f64| {
            let mut model = best.model.clone();
            model.values[k] = value;
            let profile = self.maximise_near(self.fitted(model), &others);
            best.log_likelihood - profile.log_likelihood
        };
        let falls = |value: f64| fall(value) > HALF_DEVIANCE;
        let middle = best.model.values[k].max(RANGE[0].exp());
        let lower = match best.model.values[k] <= RANGE[0].exp() || fall(0.0) < HALF_DEVIANCE_AT_0 {
            true => 0.0,
            false => edge(RANGE[0], middle.ln(), |v| !falls(v)),
        };
        [lower, edge(RANGE[1], middle.ln(), |v| !falls(v))]
    }
}

/// The value between the logarithm `outside`, which is unlikely, and `inside`, where `likely` ends.
fn edge(outside: f64, inside: f64, likely: impl Fn(f64) -> bool) -> f64 {
    let toward = if outside > inside { 1.0 } else { -1.0 };
    let (mut inner, mut step) = (inside, 0.5 * toward);
    let mut outer = loop {
        let next = inner + step;
        if (next - outside) * toward >= 0.0 {
            break outside;
        }
        if !likely(next.exp()) {
            break next;
        }
        (inner, step) = (next, step * 2.0);
    };
    for _ in 0..4 {
        let middle = 0.5 * (inner + outer);
        match likely(middle.exp()) {
            true => inner = middle,
            false => outer = middle,
        }
    }
    (0.5 * (inner + outer)).exp()
}

/// Looks for the largest of `of` over logarithms: coarsely over [`RANGE`], then by parabolas about the best, or only about `near`.
///
/// A likelihood is nearly a parabola of the logarithm of a variance, so golden sections would need four times as many evaluations.
fn look_for_best(of: &mut impl FnMut(f64) -> f64, near: Option<f64>) {
    if let Some(near) = near {
        let at = of(near.exp());
        vertex(of, (near, at), LOCAL);
        return;
    }
    let step = (RANGE[1] - RANGE[0]) / f64::from(COARSE);
    let mut best = (RANGE[0], f64::NEG_INFINITY);
    for k in 0..=COARSE {
        let x = RANGE[0] + step * f64::from(k);
        let y = of(x.exp());
        if y > best.1 {
            best = (x, y);
        }
    }
    let closer = vertex(of, best, 0.5 * step);
    vertex(of, closer, 0.2 * step);
}

/// The best of `at`, two points `step` beside it, and the vertex of the parabola through them, at most two steps away.
fn vertex(of: &mut impl FnMut(f64) -> f64, at: (f64, f64), step: f64) -> (f64, f64) {
    let (x, y) = at;
    let (below, above) = (of((x - step).exp()), of((x + step).exp()));
    let bend = below + above - 2.0 * y;
    let along = match bend < 0.0 {
        true => (0.5 * (below - above) / bend).clamp(-2.0, 2.0),
        false => (above - below).signum() * 2.0,
    };
    let top = x + along * step;
    let all = [
        at,
        (x - step, below),
        (x + step, above),
        (top, of(top.exp())),
    ];
    let better = |a: (f64, f64), b: (f64, f64)| if b.1 > a.1 { b } else { a };
    all.into_iter().fold(at, better)
}
