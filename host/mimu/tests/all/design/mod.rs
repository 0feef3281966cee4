//! The search finds optima that are known from elsewhere, and designs are judged as by hand calculation.

mod next_experiment;
mod population;
mod schemes;
mod sphere;
mod time;

use mimu::plan::design::Problem;
use mimu::plan::design::model::{Model, Terms};
use mimu::plan::design::reach::{Fixture, RateList};
use mimu_recording::Reference;
use nalgebra::Vector3;

fn terms(list: &str) -> Terms {
    list.parse().unwrap()
}

fn accel(reference: Reference, list: &str) -> Problem {
    Problem::accel(Model::accel(reference, &terms(list)), Fixture::ThreeAxis).unwrap()
}

fn gyro(list: &str, rates: &str) -> Problem {
    let rates: RateList = rates.parse().unwrap();
    let span = Vector3::repeat(rates.largest_dps.to_radians());
    Problem::gyro(
        Model::gyro(&terms(list), span),
        Fixture::ThreeAxis,
        rates.rates,
    )
    .unwrap()
}

/// Whether two figures agree to a relative difference.
fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}
