//! Judges a dwell or turn by the others: what they predict for it, how surely, and what they determine without it.
//!
//! A robust fit names suspects, but does not convict them. With thirteen poses and nine parameters it follows nine of them closely, the scatter of
//! the others looks negligible, and a pose that alone has its end of an axis up is 14 sigma off. So each suspect is judged again by its studentised
//! deletion residual: its distance from the prediction of the others, over the standard deviation of that difference. This deviation contains the
//! uncertainty of their parameters and is estimated from their scatter, with Student's distribution for their degrees of freedom (Belsley, Kuh and
//! Welsch, 1980, section 2.1).

use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::factor::Factors;
use crate::quantity::Sensor;
use crate::signal::blocks::quantile;

/// An observation to judge: its error, the derivatives of the error by the parameters, and its variance by noise.
pub(super) struct Row {
    pub error: Vector3<f64>,
    pub by: DMatrix<f64>,
    pub variance: f64,
}

impl Row {
    /// The factors of a list by the parameters `free` of a triad.
    pub fn of(factors: &Factors, triad: (Sensor, &Affine<f64>), free: &[usize]) -> Vec<Self> {
        let values = factors.values(&[triad]);
        let (at, variances) = (factors.at(&values), factors.variances(&values));
        let row = |rows: Range<usize>| {
            let own = |i: usize, of: &dyn Fn(usize) -> f64| match i < rows.len() {
                true => of(rows.start + i),
                false => 0.0,
            };
            Self {
                error: Vector3::from_fn(|i, _| own(i, &|row| at.residuals[row])),
                by: DMatrix::from_fn(3, free.len(), |i, k| {
                    own(i, &|row| at.jacobian[(row, free[k])])
                }),
                variance: variances[rows.clone()].iter().sum::<f64>() / rows.len() as f64,
            }
        };
        factors.ranges().map(row).collect()
    }
}

/// Error and standard deviations of each of the first `judged` rows against the prediction of the others; `dimensions` is the
/// number of components that their errors have.
pub(super) fn against_others(
    rows: &[Row],
    judged: usize,
    dimensions: f64,
) -> Option<Vec<(f64, f64)>> {
    let parameters = rows.first()?.by.ncols();
    let mut weights: Vec<f64> = vec![1.0; rows.len()];
    // Median of the size of one, or two, normal components.
    let median = if dimensions < 1.5 { 0.6745 } else { 1.1774 };
    let mut found = Vec::new();
    for _ in 0..20 {
        let mut normal = DMatrix::zeros(parameters, parameters);
        let mut right = DVector::zeros(parameters);
        for (row, weight) in rows.iter().zip(&weights) {
            let weight = weight / row.variance;
            normal += row.by.tr_mul(&row.by) * weight;
            right += row.by.tr_mul(&row.error) * weight;
        }
        let scale = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
        let scaled = DMatrix::from_fn(parameters, parameters, |i, j| {
            normal[(i, j)] / (scale[i] * scale[j])
        });
        // The decomposition does not end if an element is not a number.
        if scaled.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let inverse = scaled.pseudo_inverse(1e-12).ok()?;
        let inverse = DMatrix::from_fn(parameters, parameters, |i, j| {
            inverse[(i, j)] / (scale[i] * scale[j])
        });
        let step = &inverse * right;
        let all = rows.iter().zip(&weights).map(|(row, weight)| {
            let left = row.error - &row.by * &step;
            let hat = &row.by * &inverse * row.by.transpose() * (weight / row.variance);
            let free = Matrix3::from_fn(|i, j| f64::from(u8::from(i == j)) - hat[(i, j)]);
            let inverse = free.try_inverse().unwrap_or_else(Matrix3::identity);
            // A row that alone determines a parameter has no prediction.
            let inverse = match inverse.trace() < 100.0 {
                true => inverse,
                false => Matrix3::identity(),
            };
            let left = inverse * Vector3::new(left[0], left[1], left[2]);
            let variance = row.variance * inverse.trace() / 3.0;
            (left.norm(), left.norm() / variance.sqrt())
        });
        found = all.collect();
        let typical = |part: &[(f64, f64)]| {
            let mut sizes: Vec<f64> = part.iter().map(|f| f.1).collect();
            quantile(&mut sizes, 0.5).unwrap_or(0.0)
        };
        // Both the judged rows and the others may scatter by more than their noise.
        let scales = [&found[..judged], &found[judged..]].map(|p| (typical(p) / median).max(1.0));
        for (k, (f, weight)) in found.iter_mut().zip(&mut weights).enumerate() {
            f.1 /= scales[usize::from(k >= judged)];
            *weight = 1.0 / (1.0 + (f.1 / 2.4).powi(2)) / scales[usize::from(k >= judged)].powi(2);
        }
    }
    found.truncate(judged);
    Some(found)
}

/// Probability that anything is left out of a whole recording without outliers. With 38 poses this is 4.7 sigma, below the limit of suspicion; with
/// thirteen, whose scatter has three degrees of freedom, 13.
const BY_CHANCE: f64 = 0.005;
/// Factor by which the standard deviation of a parameter may grow without what is left out. An observation with this much leverage (0.89) determines
/// the parameter nearly alone, and eight ninths of its own error go into the fit.
const GROWS: f64 = 3.0;

