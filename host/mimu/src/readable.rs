//! Converts SI, which files contain, to the units of data sheets, which people read. No other module converts units for people.
//!
//! The unit depends on the quantity: rad/s becomes deg/s for an error of rate and deg/h for a bias instability. Each kind of quantity
//! therefore has a function.

use std::borrow::Cow;

use crate::quantity::{Figure, Sensor, significant};

pub use mimu_recording::units::STANDARD_GRAVITY;

const DEG: f64 = 180.0 / std::f64::consts::PI;
const HOUR: f64 = 3600.0;
/// √h in √s.
const ROOT_HOUR: f64 = 60.0;
const MG: f64 = 1e3 / STANDARD_GRAVITY;

/// A unit that people read, and the factor to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Readable {
    /// Factor from SI to it.
    pub factor: f64,
    /// Name; empty for a ratio.
    pub unit: Cow<'static, str>,
}

impl Readable {
    /// A value in SI with three significant digits and the unit.
    pub fn write(&self, si: f64) -> String {
        let number = significant(si * self.factor);
        match self.unit.is_empty() {
            true => number,
            false => format!("{number} {}", self.unit),
        }
    }
}

/// SI unit, factor from it, and unit that people read.
type Entry = (&'static str, f64, &'static str);

const ANGLE: Entry = ("rad", DEG, "deg");
const RATE: Entry = ("rad/s", DEG, "deg/s");
const FORCE: Entry = ("m/s^2", 1e3, "mm/s²");

/// For an error of a unit's output, or an angle: deg, deg/s, mm/s².
pub fn error(si: &str) -> Readable {
    find(si, &[ANGLE, RATE, FORCE])
}

impl Figure {
    /// Factor from SI, and unit, in which people read the figure of `sensor`.
    pub fn readable(self, sensor: Sensor) -> (f64, &'static str) {
        let (_, factor, unit) = match (self, sensor) {
            (Self::Direction, _) => ANGLE,
            (_, Sensor::Gyro) => RATE,
            (_, Sensor::Accel) => FORCE,
        };
        (factor, unit)
    }
}

/// For a scale factor (raw per SI), a bias (raw, or SI if the unit reports SI) or an angle of a triad: mV/(deg/s), mV/g, deg/s, mg, deg.
/// Volts and counts stay.
pub fn parameter(si: &str) -> Readable {
    find(
        si,
        &[
            ("V/(rad/s)", 1e3 / DEG, "mV/(deg/s)"),
            ("V/(m/s^2)", 1e3 * STANDARD_GRAVITY, "mV/g"),
            ("count/(rad/s)", 1.0 / DEG, "count/(deg/s)"),
            ("count/(m/s^2)", STANDARD_GRAVITY, "count/g"),
            RATE,
            ("m/s^2", MG, "mg"),
            ANGLE,
        ],
    )
}

/// For a coefficient of an effect: deg/s/g, ppm, ppm/K, mg/g² and the like.
pub fn coefficient(si: &str) -> Readable {
    const G: f64 = STANDARD_GRAVITY;
    find(
        si,
        &[
            ("rad/s/(m/s^2)", DEG * G, "deg/s/g"),
            ("rad/s/(m/s^2)^2", DEG * G * G, "deg/s/g²"),
            ("1/(rad/s)", 1e6 / DEG, "ppm/(deg/s)"),
            ("1/(rad/s)^2", 1e6 / (DEG * DEG), "ppm/(deg/s)²"),
            ("1", 1e6, "ppm"),
            ("1/(m/s^2)", 1e3 * G, "mg/g²"),
            ("1/(m/s^2)^2", 1e3 * G * G, "mg/g³"),
            ("m", 1e3, "mm"),
            ("rad/s^2", DEG * HOUR, "deg/s/h"),
            ("m/s^3", MG * HOUR, "mg/h"),
            RATE,
            ("m/s^2", MG, "mg"),
            ("rad/s/K", DEG, "deg/s/K"),
            ("rad/s/K^2", DEG, "deg/s/K²"),
            ("m/s^2/K", MG, "mg/K"),
            ("m/s^2/K^2", MG, "mg/K²"),
            ("1/K", 1e6, "ppm/K"),
            ("rad/K", 1e6, "µrad/K"),
        ],
    )
}

/// For a deviation or a coefficient of a noise model, the usual unit first: deg/√h and deg/s/√Hz, deg/h, m/s/√h and µg/√Hz, mg and so on.
pub fn noise(si: &str) -> Vec<Readable> {
    let first = find(
        si,
        &[
            ("rad", DEG * HOUR, "arcsec"),
            ("rad/s/sqrt(Hz)", DEG * ROOT_HOUR, "deg/√h"),
            ("rad/s", DEG * HOUR, "deg/h"),
            ("rad/s/sqrt(s)", DEG * HOUR * ROOT_HOUR, "deg/h/√h"),
            ("rad/s^2", DEG * HOUR * HOUR, "deg/h/h"),
            ("m/s", 1e3, "mm/s"),
            ("m/s^2/sqrt(Hz)", ROOT_HOUR, "m/s/√h"),
            ("m/s^2", MG, "mg"),
            ("m/s^2/sqrt(s)", MG * ROOT_HOUR, "mg/√h"),
            ("m/s^3", MG * HOUR, "mg/h"),
        ],
    );
    let second = |factor, unit: &'static str| Readable {
        factor,
        unit: unit.into(),
    };
    match si {
        "rad/s/sqrt(Hz)" => vec![first, second(DEG, "deg/s/√Hz")],
        "m/s^2/sqrt(Hz)" => vec![first, second(1e3 * MG, "µg/√Hz")],
        _ => vec![first],
    }
}

