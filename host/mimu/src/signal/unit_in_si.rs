//! Whether readings that are declared as SI are in SI: compares them with what they measure, at rest and over known inputs.

use mimu_recording::{Manifest, RawUnit, Reference};

use crate::quantity::{Figure, Sensor};
use crate::readable::STANDARD_GRAVITY;
use crate::signal::blocks::quantile;
use crate::signal::dwell::Dwell;
use crate::warning::Warning;

/// Readings in SI with a gain beyond this, or below its inverse, have a wrong unit or time base: sensors are within ten per cent.
pub(crate) const GAIN: f64 = 1.3;
/// No gyro's bias is larger, rad/s: 40 deg/s, twice what the data sheet of an MPU-6050 allows.
const LARGEST_BIAS: f64 = 0.7;

/// The warning about readings that should be in SI and are `scale` times their input; `figure` is the figure of the fit that gave `scale`.
pub(crate) fn wrong_gain(
    sensor: Sensor,
    scale: f64,
    gravity_mps2: f64,
    figure: Figure,
) -> Option<Warning> {
    warning(sensor, false, scale, gravity_mps2, figure)
}

/// As [`wrong_gain`], also for readings at rest: these include biases, so `scale` differs from the scale factors of a fit.
fn warning(
    sensor: Sensor,
    at_rest: bool,
    scale: f64,
    gravity_mps2: f64,
    figure: Figure,
) -> Option<Warning> {
    if (1.0 / GAIN..GAIN).contains(&scale) {
        return None;
    }
    let near = |factor: f64| (0.8..1.25).contains(&(scale / factor));
    let rpm = |ratio: f64| (0.95..1.05).contains(&(scale / ratio));
    let degrees = 180.0 / std::f64::consts::PI;
    let by_turns = figure == Figure::Direction;
    let cause = match sensor {
        Sensor::Gyro if near(degrees) => "they are in deg/s, and SI is rad/s",
        Sensor::Gyro if near(degrees.recip()) && by_turns => {
            "they were converted from deg/s to rad/s twice"
        }
        Sensor::Gyro if near(degrees.recip()) => {
            "the ref_ columns are not in deg/s, or the readings were converted to rad/s twice"
        }
        Sensor::Gyro if figure == Figure::RateMagnitude && rpm(200.0 / 270.0) => {
            "was the turntable at 33 1/3 rpm while the rate of 45 rpm is given?"
        }
        Sensor::Gyro if figure == Figure::RateMagnitude && rpm(270.0 / 200.0) => {
            "was the turntable at 45 rpm while the rate of 33 1/3 rpm is given?"
        }
        Sensor::Gyro if by_turns && near(1000.0) => "the time stamps are in ms, and must be in s",
        // The gyro is integrated over the turns: time stamps that run twice as fast halve the scale factor.
        Sensor::Gyro if by_turns && (0.1..10.0).contains(&scale) => {
            "check the time stamps and the unit: if the stamps or the sample rate are wrong by this factor, so is every integrated angle"
        }
        Sensor::Accel if near(1.0 / gravity_mps2) => "they are in g, and SI is m/s²",
        Sensor::Accel if near(1000.0 / gravity_mps2) => "they are in mg, and SI is m/s²",
        Sensor::Accel if near(gravity_mps2) => "they were multiplied by gravity twice",
        _ => "check the unit, and the range that the part was set to",
    };
    Some(
        Warning::NotSi {
            at_rest,
            times: scale,
            cause,
        }
        .of(sensor),
    )
}

/// Sensors have the scale factor of their unit to within this share.
const OF_UNIT: f64 = 0.1;

/// The warning about fractions that are declared as counts, if `scale`, their number per SI unit, is that of a unit. Whole numbers are counts
/// whatever their scale: many drivers give mg or mdps.
pub(crate) fn not_counts(sensor: Sensor, scale: f64) -> Option<Warning> {
    let g = STANDARD_GRAVITY;
    let degrees = 1f64.to_degrees();
    let units: &[(f64, &'static str, &'static str)] = match sensor {
        Sensor::Gyro => &[
            (1.0, "rad/s", "raw unit SI"),
            (
                degrees,
                "deg/s",
                "raw unit SI and the factor gyro=0.0174533",
            ),
            (
                1e3 * degrees,
                "mdps",
                "raw unit SI and the factor gyro=1.74533e-5",
            ),
        ],
        Sensor::Accel => &[
            (1.0, "m/s²", "raw unit SI"),
            (1.0 / g, "g", "raw unit SI and the factor accel=9.80665"),
            (1e3 / g, "mg", "raw unit SI and the factor accel=0.00980665"),
        ],
    };
    let found = units
        .iter()
        .find(|(of, ..)| (scale / of - 1.0).abs() < OF_UNIT);
    found.map(|(_, unit, remedy)| {
        Warning::NotCounts {
            per_si: scale,
            unit,
            remedy,
        }
        .of(sensor)
    })
}

/// Warnings about readings at rest that should be in SI. With known inputs the fit warns instead.
pub(crate) fn at_rest(list: &[Dwell], manifest: &Manifest) -> Vec<Warning> {
    // On a turntable most dwells are not rests of the gyro, and a fit judges its readings by the rates.
    if manifest.reference != Reference::Gravity {
        return Vec::new();
    }
    let usual = |sensor: Sensor| {
        let usable = list.iter().filter(|d| d.faults[sensor].is_none());
        let sizes = usable.map(|d| d.raw_mean(sensor).norm());
        let mut sizes: Vec<f64> = sizes.filter(|size| *size > 0.0).collect();
        quantile(&mut sizes, 0.5)
    };
    of_sizes(Sensor::BOTH.map(usual), manifest)
}

/// Warnings about readings that should be in SI, from their magnitudes at rest (gyro, accelerometer).
pub(crate) fn of_sizes([rate, force]: [Option<f64>; 2], manifest: &Manifest) -> Vec<Warning> {
    if manifest.raw_unit != RawUnit::Si {
        return Vec::new();
    }
    let gravity = manifest.gravity_mps2;
    let force = force.and_then(|size| {
        warning(
            Sensor::Accel,
            true,
            size / gravity,
            gravity,
            Figure::GravityMagnitude,
        )
    });
    let rate = rate.filter(|rate| *rate > LARGEST_BIAS);
    force
        .into_iter()
        .chain(rate.map(|rate| Warning::Turning { rate }.of(Sensor::Gyro)))
        .collect()
}

/// A larger scatter of the calibrated rate at rest, rad/s, exceeds that of any bias and g-sensitivity: 2 deg/s.
const RESTLESS: f64 = 0.035;

/// The warning about calibrated rates at rest that scatter by `rms`. A fit by turns knows the scale factor, also of readings in counts. It
/// cannot judge the size of a bias, because a converter's null may be anywhere, but a bias is nearly the same in all dwells.
pub(crate) fn restless(rms: f64) -> Option<Warning> {
    (rms > RESTLESS).then(|| Warning::Restless { rms }.of(Sensor::Gyro))
}
