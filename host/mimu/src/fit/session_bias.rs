//! The biases of a session, with the matrix known from another. A unit at rest in a chamber shows no more than these, and biases differ after every
//! power-on.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::estimate::least_squares::{Errors, Group, Scatter, Solution, solve_groups};
use crate::estimate::{Estimated, Failure, Observation, earth_shared};
use crate::observable::Observable;
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::Sensor;
use crate::triad::{Covariance, Part, Triad};
use crate::warning::Warning;
use mimu_recording::Reference;

/// Iterations for magnitudes: from a bias of a tenth of gravity the third changes nothing.
const STEPS: usize = 6;

/// Inverse model of `sensor` with the matrix of `known` and the biases of `prepared`, raw to SI.
///
/// If the input is known, and for a gyro at rest, by the mean error of each axis. For an accelerometer by the magnitude of gravity: a single pose
/// does not show the bias across gravity, which then stays that of `known`.
///
/// At rest the input of a gyro is the Earth's rate, so that the bias is the sensor's at any latitude and in any pose. `accel` (raw to m/s²) shows the
/// vertical; without it, and for the component that depends on the heading, the Earth's rate widens the intervals.
pub fn estimate(
    prepared: &Prepared,
    sensor: Sensor,
    known: &Affine<f64>,
    accel: Option<&Affine<f64>>,
) -> Result<Estimated, Failure> {
    let at_rest = sensor == Sensor::Gyro && prepared.manifest.reference != Reference::Table;
    let observations = match at_rest {
        true => prepared.at_rest_on_the_ground(accel),
        false => prepared.observations(sensor),
    };
    let none = || Failure::NoSolution("no dwell can be used".into());
    if observations.is_empty() {
        return Err(none());
    }
    let by_size = prepared.manifest.reference == Reference::Gravity && sensor == Sensor::Accel;
    let found = match by_size {
        true => by_magnitudes(prepared, known),
        false => by_inputs(&observations, known),
    };
    let Biases {
        offset,
        covariance,
        scatter,
    } = found.ok_or_else(none)?;
    let matrix = known.matrix;
    let dof = scatter.iter().map(|s| s.1.variance_dof());
    let known = scatter.iter().map(|s| s.1.known);
    let part = Part {
        covariance,
        dof: dof.fold(f64::INFINITY, f64::min),
        known: known.fold(1.0, f64::min),
    };
    let triad = Triad::from_inverse(Affine { matrix, offset }, vec![part])
        .ok_or_else(|| Failure::NoSolution("the given matrix is singular".into()))?;
    let earth = earth_shared::numbers(&observations, &triad.forward.matrix);
    Ok(Estimated {
        earth,
        notes: vec![Warning::MatrixGiven {
            with_intervals: false,
        }],
        ..Estimated::new(triad, scatter, 1.0)
    })
}

/// Biases with their scatter.
struct Biases {
    offset: Vector3<f64>,
    /// Of the twelve numbers of the inverse model.
    covariance: Covariance,
    scatter: Vec<(Observable, Scatter)>,
}

/// Biases of an accelerometer by the magnitude of gravity.
fn by_magnitudes(prepared: &Prepared, known: &Affine<f64>) -> Option<Biases> {
    let mut model = *known;
    let mut last: Option<(Solution, Scatter)> = None;
    let mut kept = DMatrix::zeros(3, 0);
    for _ in 0..STEPS {
        let (factors, _) = prepared.magnitudes(&model);
        let values = factors.values(&[(Sensor::Accel, &model)]);
        let at = factors.at(&values);
        let design = at.jacobian.columns(9, 3).into_owned();
        // Directions of the bias that the poses show.
        let svd = design.clone().svd(false, true);
        let shown = svd.v_t?;
        let strong: Vec<usize> = (0..svd.singular_values.len())
            .filter(|k| svd.singular_values[*k] > 0.05 * svd.singular_values.max())
            .collect();
        kept = shown.select_rows(&strong).transpose();
        let (solution, found) = solve_groups(&[Group {
            design: &design * &kept,
            observations: -at.residuals,
            errors: Errors::Independent(factors.variances(&values).into()),
        }])?;
        let step = &kept * &solution.parameters;
        model.offset += Vector3::new(step[0], step[1], step[2]);
        last = Some((solution, found[0]));
    }
    let (solution, found) = last?;
    let full = &kept * solution.covariance * kept.transpose();
    let mut covariance = Covariance::zeros();
    covariance
        .fixed_view_mut::<3, 3>(9, 9)
        .copy_from(&Matrix3::from_fn(|i, j| full[(i, j)]));
    Some(Biases {
        offset: model.offset,
        covariance,
        scatter: vec![(Observable::Magnitude, found)],
    })
}

/// Biases by the mean error of each axis against known inputs.
fn by_inputs(observations: &[Observation], known: &Affine<f64>) -> Option<Biases> {
    let matrix = known.matrix;
    let mut found = Biases {
        offset: known.offset,
        covariance: Covariance::zeros(),
        scatter: Vec::new(),
    };
    for axis in 0..3 {
        let n = observations.len();
        let y = DVector::from_fn(n, |i, _| {
            observations[i].input[axis] - (matrix.row(axis) * observations[i].raw)[(0, 0)]
        });
        let mut variances = DVector::from_fn(n, |i, _| {
            si_covariance(&matrix, &observations[i].variance)[(axis, axis)]
        });
        let in_si = Matrix3::identity();
        let factor = earth_shared::factor(observations, axis, &in_si, &mut variances);
        let (solution, scatter) = solve_groups(&[Group {
            design: DMatrix::from_element(n, 1, 1.0),
            observations: y,
            errors: match factor.ncols() {
                0 => Errors::Independent(variances),
                _ => Errors::Shared(variances, factor),
            },
        }])?;
        found.offset[axis] = solution.parameters[0];
        found.covariance[(9 + axis, 9 + axis)] = solution.covariance[(0, 0)];
        found.scatter.push((Observable::Axis(axis), scatter[0]));
    }
    Some(found)
}
