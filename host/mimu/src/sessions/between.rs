//! Parameters of several sessions: what is common, and how much they change from one session to the next.
//!
//! The estimates `y` of session s, with the covariance V of their fit, are `y = X β + u + e`, `u ~ N(0, T)`, `e ~ N(0, V)`: a multivariate
//! random-effects model, Jackson, White, Riley (2013). T is diagonal. Sessions may determine different combinations of parameters, because V is used in
//! full. T is estimated by restricted maximum likelihood (REML), parameter by parameter in turn.
//!
//! A few sessions determine T poorly, and its estimate is often zero. Intervals therefore integrate over the restricted likelihood. The axes of a kind (scale
//! factors, say) inform each other: their variances are taken as drawn from a scaled inverse chi-square distribution, with [`ALIKE_DOF`] degrees of freedom, about
//! a variance of the kind, which is integrated over too (Morris 1983; Smyth 2004). That variance has the prior `1 / (s + v)`, v the variance of the fits: flat in
//! its logarithm where changes exceed the uncertainty of the fits, finite where they do not. With one or two sessions the prior of a
//! [class of parts](super::class) replaces it.
//!
//! Some parts age, too slowly for the sessions to name it: each parameter then has a slope from session to session, normal with a standard deviation that is a share of that between
//! sessions. The share is common to a triad, so that its parameters show it together, and is averaged over: the results of [`AGEING`] are weighed by their restricted
//! likelihoods. One fixed share would be wrong for units that do not age, as the nine sessions of eight MPU-9150.

use nalgebra::{DMatrix, DVector};

use super::mixture::{Matched, Mixture};

/// Estimates of one session, and their covariance.
#[derive(Debug, Clone)]
pub struct Estimates {
    /// Values.
    pub values: DVector<f64>,
    /// Covariance.
    pub covariance: DMatrix<f64>,
}

/// A scaled inverse chi-square distribution of a variance: a priori `dof * variance / chi-square(dof)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VariancePrior {
    /// Degrees of freedom.
    pub dof: f64,
    /// Typical variance.
    pub variance: f64,
}

/// Degrees of freedom of the distribution of the variances of a kind. The axes of a part differ: the variances of eight MPU-9150 in nine sessions.
pub const ALIKE_DOF: f64 = 4.0;

/// Standard deviations of the change from each session to the next by ageing, over that of the changes of a power-on.
pub const AGEING: [f64; 4] = [0.0, 0.1, 0.25, 0.5];

/// Kinds of parameters, whose variances inform each other.
#[derive(Debug, Clone, Default)]
pub struct Kinds {
    /// Number of the kind of each parameter.
    pub of: Vec<usize>,
    /// Size of each parameter in a unit that its kind has in common.
    pub size: Vec<f64>,
}

/// How the expected parameters depend on the session.
#[derive(Debug, Clone)]
pub struct Design {
    /// For each session a matrix of as many rows as there are parameters.
    pub sessions: Vec<DMatrix<f64>>,
    /// The same for the next session.
    pub next: DMatrix<f64>,
    /// For each coefficient beyond the expectations its standard deviation over that of its parameter between sessions; `None` if nothing is known of it.
    pub slopes: Vec<Option<f64>>,
}

impl Design {
    /// Parameters with the same expectation in all sessions. The parameters of `with` also change in proportion to a covariate, given for each session and
    /// for the next one.
    pub fn constant(n: usize, sessions: usize, with: &[usize], covariate: (&[f64], f64)) -> Self {
        let of = |at: f64| {
            let mut x = DMatrix::zeros(n, n + with.len());
            x.view_mut((0, 0), (n, n)).fill_with_identity();
            for (k, parameter) in with.iter().enumerate() {
                x[(*parameter, n + k)] = at;
            }
            x
        };
        let at = |s: usize| covariate.0.get(s).copied().unwrap_or(0.0);
        Self {
            sessions: (0..sessions).map(|s| of(at(s))).collect(),
            next: of(covariate.1),
            slopes: vec![None; with.len()],
        }
    }

