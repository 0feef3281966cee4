//! The search finds optima that are known from elsewhere, and designs are judged as by hand calculation.

mod next_experiment;
mod population;
#[allow(dead_code)] // the tables of the papers use the rest
#[path = "../../../../../tests/papers/published.rs"]
mod published;
mod schemes;
mod sphere;
mod time;

use mimu::plan::design::Problem;
use mimu::plan::design::reach::{Fixture, RateList};
use mimu_recording::Reference;
use nalgebra::Vector3;

fn accel(reference: Reference) -> Problem {
    Problem::accel(reference, Fixture::ThreeAxis).unwrap()
}

fn gyro(rates: &str) -> Problem {
    let rates: RateList = rates.parse().unwrap();
    let span = Vector3::repeat(rates.largest_dps.to_radians());
    Problem::gyro(span, Fixture::ThreeAxis, rates.rates).unwrap()
}

/// Whether two figures agree to a relative difference.
fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}
