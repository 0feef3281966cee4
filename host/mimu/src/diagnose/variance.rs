//! Variance of the rows: known noise, extra white variance, and a rate random walk. What is not known is estimated.
//!
//! A drift of the bias differs from a random walk only in being a straight line. So a random walk that is not known is part of the null hypothesis.

mod factor;
mod walk;

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::rows::{Rows, Stratum};
use factor::{Axes, Factor, Separable};

pub use factor::Whitener;
pub use walk::CommonWalk;

/// Variance components of each stratum beside the known covariance: the extra white variance of each row, unit of the rows squared, and K² of a random
/// walk, unit²/s.
pub type Components = Vec<[f64; 2]>;

/// A linear model of the rows at some components.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Components.
    pub components: Components,
    /// -2 ln of the likelihood, up to a constant. Models are compared by it.
    pub deviance: f64,
    /// The same of the restricted likelihood, which estimates the components of one model best.
    pub restricted: f64,
    /// Coefficients of the columns.
    pub coefficients: DVector<f64>,
    /// Their covariance at these components.
    pub covariance: DMatrix<f64>,
    /// Sum of the squares of the decorrelated residuals.
    pub chi2: f64,
    /// Columns whose coefficients have a prior about zero, and its standard deviation. Coefficients and covariance include it; deviance and chi² are
    /// those of the rows alone.
    pub prior: Vec<(usize, f64)>,
}

impl Fitted {
    /// The same with a prior about zero for some columns, each with its standard deviation.
    pub fn with_prior(mut self, prior: Vec<(usize, f64)>) -> Self {
        for &(column, sigma) in &prior {
            let by = self.covariance.column(column).into_owned();
            let gain = &by / (by[column] + sigma * sigma);
            self.coefficients -= &gain * self.coefficients[column];
            self.covariance -= gain * by.transpose();
        }
        self.prior = prior;
        self
    }
}

/// Which likelihood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LikelihoodKind {
    /// The likelihood itself, for tests: if the noise has one level, the drop between two models is a function of F.
    Likelihood,
    /// The restricted one, for the noise of one model: it allows for what the coefficients absorb.
    Restricted,
}

/// What a stratum adds to the normal equations.
struct NormalEquations {
    /// Normal matrix of columns and residual.
    normal: DMatrix<f64>,
    log_determinant: f64,
}

/// Rows, with quantities that are slow to compute.
pub struct VarianceModel<'a> {
    rows: &'a Rows,
    /// Axes in which the rows of a stratum without a random walk are independent, whatever the extra white variance. Where a random walk is sought,
    /// only the rows' own axes serve; `None` if the rows are not independent in these.
    axes: Vec<Option<Axes>>,
    /// Whether the rows of a stratum are independent, apart from the errors that all share and a random walk.
    independent: Vec<bool>,
    /// Factor of the covariance by the errors that all rows share, in these axes. In a small stratum the axes contain it.
    open: Vec<Option<DMatrix<f64>>>,
    /// The random walk that is sought in each stratum, if its covariance is separable.
    separable: Vec<Option<Separable>>,
    /// Typical variance of a row, and of a unit random walk, by stratum.
    typical: Vec<(f64, f64)>,
    /// Whether a random walk is sought even if the wander is known.
    all_random_walks: bool,
}

impl<'a> VarianceModel<'a> {
    /// Of `rows`. A random walk absorbs slow effects. So where the wander of the biases is known, one is sought only with `all_random_walks`.
    pub fn new(rows: &'a Rows, all_random_walks: bool) -> Self {
        let mean = |m: &DMatrix<f64>| m.diagonal().mean().max(1e-30);
        let mut variance = Self {
            rows,
            all_random_walks,
            axes: Vec::new(),
            independent: Vec::new(),
            open: Vec::new(),
            separable: Vec::new(),
            typical: rows
                .strata
                .iter()
                .map(|s| {
                    let known = s.known_variances().mean().max(1e-30);
                    (known, s.random_walk.as_ref().map_or(0.0, mean))
                })
                .collect(),
        };
        let independent = |s: &Stratum| Axes::as_they_stand(&s.known).is_some();
        variance.independent = rows.strata.iter().map(independent).collect();
        variance.axes = (0..rows.strata.len())
            .into_par_iter()
            .map(|s| match variance.seeks_random_walk(s) {
                true => Axes::as_they_stand(&rows.strata[s].known),
                false => Some(Axes::of(&rows.strata[s].with_open(FEW))),
            })
            .collect();
        variance.open = (0..rows.strata.len())
            .map(|s| {
                let stratum = &rows.strata[s];
                let folded = !variance.seeks_random_walk(s) && stratum.rows.len() <= FEW;
                let mut open = stratum.open.clone().filter(|_| !folded)?;
                let count = open.nrows();
                if let Some(axes) = &variance.axes[s] {
                    axes.rotate(&mut open.rows_mut(0, count));
                }
                Some(open)
            })
            .collect();
        variance.separable = (0..rows.strata.len())
            .map(|s| {
                Separable::of(
                    rows.strata[s]
                        .random_walk
                        .as_ref()
                        .filter(|_| variance.seeks_random_walk(s))?,
                )
            })
            .collect();
        variance
    }