    /// Parameters that age by this share. Sessions have these numbers, and the next one `next`; nothing is known of the slopes of `drifting` parameters.
    fn ageing(n: usize, (numbers, next): (&[f64], f64), drifting: &[usize], share: f64) -> Self {
        if share == 0.0 {
            return Self::constant(n, numbers.len(), drifting, (numbers, next));
        }
        let all: Vec<usize> = (0..n).collect();
        let slope = |i: &usize| (!drifting.contains(i)).then_some(share);
        Self {
            slopes: all.iter().map(slope).collect(),
            ..Self::constant(n, numbers.len(), &all, (numbers, next))
        }
    }
}

impl Design {
    /// Slopes of which something is known: column, parameter, and variance over that of the parameter between sessions.
    fn known_slopes(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let n = self.next.nrows();
        let each = self.slopes.iter().enumerate();
        each.filter_map(move |(k, ratio)| {
            let column = n + k;
            let mut all = self.sessions.iter().chain([&self.next]);
            let parameter = all.find_map(|x| (0..n).find(|i| x[(*i, column)] != 0.0))?;
            Some((column, parameter, ratio.as_ref()?.powi(2)))
        })
    }
}

/// Result for one parameter.
#[derive(Debug, Clone)]
pub struct OfParameter {
    /// Variance between sessions by REML.
    pub variance: f64,
    /// 95 % interval of the standard deviation between sessions.
    pub sigma_interval: [f64; 2],
    /// Expected value in the next session: its uncertainty is that of the fits and of how few sessions there are.
    pub common: Mixture,
    /// Value in the next session.
    pub next: Mixture,
}

/// The model fitted to sessions.
#[derive(Debug, Clone)]
pub struct Between {
    /// Of each parameter.
    pub parameters: Vec<OfParameter>,
    /// REML estimate of the coefficients, with their covariance, in the order of the design's columns.
    pub coefficients: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Logarithm of the restricted likelihood, without constants.
    pub log_likelihood: f64,
    /// Covariance of the expected values in the next session.
    pub expected: DMatrix<f64>,
    /// Distributions of the coefficients beyond the expectations: slopes or steps.
    pub slopes: Vec<Mixture>,
    /// Number of each slope's parameter.
    pub slope_of: Vec<usize>,
}

/// Fits the model of sessions with these numbers, whose parameters age: the average over the shares of [`AGEING`]. Nothing is known of the slopes of `drifting` parameters.
/// `priors` as in [`fit`].
///
/// # Errors
/// `None` if the sessions do not determine the expectations.
pub fn fit_ageing(
    estimates: &[Estimates],
    numbers: (&[f64], f64),
    drifting: &[usize],
    kinds: &Kinds,
    priors: Option<&[VariancePrior]>,
) -> Option<Between> {
    let n = estimates.first()?.values.len();
    let of = |share: f64| {
        let design = Design::ageing(n, numbers, drifting, share);
        fit(estimates, &design, kinds, priors)
    };
    let all: Vec<Between> = AGEING.into_iter().map(of).collect::<Option<_>>()?;
    let weights = exponentials(&all.iter().map(|b| b.log_likelihood).collect::<Vec<_>>());
    let total: f64 = weights.iter().sum();
    let each = || all.iter().zip(&weights).map(|(b, w)| (b, w / total));
    let best = each().max_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let of_parameter = |i: usize| {
        let mixed = |of: fn(&OfParameter) -> &Mixture| {
            Mixture::average(each().map(|(b, w)| (of(&b.parameters[i]), w)))
        };
        OfParameter {
            common: mixed(|p| &p.common),
            next: mixed(|p| &p.next),
            ..best.parameters[i].clone()
        }
    };
    // The correlations of the expected values; their variances are those of the mixtures.
    let expected = each().fold(DMatrix::zeros(n, n), |sum, (b, w)| sum + &b.expected * w);
    Some(Between {
        parameters: (0..n).map(of_parameter).collect(),
        expected,
        ..best.clone()
    })
}

