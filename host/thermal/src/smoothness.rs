//! How smooth the curves of a triad are: restricted maximum likelihood (REML).
//!
//! A curve is a line plus a function that bends. The second derivative of that function has the variance τ² per kelvin, which is the
//! Bayesian interpretation of the penalty ∫f''²/τ² (Wahba 1978). Its fourth derivative has another variance. Most sensors have nearly cubic
//! curves, and with the first variance alone the estimates waver about them: the error of the biases was 1.6 times its bound, and is 1.2
//! times with both. The variances are estimated for each [`CurveKind`] of a triad from all of its axes, by the fixed point of Fellner and
//! Schall in the form of Wood and Fasiolo (2017), within the limits of data sheets.

use mimu::quantity::Sensor;
use mimu::signal::blocks::extent;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::basis::Shape;
use crate::regression::{CurveKind, Normal, Problem};

/// Departure from a line over 100 K that no data sheet of a MEMS sensor exceeds: bias (SI), scale factor, cross terms (ratios).
const GYRO_DEPARTURE: [f64; 3] = [0.05, 0.05, 0.02];
const ACCEL_DEPARTURE: [f64; 3] = [0.5, 0.02, 0.02];
/// Smallest variances, as shares of the largest: there a curve is a line, or a cubic, to all digits that matter. If one penalty were
/// stiffer than the other by many more orders of magnitude, rounding would erase the other.
const NONE: [f64; 2] = [1e-10, 1e-8];
/// Steps of the fixed point from any start, and from the smoothness of a nearby lag. The criterion is at its minimum there, so the
/// remaining error enters only squared.
pub const ITERATIONS: [usize; 2] = [60, 20];
const TOLERANCE: f64 = 5e-2;

/// Variances of the second and fourth derivatives, by kind: SI²/K³ or 1/K³, and SI²/K⁷ or 1/K⁷.
pub type Smoothness = [[f64; 2]; 3];

/// `smoothness` with all variances times `factor`.
pub fn times(smoothness: &Smoothness, factor: f64) -> Smoothness {
    smoothness.map(|pair| pair.map(|s| s * factor))
}

/// Largest variances that data sheets allow.
pub fn largest(problem: &Problem) -> Smoothness {
    let departure = match (problem.sensor, problem.biases_only) {
        // The scale of raw readings is unknown: their range bounds the departure.
        (_, true) => [range(problem); 3],
        (Sensor::Gyro, _) => GYRO_DEPARTURE,
        (Sensor::Accel, _) => ACCEL_DEPARTURE,
    };
    // The integral of a random walk that is zero at both ends has the variance τ² L³/48 or less in between. The contribution of the fourth
    // derivative has a far higher bound: a bend within a tenth of the range is not a cubic.
    departure.map(|d| [48.0 * d * d / 1e6, 48.0 * d * d / 1e6 / 1e4])
}

fn range(problem: &Problem) -> f64 {
    let spans = (0..3).map(|k| {
        let [low, high] = extent(problem.rows.iter().map(|r| r.reading[k]));
        high - low
    });
    spans.fold(f64::MIN_POSITIVE, f64::max)
}

/// Estimates of one axis.
#[derive(Debug, Clone)]
pub struct AxisFit {
    /// Coefficients, in the columns of the regression.
    pub coefficients: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
}

/// Estimates of a triad for one lag.
#[derive(Debug, Clone)]
pub struct TriadFit {
    /// Estimates of the three axes.
    pub axes: [AxisFit; 3],
    /// Smoothness with which they were estimated.
    pub smoothness: Smoothness,
    /// Minus twice the logarithm of the likelihood, up to a constant, for comparing lags.
    pub criterion: f64,
    /// The same of each axis.
    pub by_axis: [f64; 3],
}

/// The penalties, one pair of matrices per kind, and the same without the free lines.
pub struct Penalties {
    whole: [[DMatrix<f64>; 2]; 3],
    bending: [[DMatrix<f64>; 2]; 3],
}