/// A suspect, judged by the others.
pub(super) struct Judged {
    /// Index of the row.
    pub row: usize,
    /// Distance from the prediction of the others, in the unit of the rows.
    pub error: f64,
    /// The same in standard deviations of that prediction.
    pub sigmas: f64,
    /// The parameter whose standard deviation would grow most without it, and by how many times; infinite if nothing else determines it.
    pub grows: (usize, f64),
}

impl Judged {
    /// Whether the others determine all parameters without it.
    pub fn can_be_spared(&self) -> bool {
        self.grows.1 <= GROWS
    }
}

/// Fit of some of the rows, linear about the values that the rows were computed at.
struct Others {
    step: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Variance over that by noise, of the judged rows and of the others; at least one.
    scale: [f64; 2],
    /// Degrees of freedom of the judged rows.
    dof: f64,
}

/// Inverse of a normal matrix; `None` if it leaves a parameter undetermined.
fn inverted(normal: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = normal.nrows();
    let scale = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
    let scaled = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] / (scale[i] * scale[j]));
    if scaled.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = scaled.symmetric_eigen();
    // A condition of 10⁵, from which on a fit is refused, is 10⁻¹⁰ here.
    if !(eigen.eigenvalues.min() > 1e-10 * eigen.eigenvalues.max()) {
        return None;
    }
    let inverse = &eigen.eigenvectors
        * DMatrix::from_diagonal(&eigen.eigenvalues.map(f64::recip))
        * eigen.eigenvectors.transpose();
    Some(DMatrix::from_fn(n, n, |i, j| {
        inverse[(i, j)] / (scale[i] * scale[j])
    }))
}

impl Others {
    /// The fit of all rows except `without`; `None` if these leave a parameter undetermined.
    fn of(rows: &[Row], judged: usize, dimensions: f64, without: &[usize]) -> Option<Self> {
        let kept = || {
            let all = rows.iter().enumerate();
            all.filter(|(k, _)| !without.contains(k))
        };
        let parameters = rows.first()?.by.ncols();
        let mut found = Self {
            step: DVector::zeros(parameters),
            covariance: DMatrix::zeros(parameters, parameters),
            scale: [1.0; 2],
            dof: 0.0,
        };
        for _ in 0..10 {
            let mut normal = DMatrix::zeros(parameters, parameters);
            let mut right = DVector::zeros(parameters);
            for (k, row) in kept() {
                let weight = 1.0 / (row.variance * found.scale[usize::from(k >= judged)]);
                normal += row.by.tr_mul(&row.by) * weight;
                right += row.by.tr_mul(&row.error) * weight;
            }
            found.covariance = inverted(&normal)?;
            found.step = &found.covariance * right;
            let mut squares = [0.0; 2];
            let mut dof = [0.0; 2];
            for (k, row) in kept() {
                let group = usize::from(k >= judged);
                squares[group] += (row.error - &row.by * &found.step).norm_squared() / row.variance;
                let hat = (&row.by * &found.covariance).component_mul(&row.by).sum();
                let of_row = if group == 0 { dimensions } else { 3.0 };
                dof[group] += of_row - hat / (row.variance * found.scale[group]);
            }
            found.dof = dof[0];
            let scale = [0, 1].map(|g| match dof[g] > 0.5 {
                true => (squares[g] / dof[g]).max(1.0),
                false => 1.0,
            });
            let settled = (0..2).all(|g| (scale[g] / found.scale[g] - 1.0).abs() < 1e-3);
            found.scale = scale;
            if settled {
                break;
            }
        }
        Some(found)
    }

    /// Judges a row outside them by their prediction.
    fn judge(&self, k: usize, row: &Row) -> Judged {
        let error = row.error - &row.by * &self.step;
        let error = Vector3::new(error[0], error[1], error[2]);
        let own = row.variance * self.scale[0];
        let by = &row.by * &self.covariance * row.by.transpose();
        let total = Matrix3::from_fn(|i, j| by[(i, j)] + if i == j { own } else { 0.0 });
        let squares = total
            .cholesky()
            .map_or(f64::NAN, |c| error.dot(&c.solve(&error)));
        // The covariance with this row, by the information that it adds.
        let inverse = total.try_inverse().unwrap_or_else(Matrix3::zeros);
        let gain = row
            .by
            .tr_mul(&DMatrix::from_fn(3, 3, |i, j| inverse[(i, j)]));
        let drop = &self.covariance * (&gain * &row.by) * &self.covariance;
        let grows = (0..self.step.len()).map(|p| {
            let without = self.covariance[(p, p)];
            (
                p,
                (without / (without - drop[(p, p)]).max(1e-12 * without)).sqrt(),
            )
        });
        Judged {
            row: k,
            error: error.norm(),
            sigmas: squares.sqrt(),
            grows: grows
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap_or((0, f64::INFINITY)),
        }
    }

