//! Least squares whose errors are alike within pieces of time and independent between them.
//!
//! What a body's triads disagree by in motion lasts for seconds: a stamp that jitters, a field that differs by place, a carrier that bends. A covariance from the noise of
//! samples would be too small by factors. Here it comes from leaving out one cluster after the other (the jackknife, one Gauss-Newton step each): it asks only
//! that clusters are independent, and gives the error of each cluster by a fit without it for nothing.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

/// Sums over the residuals of a piece of time.
#[derive(Debug, Clone)]
struct Cluster {
    normal: DMatrix<f64>,
    gradient: DVector<f64>,
    squares: f64,
    rows: f64,
}

impl Cluster {
    /// Without residuals, by so many parameters.
    fn empty(n: usize) -> Self {
        Self {
            normal: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            squares: 0.0,
            rows: 0.0,
        }
    }
}

/// Normal equations, cluster by cluster. Residuals are observed less modelled, derivatives those of the model.
#[derive(Debug, Clone)]
pub(crate) struct Clusters {
    list: Vec<Cluster>,
    /// Precisions of what is known of the parameters beforehand, and what it pulls them by.
    known: DVector<f64>,
    pull: DVector<f64>,
}

/// Solution of the normal equations.
#[derive(Debug, Clone)]
pub(crate) struct Solution {
    /// Gauss-Newton step.
    pub step: DVector<f64>,
    /// Covariance by the jackknife.
    pub covariance: DMatrix<f64>,
    /// Covariance for weights that are reciprocal variances of independent residuals.
    pub by_weights: DMatrix<f64>,
    /// Degrees of freedom of `covariance`: clusters that move the solution about equally.
    pub dof: f64,
    /// By cluster: mean of the weighted squares of its residuals by the solution without it; NaN if it is empty or the others do not determine the parameters.
    pub held_out: Vec<f64>,
}

impl Solution {
    /// Rms of the weighted residuals of the clusters that are `used`, each by the solution without it.
    pub fn unseen(&self, used: &[bool]) -> f64 {
        let own = self.held_out.iter().zip(used);
        let own = own.filter(|(held, used)| **used && held.is_finite());
        let own: Vec<f64> = own.map(|(held, _)| *held).collect();
        (own.iter().sum::<f64>() / own.len() as f64).sqrt()
    }
}

impl Clusters {
    /// So many clusters, and parameters that are now at `at`. `known`: standard deviations of what is known beforehand around zero, infinite for nothing.
    pub fn new(count: usize, at: &DVector<f64>, known: &DVector<f64>) -> Self {
        let n = at.len();
        let precision = known.map(|sigma| sigma.powi(-2));
        Self {
            list: vec![Cluster::empty(n); count],
            pull: -precision.component_mul(at),
            known: precision,
        }
    }

    /// Adds a residual with its derivatives and weight.
    pub fn add(&mut self, cluster: usize, residual: f64, by: &DVector<f64>, weight: f64) {
        let Cluster {
            normal,
            gradient,
            squares,
            rows,
        } = &mut self.list[cluster];
        normal.syger(weight, by, by, 1.0);
        gradient.axpy(weight * residual, by, 1.0);
        *squares += weight * residual * residual;
        *rows += 1.0;
    }

    /// Adds to the gradient of a cluster what noise of the regressors takes from it.
    pub fn correct(&mut self, cluster: usize, by: &DVector<f64>) {
        self.list[cluster].gradient += by;
    }

    /// The same with clusters joined to `count`: `into` gives the number of each, or leaves it out.
    pub fn joined(&self, count: usize, into: impl Fn(usize) -> Option<usize>) -> Self {
        let mut joined = Self {
            list: vec![Cluster::empty(self.known.len()); count],
            known: self.known.clone(),
            pull: self.pull.clone(),
        };
        for (g, of) in self.list.iter().enumerate() {
            let Some(own) = into(g).and_then(|k| joined.list.get_mut(k)) else {
                continue;
            };
            own.normal += &of.normal;
            own.gradient += &of.gradient;
            own.squares += of.squares;
            own.rows += of.rows;
        }
        joined
    }

    /// The same with some parameters, which are now at `at`, known to be zero.
    pub fn without(&self, parameters: Range<usize>, at: &DVector<f64>) -> Self {
        let mut held = self.clone();
        for k in parameters {
            let seen: f64 = self.list.iter().map(|of| of.normal[(k, k)]).sum();
            held.known[k] = HELD * seen;
            held.pull[k] = -held.known[k] * at[k];
        }
        held
    }