impl Penalties {
    /// From the bases of `problem`.
    pub fn of(problem: &Problem) -> Self {
        let whole = CurveKind::ALL.map(|kind| problem.basis(kind).penalties());
        let bending = CurveKind::ALL.map(|kind| {
            let pair = &whole[kind as usize];
            let basis = problem.basis(kind);
            if basis.shape() != Shape::Spline {
                return [DMatrix::zeros(0, 0), DMatrix::zeros(0, 0)];
            }
            let eigen = pair[0].clone().symmetric_eigen();
            let mut order: Vec<usize> = (0..basis.functions()).collect();
            order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
            let bent = &order[..basis.functions() - basis.free()];
            let across = eigen.eigenvectors.select_columns(bent);
            [0, 1].map(|k| across.tr_mul(&(&pair[k] * &across)))
        });
        Self { whole, bending }
    }

    /// Prior precision of a curve of kind `k`.
    fn precision(&self, k: usize, variances: &[f64; 2]) -> DMatrix<f64> {
        &self.whole[k][0] / variances[0] + &self.whole[k][1] / variances[1]
    }

    /// Logarithm of its determinant, and the traces of its inverse times each penalty; lines left out.
    fn determinant(&self, k: usize, variances: &[f64; 2]) -> Option<(f64, [f64; 2])> {
        let [second, fourth] = &self.bending[k];
        if second.is_empty() {
            return Some((0.0, [0.0; 2]));
        }
        let factor = Cholesky::new(second / variances[0] + fourth / variances[1])?;
        let traces = [second, fourth].map(|s| factor.solve(s).trace());
        Some((log_det(&factor), traces))
    }
}

fn log_det(factor: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * factor
        .l_dirty()
        .diagonal()
        .iter()
        .map(|d| d.ln())
        .sum::<f64>()
}

/// Penalised least squares of one axis.
pub struct Solved {
    /// Coefficients.
    pub coefficients: DVector<f64>,
    /// Sum of squares of the residuals, plus the penalty.
    pub left: f64,
    /// The other terms of minus twice the logarithm of the restricted likelihood.
    pub determinants: f64,
    factor: Cholesky<f64, Dyn>,
}

/// One axis for given smoothness. `None` if the rows do not determine it.
pub fn solve(
    problem: &Problem,
    penalties: &Penalties,
    axis: usize,
    normal: &Normal,
    smoothness: &Smoothness,
) -> Option<Solved> {
    let mut matrix = normal.gram.clone();
    let mut determinants = normal.log_det;
    for part in problem.parts(axis) {
        let basis = problem.basis(part.kind);
        if basis.shape() != Shape::Spline {
            continue;
        }
        let (n, k) = (basis.functions(), part.kind as usize);
        let mut block = matrix.view_mut((part.from, part.from), (n, n));
        block += penalties.precision(k, &smoothness[k]);
        determinants -= penalties.determinant(k, &smoothness[k])?.0;
    }
    for column in problem.earth_columns(axis) {
        matrix[(column, column)] += normal.earth_precision;
    }
    let factor = Cholesky::new(matrix)?;
    let coefficients = factor.solve(&normal.with);
    determinants += log_det(&factor);
    let left = normal.squares - normal.with.dot(&coefficients);
    (determinants.is_finite() && left.is_finite()).then_some(Solved {
        coefficients,
        left,
        determinants,
        factor,
    })
}

/// Best smoothness for `normals`, searched from `start` in at most `iterations` steps, and the estimates with it. `None` if the rows do not
/// determine them.
pub fn fit(
    problem: &Problem,
    penalties: &Penalties,
    normals: &[Normal; 3],
    (start, iterations): (&Smoothness, usize),
) -> Option<TriadFit> {
    let most = largest(problem);
    let bounded = |k: usize, i: usize, v: f64| v.clamp(NONE[i] * most[k][i], most[k][i]);
    let mut smoothness: Smoothness =
        std::array::from_fn(|k| [0, 1].map(|i| bounded(k, i, start[k][i])));
    for _ in 0..iterations {
        let next = step(problem, penalties, normals, &smoothness)?;
        let mut change = 0f64;
        for (k, pair) in smoothness.iter_mut().enumerate() {
            for (i, s) in pair.iter_mut().enumerate() {
                // A factor of a hundred at once is enough for any start, and does not overshoot to a bound.
                let near = next[k][i].clamp(1e-2 * *s, 1e2 * *s);
                let new = bounded(k, i, near);
                change = change.max((new / *s).ln().abs());
                *s = new;
            }
        }
        if change < TOLERANCE {
            break;
        }
    }
    fixed(problem, penalties, normals, &smoothness)
}

