//! The estimators of the papers as they are published, for comparison with least squares.

use mimu::estimate::Observation;
use mimu::estimate::known_input::least_squares;
use mimu::triad::Forward;
use mimu_core::compensation::Affine;
use mimu_core::kalman::Filter;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// An estimator of an inverse model.
pub type Estimator = fn(&[Observation]) -> Affine<f64>;

/// Least squares of `mimu`, in the inverse direction.
pub fn inverse_by_least_squares(dwells: &[Observation]) -> Affine<f64> {
    let found = least_squares(dwells, &[], None).expect("determined");
    found.triad.inverse
}

/// The classical six positions: scale factor `(u⁺ - u⁻) / (x⁺ - x⁻)` and bias of each sensor from the two inputs along it, without misalignments.
pub fn six_positions(dwells: &[Observation]) -> Forward {
    let mut found = Forward {
        matrix: Matrix3::zeros(),
        bias: Vector3::zeros(),
    };
    for axis in 0..3 {
        let [up, down] = [1.0, -1.0].map(|sign| {
            let own = dwells.iter().find(|o| sign * o.input[axis] > 0.9);
            own.expect("six faces")
        });
        let scale = (up.raw[axis] - down.raw[axis]) / (up.input[axis] - down.input[axis]);
        found.matrix[(axis, axis)] = scale;
        found.bias[axis] =
            0.5 * (up.raw[axis] + down.raw[axis] - scale * (up.input[axis] + down.input[axis]));
    }
    found
}

/// fang (23)-(28): a filter for each axis, fed the dwells that are chosen for it.
pub fn kalman(dwells: &[Observation], chosen: &[Vec<usize>; 3]) -> Forward {
    let mut found = Forward {
        matrix: Matrix3::zeros(),
        bias: Vector3::zeros(),
    };
    for (axis, chosen) in chosen.iter().enumerate() {
        let mut filter = Filter::<f64>::diffuse(dwells[0].variance[axis], 1.0);
        for &k in chosen {
            let o = &dwells[k];
            filter
                .update(&o.input, o.raw[axis], o.variance[axis])
                .expect("finite");
        }
        let mean = filter.mean();
        found.bias[axis] = mean[0];
        for j in 0..3 {
            found.matrix[(axis, j)] = mean[j + 1];
        }
    }
    found
}

/// xu (3)-(11): C from the differences of opposite rates, o from the readings at rest.
pub fn opposite_rates(dwells: &[Observation]) -> Affine<f64> {
    let mut free: Vec<&Observation> = dwells.iter().collect();
    let (mut pairs, mut rest) = (Vec::new(), Vec::new());
    while let Some(first) = free.pop() {
        let sum = |o: &&Observation| (o.input + first.input).norm();
        match free.iter().position(|o| sum(o) < 1e-9) {
            _ if first.input.norm() < 1e-9 => rest.push(first),
            Some(opposite) => pairs.push((first, free.swap_remove(opposite))),
            None => {}
        }
    }
    let differences = |of: fn(&Observation) -> Vector3<f64>| {
        DMatrix::from_fn(pairs.len(), 3, |i, j| of(pairs[i].0)[j] - of(pairs[i].1)[j])
    };
    let matrix = regression(&differences(|o| o.raw), &differences(|o| o.input));
    let at_rest = rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / rest.len() as f64;
    Affine {
        offset: -matrix * at_rest,
        matrix,
    }
}

/// xu (12)-(16): C and o by least squares of the known forces over the readings.
pub fn inverse_form(dwells: &[Observation]) -> Affine<f64> {
    let n = dwells.len();
    let mean = |of: fn(&Observation) -> Vector3<f64>| {
        dwells.iter().map(of).sum::<Vector3<f64>>() / n as f64
    };
    let (raw, input) = (mean(|o| o.raw), mean(|o| o.input));
    let about = |of: fn(&Observation) -> Vector3<f64>, mean: Vector3<f64>| {
        DMatrix::from_fn(n, 3, |i, j| of(&dwells[i])[j] - mean[j])
    };
    let matrix = regression(&about(|o| o.raw, raw), &about(|o| o.input, input));
    Affine {
        offset: input - matrix * raw,
        matrix,
    }
}

/// The matrix that makes `known` of `readings`, row by row, in the sense of least squares.
fn regression(readings: &DMatrix<f64>, known: &DMatrix<f64>) -> Matrix3<f64> {
    let normal = readings.tr_mul(readings).try_inverse().expect("regular");
    let transposed = normal * readings.tr_mul(known);
    Matrix3::from_fn(|i, j| transposed[(j, i)])
}