/// Points of the grid of a variance in each round. Variances are estimated in turn and change each other little: between the last two rounds by 1e-4. The last
/// grid is also the one that intervals integrate over.
const ROUNDS: [usize; 4] = [24, 24, 24, 72];

/// Least variance of a fit, in squares of the typical error: a fit may determine a combination exactly, and the inverse of its covariance has to stay finite.
const LEAST: f64 = 1e-8;

/// What the model is fitted to.
struct Problem<'a> {
    estimates: &'a [Estimates],
    design: &'a Design,
    /// Variances that are being estimated.
    variances: Vec<f64>,
}

/// The model at one value of a variance.
struct At {
    variance: f64,
    log_likelihood: f64,
    coefficients: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// Fits the model. `priors`, one for each parameter, replace that of the variance of a kind; the first of a kind counts.
///
/// # Errors
/// `None` if the sessions do not determine the coefficients.
pub fn fit(
    estimates: &[Estimates],
    design: &Design,
    kinds: &Kinds,
    priors: Option<&[VariancePrior]>,
) -> Option<Between> {
    let n = estimates.first()?.values.len();
    // All numbers near one: raw counts and radians are parameters side by side.
    let units = units(estimates);
    // Differences from the first session keep their digits.
    let origin = estimates[0].values.clone();
    let scaled = |e: &Estimates| Estimates {
        values: (&e.values - &origin).component_div(&units),
        covariance: DMatrix::from_fn(n, n, |i, j| e.covariance[(i, j)] / (units[i] * units[j])),
    };
    let estimates: Vec<Estimates> = estimates.iter().map(scaled).collect();
    let mut problem = Problem {
        estimates: &estimates,
        design,
        variances: vec![0.0; n],
    };
    let lowest = |i: usize| priors.map_or(1.0, |p| 0.1 * p[i].variance / (units[i] * units[i]));
    let mut profiles = Vec::new();
    for points in ROUNDS {
        profiles.clear();
        for i in 0..n {
            let profile = problem.profile(i, points, lowest(i))?;
            problem.variances[i] = profile.best();
            profiles.push(profile);
        }
    }
    weigh(&mut profiles, &units, kinds, priors);
    let last = problem.along(0)?.at(problem.variances[0])?;
    let of = |(i, profile): (usize, &Profile)| profile.result(design, i, [origin[i], units[i]]);
    let parameters = profiles.iter().enumerate().map(of).collect();
    let all = design.next.ncols();
    let owner = |c: usize| {
        let nonzero = |x: &DMatrix<f64>| (0..n).find(|i| x[(*i, c)] != 0.0);
        design
            .sessions
            .iter()
            .chain([&design.next])
            .find_map(nonzero)
    };
    let owners: Vec<usize> = (0..all).map(owner).collect::<Option<_>>()?;
    let scale = |c: usize| units[owners[c]];
    let scaled = |a: usize, b: usize| last.covariance[(a, b)] * scale(a) * scale(b);
    let covariance = DMatrix::from_fn(all, all, scaled);
    let slopes = (n..all).map(|c| profiles[owners[c]].coefficient(c, units[owners[c]]));
    Some(Between {
        parameters,
        coefficients: DVector::from_fn(all, |c, _| {
            let from = if c < n { origin[c] } else { 0.0 };
            from + last.coefficients[c] * scale(c)
        }),
        // In the data's own units the restricted likelihoods of designs with the same data compare.
        log_likelihood: last.log_likelihood,
        expected: &design.next * &covariance * design.next.transpose(),
        covariance,
        slopes: slopes.collect(),
        slope_of: owners[n..].to_vec(),
    })
}

/// A typical size of the error of each parameter: of its fit, or of its change.
fn units(estimates: &[Estimates]) -> DVector<f64> {
    let s = estimates.len() as f64;
    let n = estimates[0].values.len();
    DVector::from_fn(n, |i, _| {
        let mean = estimates.iter().map(|e| e.values[i]).sum::<f64>() / s;
        let fits = estimates.iter().map(|e| e.covariance[(i, i)]);
        let least = fits.fold(f64::INFINITY, f64::min);
        let spread = estimates.iter().map(|e| (e.values[i] - mean).powi(2));
        let typical = least + spread.sum::<f64>() / s;
        typical.max(f64::MIN_POSITIVE).sqrt()
    })
}

/// The model as a function of one variance: the inverse of a covariance changes by a matrix of rank one, so a value costs little.
struct Along {
    sessions: Vec<OfSession>,
    normal: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    log_determinant: f64,
    /// Column of the parameter's slope, and its variance over that of the parameter, if something is known of it.
    slope: Option<(usize, f64)>,
}

/// What the variance changes in one session.
struct OfSession {
    /// Weight of the parameter where its variance is zero.
    weight: f64,
    /// The design weighted for the parameter, and its value.
    along: DVector<f64>,
    value: f64,
}

impl Problem<'_> {
    /// The model without the variance of parameter `i`.
    fn along(&self, i: usize) -> Option<Along> {
        let columns = self.design.next.ncols();
        let mut out = Along {
            sessions: Vec::new(),
            normal: DMatrix::zeros(columns, columns),
            right: DVector::zeros(columns),
            square: 0.0,
            log_determinant: 0.0,
            slope: None,
        };
        for (column, parameter, ratio) in self.design.known_slopes() {
            match parameter == i {
                true => out.slope = Some((column, ratio)),
                false => {
                    let variance = ratio * (self.variances[parameter] + LEAST);
                    out.normal[(column, column)] += 1.0 / variance;
                    out.log_determinant += variance.ln();
                }
            }
        }
        for (e, x) in self.estimates.iter().zip(&self.design.sessions) {
            let mut total = e.covariance.clone();
            for (k, own) in self.variances.iter().enumerate() {
                total[(k, k)] += LEAST + if k == i { 0.0 } else { *own };
            }
            let factor = total.cholesky()?;
            let diagonal = factor.l_dirty().diagonal();
            out.log_determinant += 2.0 * diagonal.map(f64::ln).sum();
            let weights = factor.inverse();
            let weighted = &weights * &e.values;
            let column = weights.column(i);
            out.normal += x.tr_mul(&(&weights * x));
            out.right += x.tr_mul(&weighted);
            out.square += e.values.dot(&weighted);
            out.sessions.push(OfSession {
                weight: weights[(i, i)],
                along: x.tr_mul(&column),
                value: column.dot(&e.values),
            });
        }
        Some(out)
    }

