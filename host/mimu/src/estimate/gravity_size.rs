//! Accelerometer calibration from the magnitude of gravity alone, over many poses.
//!
//! At rest `|C u + o| = g` in every pose (references 14 of fang and 19 of xu, among many). A rotation of the whole leaves
//! every size as it is, so the frame has to be chosen: C is lower triangular with a positive diagonal,
//! that is, the body frame has its x axis along the sensor x and its xy plane through the sensor y, fang (13) with
//! `Mp = 1`. Nine parameters, and at least nine poses; which way an axis is positive cannot be seen
//! from sizes either and is taken from the raw readings.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::least_squares::{Linearized, Observability, excess_variance, minimize};
use super::{Estimated, Failure, Observation};
use crate::observable::Observable;
use crate::quantity::AXES;
use crate::quantity::plural;
use crate::triad::{Covariance, Part, Triad};

/// Number of parameters: six of C, three of o.
pub const PARAMETERS: usize = 9;

/// Row and column of the six elements of C.
const LOWER: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

/// Readings in units in which a perfect sensor has C = 1 and o = 0.
struct Sphere {
    centre: Vector3<f64>,
    radius: f64,
}

impl Sphere {
    /// Sphere through the readings by linear least squares.
    fn through(observations: &[Observation]) -> Option<Self> {
        let mean =
            observations.iter().map(|o| o.raw).sum::<Vector3<f64>>() / observations.len() as f64;
        let unit = observations
            .iter()
            .map(|o| (o.raw - mean).norm())
            .fold(0.0, f64::max);
        let at = |i: usize| (observations[i].raw - mean) / unit;
        let a = DMatrix::from_fn(observations.len(), 4, |i, j| {
            if j == 3 { 1.0 } else { 2.0 * at(i)[j] }
        });
        let y = DVector::from_fn(observations.len(), |i, _| at(i).norm_squared());
        let x = a.svd(true, true).solve(&y, 1e-12).ok()?;
        let centre = Vector3::new(x[0], x[1], x[2]);
        let radius = (x[3] + centre.norm_squared()).sqrt();
        (radius.is_finite() && radius > 0.0).then_some(Self {
            centre: mean + centre * unit,
            radius: radius * unit,
        })
    }
}

/// Extent of the readings across a plane over that along it, below which they lie in it.
const FLAT: f64 = 0.01;

/// The axis that the plane through the readings is across, if they lie in one: some sensor has not seen gravity.
fn flat(observations: &[Observation]) -> Option<usize> {
    let mean = observations.iter().map(|o| o.raw).sum::<Vector3<f64>>() / observations.len() as f64;
    let products = observations
        .iter()
        .map(|o| (o.raw - mean) * (o.raw - mean).transpose());
    let eigen = products.sum::<Matrix3<f64>>().symmetric_eigen();
    let thin = eigen.eigenvalues.imin();
    // All readings equal are flat too.
    (eigen.eigenvalues[thin] <= FLAT * FLAT * eigen.eigenvalues.max())
        .then(|| eigen.eigenvectors.column(thin).iamax())
}

/// First guess, by the sphere through the readings: one scale factor for all axes. `None` if they lie on none.
pub fn first_guess(observations: &[Observation], gravity: f64) -> Option<Affine<f64>> {
    let sphere = Sphere::through(observations)?;
    let matrix = Matrix3::from_diagonal_element(gravity / sphere.radius);
    Some(Affine {
        matrix,
        offset: -(matrix * sphere.centre),
    })
}