    /// Whether a random walk of stratum `s` is sought.
    fn seeks_random_walk(&self, s: usize) -> bool {
        let stratum = &self.rows.strata[s];
        stratum.random_walk.is_some() && (self.all_random_walks || !stratum.wander_known)
    }

    /// `matrix`, a row for each of the rows, rotated to the axes in which rows are independent, where there are such.
    pub fn rotate(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = matrix.clone();
        for (stratum, axes) in self.rows.strata.iter().zip(&self.axes) {
            if let Some(axes) = axes {
                let (from, count) = (stratum.rows.start, stratum.rows.len());
                axes.rotate(&mut out.rows_mut(from, count));
            }
        }
        out
    }

    /// Zero components: the known noise alone.
    pub fn none(&self) -> Components {
        vec![[0.0; 2]; self.rows.strata.len()]
    }

    /// Variance of each row.
    pub fn variances(&self, at: &Components) -> DVector<f64> {
        let mut out = DVector::zeros(self.rows.y.len());
        for (s, stratum) in self.rows.strata.iter().enumerate() {
            let known = stratum.known_variances();
            for (i, row) in stratum.rows.clone().enumerate() {
                let random_walk = stratum
                    .random_walk
                    .as_ref()
                    .map_or(0.0, |unit| unit[(i, i)]);
                let [extra_white, k2] = at[s];
                out[row] = known[i] + extra_white + k2 * random_walk + self.floor(s);
            }
        }
        out
    }

    /// Variance that every row has at least, so that readings without noise have a covariance.
    fn floor(&self, s: usize) -> f64 {
        1e-12 * self.typical[s].0
    }

    /// Factor of the covariance of stratum `s`, for rows that have been rotated.
    fn factor(&self, s: usize, at: [f64; 2]) -> Option<Factor> {
        let noise = match &self.axes[s] {
            Some(axes) if at[1] == 0.0 => axes.factor(at[0], self.floor(s)),
            _ => {
                let all: Vec<usize> = (0..self.rows.strata[s].rows.len()).collect();
                self.noise_of(s, at, &all)?
            }
        };
        match &self.open[s] {
            Some(open) => noise.beside(open),
            None => Some(noise),
        }
    }

