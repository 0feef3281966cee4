//! Restricted maximum likelihood of the variances of a study.

use mimu::nalgebra::DMatrix;
use mimu::variance_search::Search;

use super::Study;

/// Unit of a variance in the search, of standard values: it is sought from 1e-8 to 6e3 of these.
const UNIT: f64 = 1e-4;
/// Smallest repeatability, a variance of standard values: the inverse of a block would have no end.
const LEAST: f64 = 1e-12;
/// A variance whose absence lowers the logarithm of the likelihood by less is zero: its own would have no curvature, and the others no intervals.
const FLAT: f64 = 1e-6;
/// Smallest step of the search in the logarithm of a variance.
const FINEST: f64 = 1e-3;

/// Standard values of a study.
pub(super) struct Model<'a> {
    pub(super) values: Vec<f64>,
    pub(super) study: &'a Study,
    /// Cells of each interaction.
    pub(super) cells: Vec<Vec<usize>>,
    /// Measurements of each unit.
    pub(super) rows: Vec<Vec<usize>>,
}

impl Model<'_> {
    /// Minus twice the restricted log-likelihood, without constants, of variances: repeatability, units, factors, interactions.
    ///
    /// Blocks of units are inverted one by one; factors, which connect units, by the identity of Woodbury.
    fn deviance(&self, variances: &[f64]) -> f64 {
        let sizes = self
            .study
            .factors
            .iter()
            .map(|f| f.1.iter().max().map_or(0, |m| m + 1));
        let q: usize = sizes.clone().sum();
        let first: Vec<usize> = sizes
            .scan(0, |sum, size| {
                *sum += size;
                Some(*sum - size)
            })
            .collect();
        // Factors, then the mean and the values: their products by the inverse of the blocks.
        let mut products = DMatrix::<f64>::zeros(q + 2, q + 2);
        let mut log_determinant = 0.0;
        for rows in &self.rows {
            let Some(factor) = self.block(rows, variances).cholesky() else {
                return f64::INFINITY;
            };
            log_determinant += 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
            let weights = factor.inverse();
            // Each measurement has one column of each factor, the mean, and its value.
            let columns = |row: &usize| {
                let factors = self.study.factors.iter().enumerate();
                let own = factors
                    .map(|(f, (_, levels))| (first[f] + levels[*row], variances[2 + f].sqrt()));
                own.chain([(q, 1.0), (q + 1, self.values[*row])]).collect()
            };
            let columns: Vec<Vec<(usize, f64)>> = rows.iter().map(columns).collect();
            for (i, of_i) in columns.iter().enumerate() {
                for (j, of_j) in columns.iter().enumerate() {
                    let w = weights[(i, j)];
                    for (a, x) in of_i {
                        for (b, y) in of_j {
                            products[(*a, *b)] += x * w * y;
                        }
                    }
                }
            }
        }
        let across = products.view((0, q), (q, 2)).into_owned();
        let mut reduced = products.view((q, q), (2, 2)).into_owned();
        if q > 0 {
            let inner = products.view((0, 0), (q, q)) + DMatrix::identity(q, q);
            let Some(factor) = inner.cholesky() else {
                return f64::INFINITY;
            };
            log_determinant += 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
            reduced -= across.tr_mul(&factor.solve(&across));
        }
        let normal = reduced[(0, 0)];
        log_determinant + normal.ln() + reduced[(1, 1)] - reduced[(0, 1)] * reduced[(0, 1)] / normal
    }

    /// Covariance of the measurements of a unit, without the factors that connect units.
    fn block(&self, rows: &[usize], variances: &[f64]) -> DMatrix<f64> {
        let interactions = &variances[2 + self.study.factors.len()..];
        DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            let same = self.cells.iter().zip(interactions);
            let same = same.filter(|(cells, _)| cells[rows[i]] == cells[rows[j]]);
            let own = if i == j { variances[0].max(LEAST) } else { 0.0 };
            variances[1] + own + same.map(|(_, v)| v).sum::<f64>()
        })
    }

    /// The variances with the greatest restricted likelihood.
    pub(super) fn maximise(&self) -> Vec<f64> {
        let count = 2 + self.study.factors.len() + self.cells.len();
        let variances = |values: &[f64]| values.iter().map(|v| UNIT * v).collect::<Vec<f64>>();
        let search = Search {
            of: |values: &[f64]| Some(-0.5 * self.deviance(&variances(values))),
            most: vec![f64::INFINITY; count],
            finest: FINEST,
        };
        let start = search.fitted(vec![1.0 / (UNIT * count as f64); count]);
        let all: Vec<usize> = (0..count).collect();
        let mut best = search.maximise(start, &all);
        // Repeatability is never zero.
        for k in 1..count {
            let mut values = best.values.clone();
            values[k] = 0.0;
            let without = search.fitted(values);
            if without.log_likelihood > best.log_likelihood - FLAT {
                best = without;
            }
        }
        variances(&best.values)
    }

    /// Covariance of the logarithms: the inverse of the observed information. A variance that is zero has none, nor one whose likelihood is flat: the
    /// others would have no intervals for it.
    pub(super) fn covariance(&self, variances: &[f64]) -> DMatrix<f64> {
        let mut inside: Vec<usize> = (0..variances.len())
            .filter(|k| variances[*k] > 0.0)
            .collect();
        let mut out = DMatrix::zeros(variances.len(), variances.len());
        while !inside.is_empty() {
            let information = self.information(variances, &inside);
            if let Some(factor) = information.clone().cholesky() {
                let inverse = factor.inverse();
                for (a, i) in inside.iter().enumerate() {
                    for (b, j) in inside.iter().enumerate() {
                        out[(*i, *j)] = inverse[(a, b)];
                    }
                }
                break;
            }
            let own = |a: &usize| information[(*a, *a)];
            let flattest = (0..inside.len()).min_by(|a, b| own(a).total_cmp(&own(b)));
            inside.remove(flattest.unwrap_or_default());
        }
        out
    }

    /// Second differences of minus the logarithm of the likelihood by the logarithms of the variances `inside`.
    fn information(&self, variances: &[f64], inside: &[usize]) -> DMatrix<f64> {
        let step = 0.05;
        let at = |moves: &[(usize, f64)]| {
            let mut there = variances.to_vec();
            for (k, by) in moves {
                there[inside[*k]] *= by.exp();
            }
            0.5 * self.deviance(&there)
        };
        let centre = at(&[]);
        let m = inside.len();
        DMatrix::from_fn(m, m, |i, j| match i == j {
            true => (at(&[(i, step)]) - 2.0 * centre + at(&[(i, -step)])) / (step * step),
            false => {
                let corners = [(step, step), (step, -step), (-step, step), (-step, -step)];
                let [pp, pm, mp, mm] = corners.map(|(a, b)| at(&[(i, a), (j, b)]));
                (pp - pm - mp + mm) / (4.0 * step * step)
            }
        })
    }
}
