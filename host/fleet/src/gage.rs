//! Repeatability and reproducibility (Gage R&R): which share of the differences between measurements the measurement itself makes.
//!
//! A value of unit i, measured by operator j (or on fixture j, or on day j), is `y = μ + u_i + f_j + (uf)_ij + e`, all of them random: the model of the AIAG's Measurement Systems
//! Analysis, 4th edition, appendix A, with any number of such factors. Variances are estimated by restricted maximum likelihood, which for complete
//! crossed experiments gives the table of the analysis of variance with negative components left out, and needs no complete experiment. Repeatability is e; reproducibility the factors and
//! their interactions with units. Intervals are those of a chi-square distribution with the degrees of freedom of the information matrix (Satterthwaite 1946).

use mimu::nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Measurements of units that were measured repeatedly.
#[derive(Debug, Clone)]
pub struct Study {
    /// Number of the unit of each measurement.
    pub unit: Vec<usize>,
    /// Factors: name, and number of the level of each measurement.
    pub factors: Vec<(String, Vec<usize>)>,
}

/// A variance component.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// What it belongs to: `repeatability`, `unit`, a factor, or `unit × factor`.
    pub name: String,
    /// Variance.
    pub variance: f64,
    /// Whether it is part of reproducibility.
    pub is_reproducibility: bool,
}

/// A standard deviation with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Sigma {
    /// Value.
    pub value: f64,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// Variance components of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Gage {
    /// All components, repeatability first, units second.
    pub components: Vec<Component>,
    /// Repeatability.
    pub repeatability: Sigma,
    /// Reproducibility; zero without factors.
    pub reproducibility: Sigma,
    /// Both.
    pub measurement: Sigma,
    /// Between units.
    pub units: Sigma,
}

impl Study {
    /// Of the measurements whose units are measured more than once, at most `most` units, evenly spread. `factors` are labels: name, and for each measurement its level. Factors without two levels
    /// within a unit, and those that equal an earlier one, are left out.
    ///
    /// Returns the numbers of the measurements too. `None` if no unit is measured repeatedly.
    pub fn of(
        units: &[Vec<usize>],
        factors: &[(String, Vec<Option<String>>)],
        most: usize,
    ) -> Option<(Self, Vec<usize>)> {
        let repeated: Vec<&Vec<usize>> = units.iter().filter(|u| u.len() > 1).collect();
        let step = repeated.len().div_ceil(most.max(1)).max(1);
        let repeated: Vec<&Vec<usize>> = repeated.into_iter().step_by(step).collect();
        let members: Vec<usize> = repeated.iter().flat_map(|u| u.iter().copied()).collect();
        if repeated.len() < 2 {
            return None;
        }
        let unit: Vec<usize> = repeated
            .iter()
            .enumerate()
            .flat_map(|(k, u)| vec![k; u.len()])
            .collect();
        let mut used: Vec<(String, Vec<usize>)> = Vec::new();
        for (name, levels) in factors {
            let own: Option<Vec<&String>> = members.iter().map(|m| levels[*m].as_ref()).collect();
            let Some(own) = own else { continue };
            let mut names: Vec<&String> = own.clone();
            names.sort();
            names.dedup();
            let number = |level: &String| names.binary_search(&level).unwrap_or(0);
            let own: Vec<usize> = own.into_iter().map(number).collect();
            let varies = (1..own.len()).any(|k| unit[k] == unit[k - 1] && own[k] != own[k - 1]);
            // Two labels that say the same are one factor.
            let same = used.iter_mut().find(|(_, other)| {
                let all = 0..own.len();
                all.clone().all(|a| {
                    all.clone()
                        .all(|b| (own[a] == own[b]) == (other[a] == other[b]))
                })
            });
            match same {
                Some((other, _)) if varies => *other = format!("{other} = {name}"),
                None if varies => used.push((name.clone(), own)),
                _ => {}
            }
        }
        let study = Self {
            unit,
            factors: used,
        };
        Some((study, members))
    }