    /// The model over a grid of the variance of parameter `i`, from far below the uncertainty of the fits to far above all changes.
    fn profile(&self, i: usize, points: usize, lowest: f64) -> Option<Profile> {
        let along = self.along(i)?;
        let fits = || self.estimates.iter().map(|e| e.covariance[(i, i)]);
        let least = fits().fold(1.0, f64::min).max(LEAST);
        let low = 1e-3 * least.min(lowest);
        let high = 1e4 * lowest.max(1.0);
        let harmonic = fits().map(|v| 1.0 / v.max(LEAST)).sum::<f64>();
        let step = (high / low).ln() / (points - 1) as f64;
        let each = (0..points).map(|k| along.at(low * (step * k as f64).exp()));
        let grid: Vec<At> = each.collect::<Option<_>>()?;
        Some(Profile {
            weights: vec![1.0; grid.len()],
            grid,
            fit: self.estimates.len() as f64 / harmonic,
        })
    }
}

impl Along {
    fn at(&self, variance: f64) -> Option<At> {
        let (mut normal, mut right) = (self.normal.clone(), self.right.clone());
        let (mut square, mut log_determinant) = (self.square, self.log_determinant);
        for s in &self.sessions {
            let more = 1.0 + variance * s.weight;
            let by = variance / more;
            normal.ger(-by, &s.along, &s.along, 1.0);
            right.axpy(-by * s.value, &s.along, 1.0);
            square -= by * s.value * s.value;
            log_determinant += more.ln();
        }
        if let Some((column, ratio)) = self.slope {
            let slope = ratio * (variance + LEAST);
            normal[(column, column)] += 1.0 / slope;
            log_determinant += slope.ln();
        }
        let factor = normal.cholesky()?;
        log_determinant += 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
        let covariance = factor.inverse();
        let coefficients = &covariance * &right;
        let residual = square - right.dot(&coefficients);
        Some(At {
            variance,
            log_likelihood: -0.5 * (log_determinant + residual),
            coefficients,
            covariance,
        })
    }
}

