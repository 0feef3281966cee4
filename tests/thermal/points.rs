//! Curves through estimates at single temperatures: the second stage of the estimators of the literature.

use mimu::quantity::Sensor;
use mimu::signal::blocks::extent;
use mimu_thermal::basis::{Basis, Shape};
use mimu_thermal::curves::TriadCurves;
use mimu_thermal::regression::{CurveKind, Normal, Problem};
use mimu_thermal::smoothness::{Penalties, TriadFit, fixed, largest};
use nalgebra::{DMatrix, DVector, Vector3};

/// Forward model at one temperature: P by rows, then b, raw per SI and raw, with variances.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    /// °C of the thermometer.
    pub temp_c: f64,
    /// The twelve numbers.
    pub numbers: [f64; 12],
    /// Their variances.
    pub variances: [f64; 12],
}

/// Curves of `shape` through `points`, each number by itself by weighted least squares. `None` with fewer points than a curve has
/// numbers.
pub fn curves(sensor: Sensor, points: &[Point], shape: Shape) -> Option<TriadCurves> {
    let range_c = extent(points.iter().map(|p| p.temp_c));
    let basis = Basis::new(shape, range_c);
    if points.len() < basis.free() + 1 || !(range_c[0] < range_c[1]) {
        return None;
    }
    let mean = |k: usize| points.iter().map(|p| p.numbers[k]).sum::<f64>() / points.len() as f64;
    let problem = Problem {
        sensor,
        rows: Vec::new(),
        gain: Vector3::from_fn(|i, _| mean(3 * i + i).abs()),
        null: Vector3::from_fn(|i, _| mean(9 + i)),
        bases: CurveKind::ALL.map(|_| basis.clone()),
        offsets: 1,
        headings: 0,
        biases_only: false,
        samples: 1.0,
        taken_off: 0.0,
    };
    let normals = [0, 1, 2].map(|axis| normal(&problem, axis, points));
    // The penalty matters only where points are missing. It is the weakest that data sheets allow.
    let penalties = Penalties::of(&problem);
    let fit: TriadFit = fixed(&problem, &penalties, &normals, &largest(&problem))?;
    Some(TriadCurves::of_one(problem, fit, range_c))
}

fn normal(problem: &Problem, axis: usize, points: &[Point]) -> Normal {
    let n = problem.columns(axis);
    let mut gram = DMatrix::zeros(n, n);
    let mut with = DVector::zeros(n);
    let mut squares = 0.0;
    for part in problem.parts(axis) {
        let number = part.input.map_or(9 + axis, |i| 3 * axis + i);
        let basis = problem.basis(part.kind);
        let null = if part.input.is_none() {
            problem.null[axis]
        } else {
            0.0
        };
        for p in points {
            let value = (p.numbers[number] - null) / problem.gain[axis];
            let weight = problem.gain[axis].powi(2) / p.variances[number];
            let (from, v) = basis.values(p.temp_c);
            let used = 4.min(basis.functions() - from);
            for i in 0..used {
                let a = part.from + from + i;
                with[a] += weight * v[i] * value;
                for j in 0..used {
                    gram[(a, part.from + from + j)] += weight * v[i] * v[j];
                }
            }
            squares += weight * value * value;
        }
    }
    Normal {
        gram,
        with,
        squares,
        log_det: 0.0,
        rows: points.len() as f64,
        earth_precision: 1.0,
    }
}