    /// Number of units.
    pub fn units(&self) -> usize {
        self.unit.iter().max().map_or(0, |m| m + 1)
    }

    /// Number of the cell of each measurement: its unit with its level of a factor.
    fn cells(&self, factor: usize) -> Vec<usize> {
        let levels = &self.factors[factor].1;
        let count = levels.iter().max().map_or(0, |m| m + 1);
        self.unit
            .iter()
            .zip(levels)
            .map(|(u, l)| u * count + l)
            .collect()
    }

    /// Whether an interaction of the unit with the factor differs from repeatability: a cell with two measurements.
    fn has_interaction(&self, factor: usize) -> bool {
        let mut cells = self.cells(factor);
        let all = cells.len();
        cells.sort_unstable();
        cells.dedup();
        cells.len() < all && cells.len() > self.units()
    }

    /// The variance components of `values`, one for each measurement. `None` if they do not differ.
    pub fn fit(&self, values: &[f64]) -> Option<Gage> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let total = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
        if !(total > 0.0) {
            return None;
        }
        let interactions: Vec<usize> = (0..self.factors.len())
            .filter(|f| self.has_interaction(*f))
            .collect();
        let model = Model {
            values: values.iter().map(|v| (v - mean) / total.sqrt()).collect(),
            study: self,
            cells: interactions.iter().map(|f| self.cells(*f)).collect(),
            rows: self.rows(),
        };
        let logs = model.maximise();
        let variances: Vec<f64> = logs
            .iter()
            .map(|l| if *l <= LOWEST { 0.0 } else { l.exp() * total })
            .collect();
        let covariance = model.covariance(&logs);
        let mut names = vec![
            ("repeatability".to_string(), false),
            ("unit".to_string(), false),
        ];
        names.extend(self.factors.iter().map(|f| (f.0.clone(), true)));
        names.extend(
            interactions
                .iter()
                .map(|f| (format!("unit × {}", self.factors[*f].0), true)),
        );
        let sigma = |of: &dyn Fn(usize) -> bool| {
            let by = DVector::from_fn(
                variances.len(),
                |k, _| if of(k) { variances[k] } else { 0.0 },
            );
            let variance = by.sum();
            // Derivatives of a sum of variances by their logarithms are the variances.
            interval(variance, by.dot(&(&covariance * &by)))
        };
        let gage = Gage {
            repeatability: sigma(&|k| k == 0),
            reproducibility: sigma(&|k| k > 1),
            measurement: sigma(&|k| k != 1),
            units: sigma(&|k| k == 1),
            components: names
                .into_iter()
                .zip(&variances)
                .map(|((name, is_reproducibility), variance)| Component {
                    name,
                    variance: *variance,
                    is_reproducibility,
                })
                .collect(),
        };
        Some(gage)
    }

    /// Measurements of each unit.
    fn rows(&self) -> Vec<Vec<usize>> {
        let mut rows = vec![Vec::new(); self.units()];
        for (k, u) in self.unit.iter().enumerate() {
            rows[*u].push(k);
        }
        rows
    }
}

/// Standard deviation with an interval, of a variance and the variance of its estimate.
fn interval(variance: f64, of_estimate: f64) -> Sigma {
    let value = variance.max(0.0).sqrt();
    let dof = 2.0 * variance * variance / of_estimate;
    if !(variance > 0.0) || !(dof > 0.0) {
        return Sigma {
            value,
            lower: 0.0,
            upper: if variance > 0.0 {
                f64::INFINITY
            } else {
                f64::NAN
            },
        };
    }
    let quantile = |p: f64| ChiSquared::new(dof).map_or(f64::NAN, |d| d.inverse_cdf(p));
    Sigma {
        value,
        lower: (variance * dof / quantile(0.975)).sqrt(),
        upper: (variance * dof / quantile(0.025)).sqrt(),
    }
}

/// Logarithms of variances, of standard values, between which the maximum is sought. At the lowest a variance is zero.
const LOWEST: f64 = -18.0;
const HIGHEST: f64 = 5.0;
/// Sweeps over all variances, and the change that ends them.
const SWEEPS: usize = 100;
const CHANGE: f64 = 1e-7;