/// The model over a grid of one variance.
struct Profile {
    /// Even in the logarithm of the variance.
    grid: Vec<At>,
    /// Posterior weights of the grid.
    weights: Vec<f64>,
    /// Typical variance of the fits.
    fit: f64,
}

/// Points of the grid of the variance of a kind.
const KIND_GRID: usize = 48;

/// Logarithm of the density of a scaled inverse chi-square distribution, for the logarithm of the variance, without constants.
fn inverse_chi_square(variance: f64, dof: f64, typical: f64) -> f64 {
    0.5 * dof * ((typical / variance).ln() - typical / variance)
}

/// Numbers in proportion to the exponentials of `logarithms`.
fn exponentials(logarithms: &[f64]) -> Vec<f64> {
    let most = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    logarithms.iter().map(|l| (l - most).exp()).collect()
}

/// Posterior weights of all grids.
fn weigh(
    profiles: &mut [Profile],
    units: &DVector<f64>,
    kinds: &Kinds,
    priors: Option<&[VariancePrior]>,
) {
    for kind in 0..=kinds.of.iter().copied().max().unwrap_or(0) {
        let members: Vec<usize> = (0..profiles.len())
            .filter(|i| kinds.of[*i] == kind)
            .collect();
        let Some(first) = members.first() else {
            continue;
        };
        // Of the kind in the unit of the member.
        let seen = |i: usize, s: f64| s * (kinds.size[i] / units[i]).powi(2);
        let of_kind = |i: usize, v: f64| v * (units[i] / kinds.size[i]).powi(2);
        let ends = |k: fn(&Profile) -> f64| members.iter().map(move |i| (*i, k));
        let low = ends(|p| 30.0 * p.grid[0].variance);
        let low = low
            .map(|(i, k)| of_kind(i, k(&profiles[i])))
            .fold(0.0, f64::max);
        let high = ends(|p| p.grid[p.grid.len() - 1].variance / 30.0);
        let high = high.map(|(i, k)| of_kind(i, k(&profiles[i])));
        let high = high.fold(f64::INFINITY, f64::min).max(100.0 * low);
        let step = (high / low).ln() / (KIND_GRID - 1) as f64;
        let grid: Vec<f64> = (0..KIND_GRID)
            .map(|k| low * (step * k as f64).exp())
            .collect();
        let fits = members.iter().map(|i| of_kind(*i, profiles[*i].fit));
        let fits = fits.sum::<f64>() / members.len() as f64;
        let prior = |s: f64| match priors {
            None => (s / (s + fits)).ln(),
            Some(p) => inverse_chi_square(
                s,
                p[*first].dof,
                p[*first].variance / kinds.size[*first].powi(2),
            ),
        };
        // Likelihood of each value of the kind's variance by each member.
        let likelihoods: Vec<Vec<f64>> = members
            .iter()
            .map(|i| {
                let by = exponentials(&profiles[*i].logarithms());
                let of = |s: &f64| {
                    let typical = seen(*i, *s);
                    let each = profiles[*i].grid.iter().zip(&by);
                    let each = each.map(|(at, l)| {
                        l * inverse_chi_square(at.variance, ALIKE_DOF, typical).exp()
                    });
                    each.sum::<f64>().max(f64::MIN_POSITIVE).ln()
                };
                grid.iter().map(of).collect()
            })
            .collect();
        for (m, i) in members.iter().enumerate() {
            let others = |k: usize| {
                let each = likelihoods.iter().enumerate().filter(|(j, _)| *j != m);
                prior(grid[k]) + each.map(|(_, l)| l[k]).sum::<f64>()
            };
            let others: Vec<f64> = (0..KIND_GRID).map(others).collect();
            let others = exponentials(&others);
            let profile = &mut profiles[*i];
            let by = exponentials(&profile.logarithms());
            let weight = |(at, l): (&At, &f64)| {
                let each = grid.iter().zip(&others).map(|(s, w)| {
                    w * inverse_chi_square(at.variance, ALIKE_DOF, seen(*i, *s)).exp()
                });
                l * each.sum::<f64>()
            };
            profile.weights = profile.grid.iter().zip(&by).map(weight).collect();
        }
    }
}