    /// Solves for the clusters that are `used`; `None` if they do not determine the parameters.
    pub fn solve(&self, used: &[bool]) -> Option<Solution> {
        let n = self.known.len();
        let (mut normal, mut gradient) = (DMatrix::from_diagonal(&self.known), self.pull.clone());
        for (cluster, _) in self.list.iter().zip(used).filter(|(_, used)| **used) {
            normal += &cluster.normal;
            gradient += &cluster.gradient;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let by_weights = inverse(&normal)?;
        let step = &by_weights * &gradient;
        let mut moves = Vec::new();
        let mut held_out = Vec::new();
        for (cluster, used) in self.list.iter().zip(used) {
            let mut own = cluster.normal.clone();
            own.fill_upper_triangle_with_lower_triangle();
            // Its gradient at the solution.
            let left = &cluster.gradient - &own * &step;
            let squares =
                cluster.squares - 2.0 * step.dot(&cluster.gradient) + step.dot(&(&own * &step));
            let without = match used {
                true => inverse(&(&normal - &own)),
                false => Some(by_weights.clone()),
            };
            let Some(without) = without.filter(|_| cluster.rows > 0.0) else {
                held_out.push(f64::NAN);
                continue;
            };
            let moved = match used {
                true => -(&without * &left),
                false => DVector::zeros(n),
            };
            let error = squares - 2.0 * moved.dot(&left) + moved.dot(&(&own * &moved));
            held_out.push(error.max(0.0) / cluster.rows);
            if *used {
                moves.push(moved);
            }
        }
        let (covariance, dof) = jackknife(&normal, moves.into_iter());
        Some(Solution {
            step,
            covariance,
            by_weights,
            dof,
            held_out,
        })
    }

    /// The step from the solution, at which these sums were formed, to that of the clusters for which `used` holds.
    pub fn moved(&self, used: impl Fn(usize) -> bool) -> Option<DVector<f64>> {
        let (mut normal, mut gradient) = (DMatrix::from_diagonal(&self.known), self.pull.clone());
        for (_, cluster) in self.list.iter().enumerate().filter(|(g, _)| used(*g)) {
            normal += &cluster.normal;
            gradient += &cluster.gradient;
        }
        normal.fill_upper_triangle_with_lower_triangle();
        Some(inverse(&normal)? * gradient)
    }
}

/// Covariance by the moves of the solution without each part, and its degrees of freedom. Of parts that move the solution unequally only the large ones count:
/// those are Satterthwaite's of the sum of their moves, measured by `normal`.
fn jackknife(
    normal: &DMatrix<f64>,
    moves: impl Iterator<Item = DVector<f64>>,
) -> (DMatrix<f64>, f64) {
    let n = normal.nrows();
    let mut covariance = DMatrix::zeros(n, n);
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for moved in moves {
        covariance.ger(1.0, &moved, &moved, 1.0);
        let size = moved.dot(&(normal * &moved));
        (count, sum, squares) = (count + 1.0, sum + size, squares + size * size);
    }
    covariance *= (count - 1.0) / count;
    let dof = (sum * sum / squares - 1.0).clamp(1.0, f64::max(count - 1.0, 1.0));
    (covariance, dof)
}

/// Precision of a parameter that is known, in that by which the data show it.
const HELD: f64 = 1e9;
/// Smallest eigenvalue of the matrix with a unit diagonal that is inverted. Rounding leaves 1e-16 of it.
const SINGULAR: f64 = 1e-11;

/// Inverse of a positive definite matrix whose rows may have very different scales; `None` if it is singular.
pub(crate) fn inverse(of: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = of.diagonal().map(|d| d.sqrt().recip());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(of.nrows(), of.ncols(), |i, j| {
        of[(i, j)] * scale[i] * scale[j]
    });
    let eigen = scaled.symmetric_eigen();
    if !(eigen.eigenvalues.min() > SINGULAR) {
        return None;
    }
    let vectors = eigen.eigenvectors;
    let middle = DMatrix::from_diagonal(&eigen.eigenvalues.map(f64::recip));
    let inverse = &vectors * middle * vectors.transpose();
    Some(DMatrix::from_fn(of.nrows(), of.ncols(), |i, j| {
        inverse[(i, j)] * scale[i] * scale[j]
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::tests::normal as noise;

    /// A line through residuals of 40 clusters of ten, each with an error in common: its slope and the standard deviation of that.
    fn line(seed: usize) -> (f64, f64) {
        let zero = DVector::zeros(2);
        let mut clusters = Clusters::new(40, &zero, &DVector::repeat(2, f64::INFINITY));
        for g in 0..40 {
            for k in 0..10 {
                let x = g as f64 / 20.0 - 1.0;
                let error = 0.3 * noise(seed * 40 + g) + 0.1 * noise(seed * 400 + 10 * g + k + 77);
                clusters.add(g, 2.0 * x + error, &DVector::from_vec(vec![x, 1.0]), 1.0);
            }
        }
        let solution = clusters.solve(&[true; 40]).unwrap();
        (solution.step[0], solution.covariance[(0, 0)].sqrt())
    }

    #[test]
    fn errors_in_common_to_a_cluster_widen_the_interval_to_what_holds() {
        let runs: Vec<_> = (0..200).map(line).collect();
        let inside = runs
            .iter()
            .filter(|(slope, s)| (slope - 2.0).abs() < 2.02 * s);
        let share = inside.count() as f64 / 200.0;
        assert!((0.91..=0.985).contains(&share), "{share}");
    }

    #[test]
    fn a_cluster_is_judged_by_a_solution_without_it() {
        let zero = DVector::zeros(1);
        let mut clusters = Clusters::new(3, &zero, &DVector::repeat(1, f64::INFINITY));
        for (g, y) in [1.0, 2.0, 6.0].into_iter().enumerate() {
            clusters.add(g, y, &DVector::repeat(1, 1.0), 1.0);
        }
        let solution = clusters.solve(&[true; 3]).unwrap();
        assert!((solution.step[0] - 3.0).abs() < 1e-12);
        for (held, expected) in solution.held_out.iter().zip([9.0, 2.25, 20.25]) {
            assert!((held - expected).abs() < 1e-9, "{held}");
        }
        // The variance of a mean.
        assert!((solution.covariance[(0, 0)] - 14.0 / 6.0).abs() < 1e-9);
    }

    #[test]
    fn parameters_that_nothing_determines_are_told() {
        let zero = DVector::zeros(2);
        let mut clusters = Clusters::new(1, &zero, &DVector::repeat(2, f64::INFINITY));
        clusters.add(0, 1.0, &DVector::from_vec(vec![1.0, 1.0]), 1.0);
        clusters.add(0, 1.0, &DVector::from_vec(vec![2.0, 2.0]), 1.0);
        assert!(clusters.solve(&[true]).is_none());
    }
}
