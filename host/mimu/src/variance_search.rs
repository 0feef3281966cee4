//! The most likely variances of independent components, and the ranges that the likelihood leaves them.
//!
//! A variance is zero or a logarithm on `RANGE`; the likelihood is maximised along one of them after the other.

/// Logarithms of a value between which it is searched, in its unit.
const RANGE: [f64; 2] = [-9.0, 18.0];
/// Coordinates are searched in turn until a round gains less than this in log-likelihood.
const GAIN: f64 = 0.01;
const ROUNDS: usize = 9;
/// Each search with smaller steps has steps this much smaller.
const FINER: f64 = 0.25;
/// Half of the 95 % quantile of chi-square of one degree of freedom; and of a variance that is 0 in truth, whose deviance is 0 in every other
/// recording (Self and Liang 1987).
const HALF_DEVIANCE: f64 = 1.920_729;
const HALF_DEVIANCE_AT_0: f64 = 1.352_772;
/// Rounds and gain of a search that need only tell likely from unlikely.
const NEARLY: (usize, f64) = (4, 0.1);
/// Steps of a search over the whole range, and the step of a local one.
const COARSE: u32 = 12;
pub const LOCAL: f64 = 0.5;

/// Variances with their log-likelihood.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Variances, each in its unit.
    pub values: Vec<f64>,
    /// Logarithm of the likelihood, without constants.
    pub log_likelihood: f64,
}

/// A likelihood of variances.
pub struct Search<F: Fn(&[f64]) -> Option<f64> + Sync> {
    /// Its logarithm, without constants; `None` where a covariance is singular.
    pub of: F,
    /// Largest value of each variance, in its unit.
    pub most: Vec<f64>,
    /// Smallest step in the logarithm of a variance: from [`LOCAL`] on, a maximum is known to a small part of its range.
    pub finest: f64,
}

impl<F: Fn(&[f64]) -> Option<f64> + Sync> Search<F> {
    /// The likelihood of `values`.
    pub fn fitted(&self, values: Vec<f64>) -> Fitted {
        Fitted {
            log_likelihood: (self.of)(&values).unwrap_or(f64::NEG_INFINITY),
            values,
        }
    }

    /// The most likely values of `free`, from those of `start`.
    pub fn maximise(&self, start: Fitted, free: &[usize]) -> Fitted {
        let before = start.log_likelihood;
        let mut best = free
            .iter()
            .fold(start, |best, k| self.along(best, *k, None));
        let mut step = match best.log_likelihood - before < GAIN {
            true => FINER * LOCAL,
            false => LOCAL,
        };
        while step >= self.finest {
            let gain = GAIN * (step / LOCAL).powi(2);
            best = self.ascend(best, free, step, (ROUNDS, gain));
            step *= FINER;
        }
        best
    }

    /// Searches near the present values by `step`, in at most so many rounds, until one gains less than the least.
    fn ascend(
        &self,
        mut best: Fitted,
        free: &[usize],
        step: f64,
        (rounds, least): (usize, f64),
    ) -> Fitted {
        for _ in 0..rounds {
            let before = best.log_likelihood;
            best = free
                .iter()
                .fold(best, |best, k| self.along(best, *k, Some(step)));
            if best.log_likelihood - before < least {
                break;
            }
        }
        best
    }

    /// The most likely value of variance `k`, with the given others; with a step `near`, only so far around the present one, unless that is 0.
    pub fn along(&self, mut best: Fitted, k: usize, near: Option<f64>) -> Fitted {
        let now = best.values[k];
        let near = near.filter(|_| now > 0.0).map(|step| (now.ln(), step));
        let mut try_value = |value: f64| {
            let mut values = best.values.clone();
            values[k] = value.min(self.most[k]);
            let tried = self.fitted(values);
            let log_likelihood = tried.log_likelihood;
            if log_likelihood > best.log_likelihood {
                best = tried;
            }
            log_likelihood
        };
        try_value(0.0);
        look_for_best(&mut try_value, near);
        best
    }

    /// The 95 % range of variance `k`: the values whose likelihood, with `free` fitted to each, is near the largest.
    pub fn range(&self, best: &Fitted, k: usize, free: &[usize]) -> [f64; 2] {
        let others: Vec<usize> = free.iter().copied().filter(|j| *j != k).collect();
        let fall = |value: f64| {
            let mut values = best.values.clone();
            values[k] = value;
            let profile = self.ascend(self.fitted(values), &others, LOCAL, NEARLY);
            best.log_likelihood - profile.log_likelihood
        };
        let falls = |value: f64| fall(value) > HALF_DEVIANCE;
        let middle = best.values[k].max(RANGE[0].exp());
        let lower = match best.values[k] <= RANGE[0].exp() || fall(0.0) < HALF_DEVIANCE_AT_0 {
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
fn look_for_best(of: &mut impl FnMut(f64) -> f64, near: Option<(f64, f64)>) {
    if let Some((near, step)) = near {
        let at = of(near.exp());
        vertex(of, (near, at), step);
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