/// Fits C and o to `|C u + o| = gravity` (m/s²) over all observations.
///
/// `variances` are those of the sizes by noise, (m/s²)², one for each observation.
pub fn estimate(
    observations: &[Observation],
    variances: &[f64],
    gravity: f64,
) -> Result<Estimated, Failure> {
    let n = observations.len();
    if n < PARAMETERS {
        return Err(Failure::Undetermined {
            parameters: format!(
                "{} of the {PARAMETERS} accelerometer parameters",
                PARAMETERS - n
            ),
            add: format!(
                "{} can be used, and without a table at least {PARAMETERS} different ones are needed: add poses, each axis up and down and between",
                plural(n as u64, "still pose")
            )
            .into(),
        });
    }
    if let Some(axis) = flat(observations) {
        let axis = AXES[axis];
        return Err(Failure::Undetermined {
            parameters: format!("what the sensor {axis} measures"),
            add: format!(
                "all poses lie in one plane across {axis}: add poses with {axis} up, down and slanted, and check that the column accel_{axis} is what it says"
            )
            .into(),
        });
    }
    let sphere = Sphere::through(observations)
        .ok_or_else(|| Failure::NoSolution("the dwell means do not lie on a sphere".into()))?;
    let v: Vec<Vector3<f64>> = observations
        .iter()
        .map(|o| (o.raw - sphere.centre) / sphere.radius)
        .collect();
    let unpack = |p: &DVector<f64>| {
        let mut c = Matrix3::zeros();
        for (k, place) in LOWER.iter().enumerate() {
            c[*place] = p[k];
        }
        (c, Vector3::new(p[6], p[7], p[8]))
    };
    // All in units of gravity, so that parameters and columns are of order one.
    let evaluate = |p: &DVector<f64>, variances: &[f64]| {
        let (c, o) = unpack(p);
        let mut out = Linearized {
            residuals: DVector::zeros(n),
            jacobian: DMatrix::zeros(n, PARAMETERS),
        };
        for i in 0..n {
            let f = c * v[i] + o;
            let weight = variances[i].sqrt().recip();
            let up = f / f.norm();
            out.residuals[i] = weight * (f.norm() - 1.0);
            for (k, (row, column)) in LOWER.iter().enumerate() {
                out.jacobian[(i, k)] = weight * up[*row] * v[i][*column];
            }
            for k in 0..3 {
                out.jacobian[(i, 6 + k)] = weight * up[k];
            }
        }
        out
    };
    // A noiseless recording has none; any positive number weighs all poses alike then.
    let floor = (1e-12 * variances.iter().copied().fold(0.0, f64::max)).max(1e-24);
    let variances: Vec<f64> = variances
        .iter()
        .map(|v| (v / (gravity * gravity)).max(floor))
        .collect();
    let lost =
        || Failure::NoSolution("the fit to the magnitude of gravity does not converge".into());
    let start = DVector::from_vec(vec![1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let shape = Observability::of(&evaluate(&start, &vec![1.0; n]).jacobian);
    if !shape.is_complete() {
        return Err(undetermined(&shape));
    }
    let first = minimize(start.clone(), |p| evaluate(p, &vec![1.0; n]));
    // Where nothing holds the angles between the sensors, the fit runs off towards C = 0 and |o| = g, which fits every pose.
    let Some((mut p, _)) = first.filter(|(p, _)| is_triad(&unpack(p).0)) else {
        let weak = weak_beside_scatter(&start, |p| evaluate(p, &vec![1.0; n]));
        return Err(weak.map_or_else(lost, |shape| undetermined(&shape)));
    };
    let dof = (n - PARAMETERS) as f64;
    let mut scatter = excess_variance(&[], &[], dof);
    let mut chi2 = None;
    for _ in 0..30 {
        let weights: Vec<f64> = variances.iter().map(|x| x + scatter.excess).collect();
        (p, _) = minimize(p, |p| evaluate(p, &weights)).ok_or_else(lost)?;
        let residuals: Vec<f64> = evaluate(&p, &vec![1.0; n])
            .residuals
            .iter()
            .copied()
            .collect();
        let before = scatter.excess;
        scatter = excess_variance(&residuals, &variances, dof);
        chi2.get_or_insert(scatter.chi2);
        if (scatter.excess - before).abs() <= 1e-6 * before {
            break;
        }
    }
    let weights: Vec<f64> = variances.iter().map(|x| x + scatter.excess).collect();
    let last = evaluate(&p, &weights);
    let shape = Observability::of(&evaluate(&p, &vec![1.0; n]).jacobian);
    if !shape.is_complete() {
        return Err(undetermined(&shape));
    }
    let covariance = (last.jacobian.transpose() * &last.jacobian)
        .try_inverse()
        .ok_or_else(|| Failure::NoSolution("the normal matrix is singular".into()))?;

    // Back: x = g (C' (u - centre)/radius + o').
    let (mut c, mut o) = unpack(&p);
    let scale = gravity / sphere.radius;
    let mut change = SMatrix::<f64, 12, 9>::zeros();
    for (k, (row, column)) in LOWER.iter().enumerate() {
        change[(3 * row + column, k)] = scale;
        change[(9 + row, k)] = -scale * sphere.centre[*column];
    }
    for k in 0..3 {
        change[(9 + k, 6 + k)] = gravity;
    }
    let nine = SMatrix::<f64, 9, 9>::from_fn(|i, j| covariance[(i, j)]);
    let covariance: Covariance = change * nine * change.transpose();
    // A row's sign cannot be seen: the raw reading decides, and flipping rows keeps sizes. What must not
    // happen is a negative diagonal, which the start (the unit matrix) makes all but impossible.
    let mut flips = SVector::<f64, 12>::repeat(1.0);
    for row in 0..3 {
        if c[(row, row)] < 0.0 {
            c.row_mut(row).neg_mut();
            o[row] = -o[row];
            for k in 0..3 {
                flips[3 * row + k] = -1.0;
            }
            flips[9 + row] = -1.0;
        }
    }
    let flips = SMatrix::from_diagonal(&flips);
    let matrix = c * scale;
    let inverse = Affine {
        matrix,
        offset: o * gravity - matrix * sphere.centre,
    };
    // From units of gravity to m/s².
    scatter.excess *= gravity * gravity;
    scatter.chi2 = chi2.unwrap_or(scatter.chi2);
    let triad = Triad::from_inverse(
        inverse,
        vec![Part {
            covariance: flips * covariance * flips,
            dof: scatter.variance_dof(),
        }],
    )
    .ok_or_else(|| Failure::NoSolution("C is singular".into()))?;
    Ok(Estimated {
        triad,
        scatter: vec![(Observable::Magnitude, scatter)],
        condition: shape.condition,
        delays: None,
        notes: Vec::new(),
    })
}

/// Off-diagonal over diagonal element of C from which on this is no triad: 30 degrees from a right angle.
const SKEWED: f64 = 0.5;

/// Sigma, in units of gravity, from which on a parameter is not measured: 3 degrees, 5 %, 0.05 g. Assembly is better.
const USELESS_SIGMA: f64 = 0.05;

fn is_triad(c: &Matrix3<f64>) -> bool {
    let mut off_diagonal = LOWER.iter().filter(|(i, j)| i != j);
    off_diagonal.all(|&(i, j)| c[(i, j)].abs() < SKEWED * c[(i, i)].abs())
}

/// The parameters that the poses determine, but not beside their own scatter: six faces up to a degree or two. Scatter is
/// that of scale factors and biases alone, which six faces do determine.
fn weak_beside_scatter(
    start: &DVector<f64>,
    evaluate: impl Fn(&DVector<f64>) -> Linearized,
) -> Option<Observability> {
    let by_axis: Vec<usize> = (0..PARAMETERS)
        .filter(|k| LOWER.get(*k).is_none_or(|(i, j)| i == j))
        .collect();
    let full = |q: &DVector<f64>| {
        let mut p = start.clone();
        for (k, value) in by_axis.iter().zip(q.iter()) {
            p[*k] = *value;
        }
        p
    };
    let first = DVector::from_fn(by_axis.len(), |k, _| start[by_axis[k]]);
    let (q, at) = minimize(first, |q| {
        let all = evaluate(&full(q));
        Linearized {
            jacobian: all.jacobian.select_columns(&by_axis),
            residuals: all.residuals,
        }
    })?;
    let dof = at
        .residuals
        .len()
        .checked_sub(by_axis.len())
        .filter(|d| *d > 0)?;
    let variance = at.residuals.norm_squared() / dof as f64;
    let design = evaluate(&full(&q)).jacobian;
    let covariance = (design.transpose() * &design).try_inverse()? * variance;
    let undetermined: Vec<_> = (0..PARAMETERS)
        .map(|k| (k, covariance[(k, k)].sqrt()))
        .filter(|(_, sigma)| *sigma > USELESS_SIGMA)
        .collect();
    (!undetermined.is_empty()).then(|| Observability {
        undetermined,
        ..Observability::of(&design)
    })
}

fn undetermined(shape: &Observability) -> Failure {
    let name = |k: usize| match LOWER.get(k) {
        Some((i, j)) => format!("C_{}{}", AXES[*i], AXES[*j]),
        None => format!("o_{}", AXES[k - 6]),
    };
    let names: Vec<String> = shape.undetermined.iter().map(|(k, _)| name(*k)).collect();
    // An axis that nothing distinguishes from the others is where the poses are missing.
    let weak: Vec<&str> = (0..3)
        .filter(|a| {
            shape
                .undetermined
                .iter()
                .any(|(k, _)| *k == 6 + a || LOWER.get(*k) == Some(&(*a, *a)))
        })
        .map(|a| AXES[a])
        .collect();
    let add = if weak.is_empty() {
        "add poses between the axes (two or three axes off the vertical at once)".to_string()
    } else {
        format!("add poses with {} up, down and slanted", weak.join(", "))
    };
    Failure::Undetermined {
        parameters: names.join(", "),
        add: add.into(),
    }
}