/// Estimates with the smoothness given.
pub fn fixed(
    problem: &Problem,
    penalties: &Penalties,
    normals: &[Normal; 3],
    smoothness: &Smoothness,
) -> Option<TriadFit> {
    let mut by_axis = [0.0; 3];
    let mut axes = Vec::with_capacity(3);
    for (axis, normal) in normals.iter().enumerate() {
        let solved = solve(problem, penalties, axis, normal, smoothness)?;
        by_axis[axis] = solved.left + solved.determinants - of_lines(problem, axis, normal)?;
        axes.push(AxisFit {
            coefficients: solved.coefficients,
            covariance: solved.factor.inverse(),
        });
    }
    Some(TriadFit {
        axes: axes.try_into().ok()?,
        smoothness: *smoothness,
        criterion: by_axis.iter().sum(),
        by_axis,
    })
}

/// Logarithm of the determinant of the information on the lines that are free.
///
/// It is removed from the criterion. A die that lags covers a smaller range, over which slopes per kelvin are less certain, and a flat
/// prior on slopes would count that in favour of a long lag. Instead all changes over the range are equally likely a priori.
fn of_lines(problem: &Problem, axis: usize, normal: &Normal) -> Option<f64> {
    let parts = problem.parts(axis);
    let free: usize = parts
        .iter()
        .map(|p| problem.basis(p.kind).lines().ncols())
        .sum();
    let offsets = problem.offsets - 1;
    let n = problem.columns(axis);
    let mut lines = DMatrix::zeros(n, free + offsets);
    let mut column = 0;
    for part in parts {
        let of_part = problem.basis(part.kind).lines();
        let (rows, columns) = of_part.shape();
        lines
            .view_mut((part.from, column), (rows, columns))
            .copy_from(&of_part);
        column += columns;
    }
    for k in 0..offsets {
        lines[(n - offsets + k, column + k)] = 1.0;
    }
    let information = lines.tr_mul(&(&normal.gram * &lines));
    Some(log_det(&Cholesky::new(information)?))
}

/// One step of the fixed point: the bending of the curves over their degrees of freedom to bend.
fn step(
    problem: &Problem,
    penalties: &Penalties,
    normals: &[Normal; 3],
    smoothness: &Smoothness,
) -> Option<Smoothness> {
    let (mut bend, mut freedom) = ([[0.0; 2]; 3], [[0.0; 2]; 3]);
    for (axis, normal) in normals.iter().enumerate() {
        let solved = solve(problem, penalties, axis, normal, smoothness)?;
        let covariance = solved.factor.inverse();
        for part in problem.parts(axis) {
            let basis = problem.basis(part.kind);
            if basis.shape() != Shape::Spline {
                continue;
            }
            let (k, n) = (part.kind as usize, basis.functions());
            let own = solved.coefficients.rows(part.from, n);
            let known = covariance.view((part.from, part.from), (n, n));
            let (_, prior) = penalties.determinant(k, &smoothness[k])?;
            for i in 0..2 {
                let penalty = &penalties.whole[k][i];
                bend[k][i] += own.dot(&(penalty * own));
                let posterior: f64 = penalty.component_mul(&known).sum();
                freedom[k][i] += (prior[i] - posterior) / smoothness[k][i];
            }
        }
    }
    Some(std::array::from_fn(|k| {
        [0, 1].map(|i| match freedom[k][i] > 1e-9 {
            true => bend[k][i] / freedom[k][i],
            false => smoothness[k][i],
        })
    }))
}
