//! Restricted maximum likelihood of the variances of a study.

use mimu::nalgebra::DMatrix;

use super::Study;

/// Logarithms of variances, of standard values, between which the maximum is sought. At the lowest a variance is zero.
pub(super) const LOWEST: f64 = -18.0;
const HIGHEST: f64 = 5.0;
/// Sweeps over all variances, and the change that ends them.
const SWEEPS: usize = 100;
const CHANGE: f64 = 1e-7;

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
    fn deviance(&self, logs: &[f64]) -> f64 {
        let variances: Vec<f64> = logs
            .iter()
            .map(|l| if *l <= LOWEST { 0.0 } else { l.exp() })
            .collect();
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
            let Some(factor) = self.block(rows, &variances).cholesky() else {
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
            let own = if i == j { variances[0].max(1e-12) } else { 0.0 };
            variances[1] + own + same.map(|(_, v)| v).sum::<f64>()
        })
    }

    /// Logarithms of the variances with the greatest restricted likelihood, found one by one in turn.
    pub(super) fn maximise(&self) -> Vec<f64> {
        let count = 2 + self.study.factors.len() + self.cells.len();
        let mut logs = vec![(1.0 / count as f64).ln(); count];
        let mut step = 2.0;
        for _ in 0..SWEEPS {
            let before = self.deviance(&logs);
            let start = logs.clone();
            for k in 0..count {
                self.along(&mut logs, k, step);
            }
            let moved = logs
                .iter()
                .zip(&start)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            if before - self.deviance(&logs) < CHANGE && moved < 1e-3 {
                break;
            }
            step = (2.0 * moved).clamp(1e-3, 4.0);
        }
        logs
    }

    /// The best value of variance `k`, by golden sections around the present one and at zero.
    fn along(&self, logs: &mut [f64], k: usize, step: f64) {
        let at = |log: f64, logs: &mut [f64]| {
            logs[k] = log;
            self.deviance(logs)
        };
        let present = logs[k].max(LOWEST + 1.0);
        let [mut low, mut high] =
            [present - step, present + step].map(|l| l.clamp(LOWEST, HIGHEST));
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let inner =
            |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
        let [mut a, mut b] = inner(low, high);
        let (mut of_a, mut of_b) = (at(a, logs), at(b, logs));
        while high - low > 2e-5 * step.max(0.05) {
            if of_a < of_b {
                (high, b, of_b) = (b, a, of_a);
                a = inner(low, high)[0];
                of_a = at(a, logs);
            } else {
                (low, a, of_a) = (a, b, of_b);
                b = inner(low, high)[1];
                of_b = at(b, logs);
            }
        }
        let best = 0.5 * (low + high);
        let (at_best, at_zero) = (at(best, logs), at(LOWEST, logs));
        // Repeatability is never zero: the inverse of a block would have no end.
        logs[k] = if k > 0 && at_zero <= at_best + 1e-9 {
            LOWEST
        } else {
            best
        };
    }

    /// Covariance of the logarithms: the inverse of the observed information. A variance that is zero has none.
    pub(super) fn covariance(&self, logs: &[f64]) -> DMatrix<f64> {
        let inside: Vec<usize> = (0..logs.len()).filter(|k| logs[*k] > LOWEST).collect();
        let m = inside.len();
        let step = 0.05;
        let at = |moves: &[(usize, f64)]| {
            let mut there = logs.to_vec();
            for (k, by) in moves {
                there[inside[*k]] += by;
            }
            0.5 * self.deviance(&there)
        };
        let centre = at(&[]);
        let information = DMatrix::from_fn(m, m, |i, j| match i == j {
            true => (at(&[(i, step)]) - 2.0 * centre + at(&[(i, -step)])) / (step * step),
            false => {
                let corners = [(step, step), (step, -step), (-step, step), (-step, -step)];
                let [pp, pm, mp, mm] = corners.map(|(a, b)| at(&[(i, a), (j, b)]));
                (pp - pm - mp + mm) / (4.0 * step * step)
            }
        });
        let mut out = DMatrix::zeros(logs.len(), logs.len());
        if let Some(factor) = information.cholesky() {
            let inverse = factor.inverse();
            for (a, i) in inside.iter().enumerate() {
                for (b, j) in inside.iter().enumerate() {
                    out[(*i, *j)] = inverse[(a, b)];
                }
            }
        }
        out
    }
}
