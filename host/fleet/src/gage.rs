//! Repeatability and reproducibility (Gage R&R): which share of the differences between measurements the measurement itself makes.
//!
//! A value of unit i, measured by operator j (or on fixture j, or on day j), is `y = μ + u_i + f_j + (uf)_ij + e`, all of them random: the model of the AIAG's Measurement Systems
//! Analysis, 4th edition, appendix A, with any number of such factors. Variances are estimated by restricted maximum likelihood, which for complete
//! crossed experiments gives the table of the analysis of variance with negative components left out, and needs no complete experiment. Repeatability is e; reproducibility the factors and
//! their interactions with units. The intervals of repeatability and of units are those of a chi-square distribution with the degrees of freedom of the information matrix
//! (Satterthwaite 1946). Those of sums are by modified large samples (Graybill and Wang 1980): three operators have two degrees of freedom, however many the
//! repetitions have, and Satterthwaite's interval of their sum held 82 % of 210.

mod reml;

use mimu::nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use reml::{LOWEST, Model};

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
        // Of the logarithm of a variance with n degrees of freedom the variance is 2/n.
        let repeated = 2.0 / covariance[(0, 0)];
        let gage = Gage {
            repeatability: sigma(&|k| k == 0),
            reproducibility: self.sum(&variances, &interactions, repeated, false),
            measurement: self.sum(&variances, &interactions, repeated, true),
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

    /// Reproducibility, or with repeatability all that the measurement scatters by. Its interval is that of a sum of mean squares, of each factor over the measurements
    /// of a level and of each interaction over those of a cell: a component that is estimated as zero has one too. `repeated`: degrees of freedom of repeatability.
    fn sum(&self, variances: &[f64], interactions: &[usize], repeated: f64, all: bool) -> Sigma {
        let factors = self.factors.len();
        let levels = |of: &[usize]| {
            let mut own = of.to_vec();
            own.sort_unstable();
            own.dedup();
            own.len() as f64
        };
        let (count, units) = (self.unit.len() as f64, self.units() as f64);
        let mut squares = Vec::new();
        let mut own = f64::from(u8::from(all));
        for (f, (_, of)) in self.factors.iter().enumerate() {
            let m = levels(of);
            let mut square = variances[2 + f] + variances[0] * m / count;
            own -= m / count;
            if let Some(k) = interactions.iter().position(|i| *i == f) {
                let (cells, interaction) = (levels(&self.cells(f)), variances[2 + factors + k]);
                let rest = 1.0 - m / cells;
                square += interaction * m / cells;
                squares.push([
                    rest,
                    interaction + variances[0] * cells / count,
                    (cells - m - units + 1.0).max(1.0),
                ]);
                own -= rest * cells / count;
            }
            squares.push([1.0, square, m - 1.0]);
        }
        squares.push([own, variances[0], repeated]);
        modified_large_samples(&squares)
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
    // The variance of the estimate underflows where copies of one file repeat exactly; the distribution has no such limit.
    if dof == f64::INFINITY {
        return Sigma {
            value,
            lower: value,
            upper: value,
        };
    }
    let quantile = |p: f64| ChiSquared::new(dof).map_or(f64::NAN, |d| d.inverse_cdf(p));
    Sigma {
        value,
        lower: (variance * dof / quantile(0.975)).sqrt(),
        upper: (variance * dof / quantile(0.025)).sqrt(),
    }
}

/// Root of a sum of independent mean squares, each with its weight, value and degrees of freedom, with its interval.
fn modified_large_samples(squares: &[[f64; 3]]) -> Sigma {
    let sum: f64 = squares
        .iter()
        .map(|[weight, square, _]| weight * square)
        .sum();
    let reach = |upper: bool| {
        let each = squares.iter().map(|[weight, square, dof]| {
            let p = if upper == (*weight > 0.0) {
                0.025
            } else {
                0.975
            };
            let quantile = ChiSquared::new(*dof).map_or(*dof, |d| d.inverse_cdf(p));
            (weight * square * (dof / quantile - 1.0)).powi(2)
        });
        each.sum::<f64>().sqrt()
    };
    let root = |variance: f64| variance.max(0.0).sqrt();
    Sigma {
        value: root(sum),
        lower: root(sum - reach(false)),
        upper: root(sum + reach(true)),
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
    fn an_exact_variance_has_no_width() {
        let exact = interval(4.0, 0.0);
        assert_eq!((exact.value, exact.lower, exact.upper), (2.0, 2.0, 2.0));
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
    fn the_interval_of_the_measurement_holds_as_often_as_it_says_with_three_operators() {
        // Normal numbers by Box and Muller from a sequence of Weyl, hashed.
        let mut state = 1_u64;
        let mut even = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut normal =
            || (-2.0 * (1.0 - even()).ln()).sqrt() * (std::f64::consts::TAU * even()).cos();
        let studies = 200;
        for between in [0.0, 0.3, 1.0] {
            let mut held = 0;
            for _ in 0..studies {
                let (mut values, mut units, mut operators) = (Vec::new(), Vec::new(), Vec::new());
                let shift = [0; 3].map(|_| between * normal());
                for _ in 0..10 {
                    let unit = 3.0 * normal();
                    units.push((values.len()..values.len() + 6).collect());
                    for k in 0..6 {
                        values.push(unit + shift[k % 3] + normal());
                        operators.push(Some((k % 3).to_string()));
                    }
                }
                let (study, _) = Study::of(&units, &[("operator".into(), operators)], 100).unwrap();
                let found = study.fit(&values).unwrap().measurement;
                let truth = 1.0_f64.hypot(between);
                held += u32::from(found.lower <= truth && truth <= found.upper);
            }
            let share = f64::from(held) / f64::from(studies);
            // 200 studies scatter by 1.5 %. The method is known to hold slightly more than it says.
            assert!((0.92..=0.995).contains(&share), "{between}: {share}");
        }
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