struct Model<'a> {
    values: Vec<f64>,
    study: &'a Study,
    /// Cells of each interaction.
    cells: Vec<Vec<usize>>,
    rows: Vec<Vec<usize>>,
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
    fn maximise(&self) -> Vec<f64> {
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
    fn covariance(&self, logs: &[f64]) -> DMatrix<f64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the AIAG's Measurement Systems Analysis, 4th edition, table III-B 1: ten parts, three trials of each of three appraisers.
    const AIAG: [[f64; 10]; 9] = [
        [
            0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36,
        ],
        [
            0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25,
        ],
        [
            0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31,
        ],
        [
            0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68,
        ],
        [
            0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62,
        ],
        [
            0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50,
        ],
        [
            0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49,
        ],
        [
            -0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77,
        ],
        [
            -0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16,
        ],
    ];

    fn aiag() -> (Vec<f64>, Vec<Vec<usize>>, Vec<Option<String>>) {
        let (mut values, mut units, mut appraisers) =
            (Vec::new(), vec![Vec::new(); 10], Vec::new());
        for (row, all) in AIAG.iter().enumerate() {
            for (part, value) in all.iter().enumerate() {
                units[part].push(values.len());
                values.push(*value);
                appraisers.push(Some(["A", "B", "C"][row / 3].to_string()));
            }
        }
        (values, units, appraisers)
    }

    #[test]
    fn the_example_of_the_aiag_has_its_published_components() {
        let (values, units, appraisers) = aiag();
        let factors = [
            ("operator".to_string(), appraisers.clone()),
            ("again".to_string(), appraisers),
        ];
        let (study, members) = Study::of(&units, &factors, 100).unwrap();
        assert_eq!(study.factors.len(), 1);
        assert_eq!(study.factors[0].0, "operator = again");
        let ordered: Vec<f64> = members.iter().map(|m| values[*m]).collect();
        let gage = study.fit(&ordered).unwrap();
        // Table A 4, with the interaction pooled: EV 0.199933, AV 0.226838, GRR 0.302373, PV 1.042327.
        let near = |found: f64, published: f64| {
            assert!((found - published).abs() < 2e-4, "{found} {published}")
        };
        near(gage.repeatability.value, 0.199_933);
        near(gage.reproducibility.value, 0.226_838);
        near(gage.measurement.value, 0.302_373);
        near(gage.units.value, 1.042_327);
        assert_eq!(gage.components[3].variance, 0.0, "{:?}", gage.components);
        // Error and interaction pooled have 78 degrees of freedom: 0.199933 times the roots of 78/chi-square.
        assert!(
            (gage.repeatability.lower / 0.173 - 1.0).abs() < 0.01,
            "{:?}",
            gage.repeatability
        );
        assert!(
            (gage.repeatability.upper / 0.2369 - 1.0).abs() < 0.01,
            "{:?}",
            gage.repeatability
        );
    }

    #[test]
    fn without_levels_within_units_all_scatter_is_repeatability() {
        let units = vec![vec![0, 1], vec![2, 3], vec![4, 5]];
        let shifts = ["a", "a", "b", "b", "a", "a"].map(|l| Some(l.to_string()));
        let (study, _) = Study::of(&units, &[("shift".into(), shifts.to_vec())], 100).unwrap();
        assert!(study.factors.is_empty());
        let gage = study.fit(&[1.0, 1.2, 3.0, 3.2, 2.0, 2.2]).unwrap();
        // Pairs that differ by 0.2 have a variance of 0.02.
        assert!(
            (gage.repeatability.value - 0.02f64.sqrt()).abs() < 1e-4,
            "{gage:?}"
        );
        assert_eq!(gage.reproducibility.value, 0.0);
        // Means 1.1, 3.1 and 2.1 have a variance of 1, of which repeatability explains 0.01.
        assert!((gage.units.value - 0.99f64.sqrt()).abs() < 1e-3, "{gage:?}");
    }
}