    /// Whether a deletion residual of `sigmas` may be chance in a recording with `count` rows to judge.
    fn by_chance(&self, sigmas: f64, dimensions: f64, count: usize) -> bool {
        if !(self.dof >= 1.0) {
            return true;
        }
        let chance = match dimensions < 1.5 {
            true => StudentsT::new(0.0, 1.0, self.dof).map_or(1.0, |t| 2.0 * t.sf(sigmas)),
            // Half of the square has an F distribution with two degrees of freedom in the numerator, which has a closed form.
            false => (1.0 + sigmas * sigmas / self.dof).powf(-0.5 * self.dof),
        };
        chance * count as f64 > BY_CHANCE
    }
}

/// The `suspects`, worst first, that the other rows contradict. Each is judged by the fit without all suspects. If that fit leaves a parameter
/// undetermined, the least suspicious are trusted one by one.
pub(super) fn contradicted(
    rows: &[Row],
    judged: usize,
    dimensions: f64,
    suspects: &[usize],
) -> Vec<Judged> {
    let mut suspects = suspects.to_vec();
    while let Some(last) = suspects.last() {
        let Some(others) = Others::of(rows, judged, dimensions, &suspects) else {
            if suspects.len() == 1 {
                return vec![Judged {
                    row: *last,
                    error: f64::NAN,
                    sigmas: f64::NAN,
                    grows: (0, f64::INFINITY),
                }];
            }
            suspects.pop();
            continue;
        };
        let each = suspects.iter().map(|k| others.judge(*k, &rows[*k]));
        return each
            .filter(|j| !others.by_chance(j.sigmas, dimensions, judged))
            .collect();
    }
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(error: f64, by: [f64; 2], variance: f64) -> Row {
        Row {
            error: Vector3::new(error, 0.0, 0.0),
            by: DMatrix::from_fn(3, 2, |i, j| if i == 0 { by[j] } else { 0.0 }),
            variance,
        }
    }

    /// Rows of a mean, with fixed errors, and of a slope, with the given errors and variances.
    fn rows(slope: &[(f64, f64)]) -> Vec<Row> {
        let mean = (0..12).map(|k| row([0.9, -1.1, 1.0, -0.8][k % 4], [1.0, 0.0], 1.0));
        let slope = slope.iter().map(|(e, v)| row(*e, [1.0, 1.0], *v));
        mean.chain(slope).collect()
    }

    #[test]
    fn what_alone_determines_a_parameter_cannot_be_spared() {
        let alone = rows(&[(50.0, 1.0)]);
        let found = contradicted(&alone, alone.len(), 1.0, &[12]);
        assert!(found.iter().all(|j| !j.can_be_spared()) && found.len() == 1);
        // Nearly alone: a second row determines the slope ten times worse.
        let nearly = rows(&[(80.0, 1.0), (0.5, 100.0)]);
        let found = contradicted(&nearly, nearly.len(), 1.0, &[12]);
        assert!(
            found.len() == 1 && !found[0].can_be_spared(),
            "{:?}",
            found[0].grows
        );
        assert_eq!(found[0].grows.0, 1);
        // If others determine the slope as well, it can be spared.
        let both = rows(&[(80.0, 1.0), (0.5, 1.0), (-0.4, 1.0)]);
        let found = contradicted(&both, both.len(), 1.0, &[12]);
        assert!(found.len() == 1 && found[0].can_be_spared());
    }

    #[test]
    fn few_others_contradict_only_what_is_far_beyond_their_scatter() {
        // Four rows of a mean and two of another scatter by 1, with four degrees of freedom: 8 proves nothing, 40 does.
        let four = |last: f64| -> Vec<Row> {
            let errors = [1.0, -1.0, 0.8, -0.8, last];
            let all = errors.iter().map(|e| row(*e, [1.0, 0.0], 1e-4));
            // Other rows determine the second parameter.
            let other = [0.01, -0.01].map(|e| row(e, [0.0, 1.0], 1e-4));
            other.into_iter().chain(all).collect()
        };
        let judged = |last: f64| contradicted(&four(last), 7, 1.0, &[6]).len();
        assert_eq!((judged(8.0), judged(40.0)), (0, 1));
    }

    #[test]
    fn the_error_of_a_suspect_is_that_against_a_fit_without_it() {
        let all = rows(&[(80.0, 1.0), (0.5, 1.0), (-0.4, 1.0)]);
        let found = contradicted(&all, all.len(), 1.0, &[12]);
        // The mean of the deviations of the two other slopes.
        assert!(
            (found[0].error - (80.0 - 0.05)).abs() < 1e-9,
            "{}",
            found[0].error
        );
        // Its own variance and that of their mean, scaled by the scatter of all.
        let squares = 3.0 * (0.9f64.powi(2) + 1.1f64.powi(2) + 1.0 + 0.8f64.powi(2));
        let within = squares + 2.0 * 0.45f64.powi(2);
        let scale = (within / 12.0).max(1.0);
        let expected = (80.0 - 0.05) / (1.5 * scale).sqrt();
        assert!((found[0].sigmas / expected - 1.0).abs() < 1e-9);
    }
}
