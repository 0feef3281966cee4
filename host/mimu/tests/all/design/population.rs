//! Designs beside the population of a unit's kind, against formulas of this file.

use mimu::plan::design::Problem;
use mimu::plan::design::judgement::Judgement;
use mimu::plan::design::model::Setting;
use mimu::plan::design::population::Population;
use mimu::plan::design::reach::Fixture;
use mimu::prior::{Prior, PriorTable};
use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::{RawUnit, Reference};
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

use super::close;

const G: f64 = 9.80665;
/// Scale factors in counts per m/s², sines of the angles between the axes, biases in counts.
const MEAN: [f64; 9] = [
    1600.0, 1700.0, 1650.0, 0.03, -0.02, 0.05, 3000.0, -2000.0, 5000.0,
];
const SIZES: [f64; 9] = [16.0, 14.0, 13.0, 4e-3, 5e-3, 3e-3, 300.0, 350.0, 280.0];

type Nine = SVector<f64, 9>;

/// Covariance of a population whose scale factors correlate by a half.
fn covariance(size: f64) -> DMatrix<f64> {
    let correlation = |i: usize, j: usize| match (i, j) {
        _ if i == j => 1.0,
        (0..3, 0..3) => 0.5,
        _ => 0.0,
    };
    DMatrix::from_fn(9, 9, |i, j| {
        size * size * correlation(i, j) * SIZES[i] * SIZES[j]
    })
}

fn prior(covariance: &DMatrix<f64>) -> Prior {
    let of = [0, 1, 2, 6, 7, 8, 9, 10, 11];
    let table = PriorTable::new(Sensor::Accel, RawUnit::Count, 50, &of, &MEAN, covariance);
    let tables = PerSensor {
        gyro: None,
        accel: Some(table),
    };
    Prior::new("test".into(), RawUnit::Count, Reference::Gravity, tables)
}

fn by_hand() -> Problem {
    Problem::accel(Reference::Gravity, Fixture::Hand).unwrap()
}

fn beside(prior: &Prior, sigma: f64) -> Problem {
    let population = Population::of(prior, "kind.toml").unwrap();
    by_hand().beside(population, sigma, 0.0).unwrap()
}

/// `P = K Mo`, `Mo` of unit rows, and the bias: docs/estimation, written out here.
fn unit(t: &Nine) -> (Matrix3<f64>, Vector3<f64>) {
    let [yz, zy, zx] = [t[3].sin(), t[4].sin(), t[5].sin()];
    let mo = Matrix3::new(
        1.0,
        0.0,
        0.0,
        yz,
        (1.0 - yz * yz).sqrt(),
        0.0,
        -zy,
        zx,
        (1.0 - zy * zy - zx * zx).sqrt(),
    );
    let k = Matrix3::from_diagonal(&Vector3::new(t[0], t[1], t[2]));
    (k * mo, Vector3::new(t[6], t[7], t[8]))
}

/// Derivatives of `of` by the nine parameters at the mean, by central differences.
fn slopes<const N: usize>(of: impl Fn(&Nine) -> SVector<f64, N>) -> SMatrix<f64, N, 9> {
    let mean = Nine::from(MEAN);
    let mut by = SMatrix::<f64, N, 9>::zeros();
    for k in 0..9 {
        let mut step = Nine::zeros();
        step[k] = 1e-3 * SIZES[k];
        by.set_column(
            k,
            &((of(&(mean + step)) - of(&(mean - step))) / (2.0 * step[k])),
        );
    }
    by
}

/// Sigmas of `(1 + D) x + d` in the order C_xx, C_yx, C_yy, C_zx, C_zy, C_zz, o of a fit with the population, from the definition of a reading.
fn expected(settings: &[Setting], sigma: f64, covariance: &DMatrix<f64>) -> [f64; 9] {
    let (p0, b0) = unit(&MEAN.into());
    let covariance = SMatrix::<f64, 9, 9>::from_fn(|i, j| covariance[(i, j)]);
    let mut information = covariance.try_inverse().unwrap();
    for setting in settings {
        let reading = p0 * setting.up * G + b0;
        let row = slopes(|t| {
            let (p, b) = unit(t);
            SVector::<f64, 1>::new((p.try_inverse().unwrap() * (reading - b)).norm())
        });
        information += row.transpose() * row / (sigma * sigma);
    }
    let to_design = slopes(|t| {
        let (p, b) = unit(t);
        let inverse = p.try_inverse().unwrap();
        let (d, o) = (inverse * p0, inverse * (b0 - b));
        Nine::from([
            d[(0, 0)],
            d[(1, 0)],
            d[(1, 1)],
            d[(2, 0)],
            d[(2, 1)],
            d[(2, 2)],
            o[0],
            o[1],
            o[2],
        ])
    });
    let posterior = to_design * information.try_inverse().unwrap() * to_design.transpose();
    std::array::from_fn(|k| posterior[(k, k)].sqrt())
}

fn sigmas(judged: &Judgement) -> [f64; 9] {
    std::array::from_fn(|k| judged.parameters[k].sigma * judged.parameters[k].parameter.si)
}

#[test]
fn sigmas_are_those_of_a_fit_by_the_definition_of_a_reading() {
    let (sigma, covariance) = (2e-3, covariance(1.0));
    let problem = beside(&prior(&covariance), sigma);
    for n in [0, 3, 6, 9, 12] {
        let settings = match n {
            0 => Vec::new(),
            _ => problem.best(n, 1).unwrap(),
        };
        let judged = sigmas(&problem.judge(&settings, sigma));
        for (k, (judged, expected)) in judged
            .iter()
            .zip(expected(&settings, sigma, &covariance))
            .enumerate()
        {
            assert!(
                close(*judged, expected, 1e-4),
                "{n}, {k}: {judged} {expected}"
            );
        }
    }
}

#[test]
fn the_search_finds_the_best_three_poses_of_all() {
    let sigma = 2e-3;
    let problem = beside(&prior(&covariance(1.0)), sigma);
    let found = problem.log_det(&problem.best(3, 1).unwrap());
    let plain = problem.reach.plain();
    let mut most = f64::NEG_INFINITY;
    for i in 0..plain.len() {
        for j in i..plain.len() {
            for k in j..plain.len() {
                most = most.max(problem.log_det(&[plain[i], plain[j], plain[k]]));
            }
        }
    }
    assert!((found - most).abs() < 1e-9, "{found} {most}");
}