impl Profile {
    fn logarithms(&self) -> Vec<f64> {
        self.grid.iter().map(|at| at.log_likelihood).collect()
    }

    /// The variance of the greatest restricted likelihood; zero at the lower end.
    fn best(&self) -> f64 {
        let grid = self.grid.iter().enumerate();
        let best = grid.max_by(|a, b| a.1.log_likelihood.total_cmp(&b.1.log_likelihood));
        let Some((k, best)) = best else { return 0.0 };
        if k == 0 || k + 1 == self.grid.len() {
            return if k == 0 { 0.0 } else { best.variance };
        }
        // A parabola in the logarithm through three neighbours.
        let [a, b, c] = [k - 1, k, k + 1].map(|k| self.grid[k].log_likelihood);
        let step = (self.grid[k + 1].variance / best.variance).ln();
        let shift = 0.5 * (a - c) / (a - 2.0 * b + c);
        best.variance * (step * shift).exp()
    }

    fn result(&self, design: &Design, i: usize, [origin, unit]: [f64; 2]) -> OfParameter {
        let row = design.next.row(i).transpose();
        let of = |between: f64| {
            let each = self.grid.iter().zip(&self.weights);
            let components = each.map(|(at, w)| {
                let mean = origin + at.coefficients.dot(&row) * unit;
                let variance = row.dot(&(&at.covariance * &row)) + between * at.variance;
                [*w, mean, variance * unit * unit]
            });
            Mixture::new(components.collect())
        };
        OfParameter {
            variance: self.best() * unit * unit,
            sigma_interval: self.sigma_interval().map(|s| s * unit),
            common: of(0.0),
            next: of(1.0),
        }
    }

    /// Distribution of coefficient `c`.
    fn coefficient(&self, c: usize, unit: f64) -> Mixture {
        let each = self.grid.iter().zip(&self.weights);
        let components = each.map(|(at, w)| {
            let variance = at.covariance[(c, c)] * unit * unit;
            [*w, at.coefficients[c] * unit, variance]
        });
        Mixture::new(components.collect())
    }

    /// 95 % interval of the standard deviation.
    fn sigma_interval(&self) -> [f64; 2] {
        let total: f64 = self.weights.iter().sum();
        let end = |share: f64| {
            let mut sum = 0.0;
            let over = |(_, w): &(&At, &f64)| {
                sum += **w;
                sum >= share * total
            };
            let found = self.grid.iter().zip(&self.weights).find(over);
            found.map_or(f64::NAN, |(at, _)| at.variance.sqrt())
        };
        [end(0.025), end(0.975)]
    }
}

impl Between {
    /// The parameters of the next session.
    pub fn next(&self) -> Vec<Matched> {
        self.parameters.iter().map(|p| p.next.matched()).collect()
    }
}
