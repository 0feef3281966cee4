//! The magnitude of readings against what they measure: gravity, known rates and turns. It shows another unit than given.

use super::words::{self, Cause};
use super::{Fault, Finding};

/// Standard gravity, m/s².
const STANDARD_GRAVITY: f64 = 9.806_65;
/// Gain of readings in SI, or its inverse, that a wrong unit or time base has. Sensors are within ten per cent, and a rate of 33 1/3 rpm in place of
/// 45 is a third off.
pub const GAIN: f64 = 1.3;
/// The same for a magnitude at rest, which includes biases: data sheets allow 0.15 g on each axis besides ten per cent. Ranges differ by a
/// factor of 2, units by nearly 10.
const GAIN_AT_REST: f64 = 1.5;
/// A smaller magnitude at rest, relative to gravity, is that of readings without gravity: in g it would be 0.1.
const NO_GRAVITY: f64 = 0.05;
/// No gyro's bias is larger, rad/s: 40 deg/s, twice what the data sheet of an MPU-6050 allows.
pub(crate) const LARGEST_BIAS: f64 = 0.7;
/// Fractions have the scale factor of their unit to within this share.
const OF_UNIT: f64 = 0.1;

/// What a gain is relative to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Against {
    /// Known inputs.
    Inputs,
    /// The magnitude of gravity.
    Gravity,
    /// The magnitude of a turntable's rate.
    TurntableRate,
    /// The turns of gravity.
    Turns,
}

/// The finding about a gyro in SI whose readings are `times` its input.
pub fn gyro_gain(times: f64, against: Against) -> Option<Finding> {
    let near = |factor: f64| (0.8..1.25).contains(&(times / factor));
    let rpm = |ratio: f64| (0.95..1.05).contains(&(times / ratio));
    let degrees = 1f64.to_degrees();
    let (turns, table) = (Against::Turns, Against::TurntableRate);
    let cause = match against {
        _ if near(degrees) => words::DEGREES_PER_SECOND,
        Against::Turns if near(degrees.recip()) => words::RADIANS_TWICE,
        _ if near(degrees.recip()) => words::RADIANS_TWICE_OR_RATES,
        _ if against == table && rpm(200.0 / 270.0) => words::SLOW_TURNTABLE,
        _ if against == table && rpm(270.0 / 200.0) => words::FAST_TURNTABLE,
        _ if against == turns && near(1000.0) => words::MILLISECONDS,
        // The gyro is integrated over the turns: time stamps that run twice as fast halve the scale factor.
        _ if against == turns && (0.1..10.0).contains(&times) => words::TIMES,
        _ => words::UNKNOWN,
    };
    not_si("gyro", false, times, cause)
}

/// The finding about an accelerometer in SI whose readings are `times` their input.
pub fn accel_gain(times: f64, gravity_mps2: f64) -> Option<Finding> {
    not_si("accel", false, times, accel_cause(times, gravity_mps2))
}

/// The finding about an accelerometer in SI whose usual magnitude, biases included, is `size`.
pub fn accel_at_rest(size: f64, gravity_mps2: f64) -> Option<Finding> {
    let times = size / gravity_mps2;
    let of_another_unit = accel_cause(times, gravity_mps2) != words::UNKNOWN;
    if times < NO_GRAVITY && !of_another_unit {
        return Some(Finding::new("accel", 0, Fault::NoGravity { size }));
    }
    not_si("accel", true, times, accel_cause(times, gravity_mps2))
}

fn accel_cause(times: f64, gravity_mps2: f64) -> Cause {
    let near = |factor: f64| (0.8..1.25).contains(&(times / factor));
    match times {
        _ if near(1.0 / gravity_mps2) => words::IN_G,
        _ if near(1000.0 / gravity_mps2) => words::IN_MG,
        _ if near(gravity_mps2) => words::GRAVITY_TWICE,
        // Without gravity any magnitude is possible, so the limits are narrower.
        _ if (0.95..1.05).contains(&(1e3 * times)) => words::G_AS_MG,
        _ if (0.95..1.05).contains(&(1e3 * times / gravity_mps2)) => words::SI_AS_MG,
        _ if near(1e3) => words::MG_AS_G,
        _ => words::UNKNOWN,
    }
}

fn not_si(about: &'static str, at_rest: bool, times: f64, cause: Cause) -> Option<Finding> {
    let limit = if at_rest { GAIN_AT_REST } else { GAIN };
    let fault = Fault::NotSi {
        at_rest,
        times,
        cause,
    };
    (!(1.0 / limit..limit).contains(&times)).then(|| Finding::new(about, 0, fault))
}

/// The finding about a gyro in SI whose magnitude at rest, rad/s, no bias explains.
pub fn gyro_at_rest(rate: f64) -> Option<Finding> {
    (rate > LARGEST_BIAS).then(|| Finding::new("gyro", 0, Fault::Turning { rate }))
}

/// The finding about fractions that are declared as counts, if `per_si`, their number per SI unit, is that of a unit. Whole numbers are counts
/// whatever their scale: many drivers give mg or mdps.
pub fn not_counts(about: &'static str, per_si: f64) -> Option<Finding> {
    let (g, degrees) = (STANDARD_GRAVITY, 1f64.to_degrees());
    let si = "raw unit SI";
    let units = match about {
        "gyro" => [
            (1.0, "rad/s", si),
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
        _ => [
            (1.0, "m/s²", si),
            (1.0 / g, "g", "raw unit SI and the factor accel=9.80665"),
            (1e3 / g, "mg", "raw unit SI and the factor accel=0.00980665"),
        ],
    };
    let is = |(of, ..): &&(f64, _, _)| (per_si / of - 1.0).abs() < OF_UNIT;
    let (_, unit, import) = *units.iter().find(is)?;
    let fault = Fault::NotCounts {
        per_si,
        unit,
        import,
    };
    Some(Finding::new(about, 0, fault))
}