/// The entry of `si` in `table`. Without one the unit is unchanged, except for signs that files spell out (√, ²).
fn find(si: &str, table: &[Entry]) -> Readable {
    if let Some(&(_, factor, unit)) = table.iter().find(|(name, ..)| *name == si) {
        return Readable {
            factor,
            unit: unit.into(),
        };
    }
    let unit = match si {
        "1" => String::new(),
        _ => si
            .replace("sqrt(Hz)", "√Hz")
            .replace("sqrt(s)", "√s")
            .replace("^2", "²")
            .replace("^3", "³"),
    };
    Readable {
        factor: 1.0,
        unit: unit.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that `si` is written as `text`.
    fn reads(readable: &Readable, si: f64, text: &str) {
        assert_eq!(readable.write(si), text);
    }

    // 1 deg = 0.01745329 rad and 1 g = 9.80665 m/s²; the rest was multiplied out by hand.

    #[test]
    fn errors_are_read_in_degrees_and_millimetres() {
        reads(&error("rad/s"), 0.017_453_29, "1.00 deg/s");
        reads(&error("rad"), 0.034_906_59, "2.00 deg");
        reads(&error("m/s^2"), 2.08e-3, "2.08 mm/s²");
    }

    #[test]
    fn scale_factors_are_those_of_the_first_page_of_a_data_sheet() {
        // 300 mV/g and 6 mV/(deg/s), as analog parts have them; 16.4 counts a degree per second and 16384 a g, as digital ones.
        reads(&parameter("V/(m/s^2)"), 0.030_591_49, "300 mV/g");
        reads(&parameter("V/(rad/s)"), 0.343_774_7, "6.00 mV/(deg/s)");
        reads(&parameter("count/(rad/s)"), 939.650_8, "16.4 count/(deg/s)");
        reads(&parameter("count/(m/s^2)"), 1670.703, "16384 count/g");
        reads(&parameter("m/s^2"), 0.196_133, "20.0 mg");
        reads(&parameter("V"), 1.35, "1.35 V");
        reads(&parameter("1"), 1.0, "1.00");
    }

    #[test]
    fn coefficients_of_effects_are_per_g_per_degree_a_second_and_per_kelvin() {
        // 0.1 deg/s/g is 0.001745329 rad/s for 9.80665 m/s².
        reads(&coefficient("rad/s/(m/s^2)"), 1.779_741e-4, "0.100 deg/s/g");
        // 1 ppm of 1 deg/s.
        reads(&coefficient("1/(rad/s)"), 5.729_578e-5, "1.00 ppm/(deg/s)");
        reads(
            &coefficient("1/(rad/s)^2"),
            3.282_806e-3,
            "1.00 ppm/(deg/s)²",
        );
        // 1 mg at 1 g: 9.80665e-3 over 9.80665².
        reads(&coefficient("1/(m/s^2)"), 1.019_716e-4, "1.00 mg/g²");
        reads(&coefficient("1/(m/s^2)^2"), 1.039_820e-5, "1.00 mg/g³");
        reads(&coefficient("1/K"), 5e-5, "50.0 ppm/K");
        reads(&coefficient("m/s^2/K"), 1.470_998e-3, "0.150 mg/K");
        // 1 mg in 3600 s.
        reads(&coefficient("m/s^3"), 2.724_069e-6, "1.00 mg/h");
        reads(&coefficient("rad/s^2"), 4.848_137e-6, "1.00 deg/s/h");
        reads(&coefficient("m"), 0.012, "12.0 mm");
        reads(&coefficient("rad/s/(m/s^2)^3"), 1.0, "1.00 rad/s/(m/s²)³");
    }

    #[test]
    fn noise_is_read_by_the_hour_and_in_micro_g() {
        let both = |si: &str, value: f64, texts: &[&str]| {
            let read: Vec<String> = noise(si).iter().map(|r| r.write(value)).collect();
            assert_eq!(read, texts);
        };
        // 1 deg/√h is a sixtieth of a deg/s/√Hz.
        let n = 2.908_882e-4;
        both("rad/s/sqrt(Hz)", n, &["1.00 deg/√h", "0.0167 deg/s/√Hz"]);
        // 22.5 µg/√Hz.
        let n = 2.206_496e-4;
        both("m/s^2/sqrt(Hz)", n, &["0.0132 m/s/√h", "22.5 µg/√Hz"]);
        both("rad", 4.848_137e-6, &["1.00 arcsec"]);
        both("rad/s", 4.848_137e-6, &["1.00 deg/h"]);
        // A random walk of 1 deg/h in an hour, and a ramp as steep.
        both("rad/s/sqrt(s)", 8.080_228e-8, &["1.00 deg/h/√h"]);
        both("rad/s^2", 1.346_705e-9, &["1.00 deg/h/h"]);
        both("m/s^2/sqrt(s)", 1.634_442e-4, &["1.00 mg/√h"]);
        both("V/sqrt(Hz)", 2e-6, &["2.00e-6 V/√Hz"]);
    }
}