    /// Decorrelates all rows.
    pub fn whitener(&self, at: &Components) -> Option<Whitener<'_>> {
        let strata = self.rows.strata.iter().enumerate();
        let parts = strata.map(|(s, stratum)| Some((stratum.rows.clone(), self.factor(s, at[s])?)));
        Some(Whitener {
            rotation: Some(self),
            parts: parts.collect::<Option<_>>()?,
        })
    }

    /// Decorrelates the rows `kept`, given in ascending order, without the others.
    pub fn kept(&self, at: &Components, kept: &[usize]) -> Option<Whitener<'_>> {
        let mut parts = Vec::new();
        for (s, stratum) in self.rows.strata.iter().enumerate() {
            let from = kept.partition_point(|r| *r < stratum.rows.start);
            let to = kept.partition_point(|r| *r < stratum.rows.end);
            let rows: Vec<usize> = kept[from..to]
                .iter()
                .map(|r| r - stratum.rows.start)
                .collect();
            if rows.is_empty() {
                continue;
            }
            let noise = self.noise_of(s, at[s], &rows)?;
            let factor = match &stratum.open {
                Some(open) => noise.beside(&open.select_rows(&rows))?,
                None => noise,
            };
            parts.push((from..to, factor));
        }
        Some(Whitener {
            rotation: None,
            parts,
        })
    }

    /// Factor of the noise of some `rows` of stratum `s`, not rotated.
    fn noise_of(
        &self,
        s: usize,
        [extra_white, random_walk]: [f64; 2],
        rows: &[usize],
    ) -> Option<Factor> {
        let stratum = &self.rows.strata[s];
        let added = extra_white + self.floor(s);
        let separable = match random_walk > 0.0 {
            true => self.separable[s].as_ref().map(|w| w.of_rows(rows)),
            false => None,
        };
        if self.independent[s] && (random_walk == 0.0 || separable.is_some()) {
            let variances = rows.iter().map(|i| stratum.known[(*i, *i)] + added);
            let variances = DVector::from_iterator(rows.len(), variances);
            return match separable {
                Some(walk) => walk.factor(random_walk, &variances),
                None => Some(Factor::Diagonal(variances.map(f64::sqrt))),
            };
        }
        let mut v = stratum.known.select_rows(rows).select_columns(rows);
        if let Some(unit) = &stratum.random_walk {
            v += unit.select_rows(rows).select_columns(rows) * random_walk;
        }
        for i in 0..v.nrows() {
            v[(i, i)] += added;
        }
        Cholesky::new(v).map(Factor::Full)
    }

    fn stratum(&self, s: usize, at: [f64; 2], both: &DMatrix<f64>) -> Option<NormalEquations> {
        let range = &self.rows.strata[s].rows;
        let mut part = both.rows(range.start, range.len()).into_owned();
        let factor = self.factor(s, at)?;
        factor.whiten(&mut part);
        Some(NormalEquations {
            normal: part.tr_mul(&part),
            log_determinant: factor.log_determinant(),
        })
    }

    fn solve(&self, strata: &[NormalEquations], at: &Components) -> Option<Fitted> {
        let p = strata.first()?.normal.ncols() - 1;
        let mut normal = DMatrix::zeros(p + 1, p + 1);
        let mut logs = 0.0;
        for stratum in strata {
            normal += &stratum.normal;
            logs += stratum.log_determinant;
        }
        let y2 = normal[(p, p)];
        // Scaled, because the units of columns differ widely.
        let scale = DVector::from_fn(p, |i, _| normal[(i, i)].sqrt().max(f64::MIN_POSITIVE));
        let scaled = DMatrix::from_fn(p, p, |i, j| normal[(i, j)] / (scale[i] * scale[j]));
        let right = DVector::from_fn(p, |i, _| normal[(i, p)] / scale[i]);
        let factor = Cholesky::new(scaled)?;
        let solution = factor.solve(&right);
        let chi2 = (y2 - solution.dot(&right)).max(0.0);
        let l = factor.l_dirty();
        let log: f64 = (0..p).map(|i| 2.0 * (l[(i, i)] * scale[i]).ln()).sum();
        let mut covariance = factor.inverse();
        for i in 0..p {
            for j in 0..p {
                covariance[(i, j)] /= scale[i] * scale[j];
            }
        }
        Some(Fitted {
            components: at.clone(),
            deviance: logs + chi2,
            restricted: logs + log + chi2,
            coefficients: solution.component_div(&scale),
            covariance,
            chi2,
            prior: Vec::new(),
        })
    }

    /// Columns and residual, rotated.
    fn both(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let p = columns.ncols();
        let mut both = columns.clone().insert_column(p, 0.0);
        both.set_column(p, &self.rows.y);
        self.rotate(&both)
    }

    /// The model with `columns` at given components.
    pub fn fit_at(&self, columns: &DMatrix<f64>, at: &Components) -> Option<Fitted> {
        let both = self.both(columns);
        let strata: Option<Vec<NormalEquations>> = (0..self.rows.strata.len())
            .map(|s| self.stratum(s, at[s], &both))
            .collect();
        self.solve(&strata?, at)
    }

    /// The model with `columns` at the components that maximise the likelihood `by`, searched from `start` on.
    pub fn fit(
        &self,
        columns: &DMatrix<f64>,
        start: &Components,
        by: LikelihoodKind,
    ) -> Option<Fitted> {
        let cost = |f: &Fitted| match by {
            LikelihoodKind::Likelihood => f.deviance,
            LikelihoodKind::Restricted => f.restricted,
        };
        let both = self.both(columns);
        let mut at = start.clone();
        let mut strata: Vec<NormalEquations> = (0..self.rows.strata.len())
            .map(|s| self.stratum(s, at[s], &both))
            .collect::<Option<_>>()?;
        let mut best = self.solve(&strata, &at)?;
        for _ in 0..SWEEPS {
            let before = cost(&best);
            for s in 0..strata.len() {
                let (row, unit_random_walk) = self.typical[s];
                for part in 0..if self.seeks_random_walk(s) { 2 } else { 1 } {
                    let now = at[s][part];
                    let unit = [row, row / unit_random_walk][part];
                    let mut steps: Vec<f64> = vec![0.0];
                    match now > 0.0 {
                        true => steps.extend([0.25, 0.5, 0.8, 1.25, 2.0, 4.0].map(|f| f * now)),
                        false => {
                            steps.extend([0.1, 0.5, 2.0, 8.0, 64.0, 1e3, 1e5].map(|f| f * unit))
                        }
                    }
                    // In parallel: decorrelating a stratum takes nearly all of the time, and the values do not depend on each other.
                    let tried: Vec<([f64; 2], Option<NormalEquations>)> = steps
                        .into_par_iter()
                        .map(|value| {
                            let mut levels = at[s];
                            levels[part] = value;
                            (levels, self.stratum(s, levels, &both))
                        })
                        .collect();
                    for (levels, stratum) in tried {
                        let Some(new) = stratum else {
                            continue;
                        };
                        let old = std::mem::replace(&mut strata[s], new);
                        let mut there = at.clone();
                        there[s] = levels;
                        match self.solve(&strata, &there) {
                            Some(found) if cost(&found) < cost(&best) - 1e-9 => {
                                best = found;
                                at = there;
                            }
                            _ => strata[s] = old,
                        }
                    }
                }
            }
            if before - cost(&best) < SETTLED {
                break;
            }
        }
        Some(best)
    }
}

/// Largest stratum whose shared errors are folded into its known covariance. Each level of the noise that is tried then takes one division a row;
/// but the axes take ten times n³, which is seconds from 300 rows on.
const FEW: usize = 300;
/// Most rounds over the components.
const SWEEPS: usize = 12;
/// Drop in deviance below which the rounds end.
const SETTLED: f64 = 0.02;
