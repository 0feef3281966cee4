//! Recordings at rest of a unit whose biases drift far: which part of them is used, and what the report says about the rest.

use mimu::prepared::Prepared;
use mimu::signal::stillness::{DwellSearch, STILL_FACTOR, Steps};
use mimu::{Manifest, RawUnit, Reference, Samples};
use mimu_thermal::fit::{FitVerdict, ThermalFit, fit};
use mimu_thermal::result::ThermalResult;
use mimu_thermal::session::Session;
use mimu_thermal::warning::Warning;

use crate::at_rest::JOINT;
use crate::says;
use crate::simulation::Random;

const RATE_HZ: f64 = 50.0;
const GRAVITY: f64 = 9.80665;
/// Standard deviation of a sample: 0.046 deg/s, 2 mg.
const NOISE: [f64; 2] = [8e-4, 0.02];

/// A unit on a desk: the times of its samples, its thermometer, and what moves its readings apart from the temperature.
struct Desk {
    duration_s: f64,
    temp_c: fn(f64) -> f64,
    recorded: fn(f64) -> bool,
    /// Added to gyro x, y, z (deg/s), accelerometer x, y, z (m/s²).
    added: fn(f64) -> [f64; 6],
}

/// Out of a freezer: two thirds of the warming are over in ten minutes; then it cools by half.
fn warm_up(t_s: f64) -> f64 {
    match t_s < 2400.0 {
        true => 73.0 - 91.0 * (-t_s / 300.0).exp(),
        false => 40.0 + 33.0 * (-(t_s - 2400.0) / 420.0).exp(),
    }
}

/// From -18 to 73 °C and back.
fn there_and_back(t_s: f64) -> f64 {
    -18.0 + 91.0 * (1.0 - (t_s / 1800.0 - 1.0).abs())
}

/// Biases at `temp_c`: gyro, deg/s, accelerometer, m/s².
fn bias(temp_c: f64) -> [f64; 6] {
    let d = (temp_c - 27.0) / 45.0;
    [
        0.3 + 1.2 * d + 0.3 * d * d,
        -0.2 + 0.6 * d - 0.2 * d.powi(3),
        0.1 - 0.9 * d,
        0.05 * d,
        -0.03 * d,
        GRAVITY + 0.08 * d,
    ]
}

impl Desk {
    const STILL: Self = Self {
        duration_s: 3600.0,
        temp_c: warm_up,
        recorded: |_| true,
        added: |_| [0.0; 6],
    };

    fn record(&self, seed: u64) -> (Manifest, Samples) {
        let mut random = Random(seed);
        let mut out = Samples::default();
        for k in 0..(self.duration_s * RATE_HZ) as usize {
            let t_s = k as f64 / RATE_HZ;
            if !(self.recorded)(t_s) {
                continue;
            }
            let temp_c = (self.temp_c)(t_s);
            let (bias, added) = (bias(temp_c), (self.added)(t_s));
            out.t_s.push(t_s);
            out.temp_c.push(temp_c + 0.02 * random.normal());
            for c in 0..6 {
                let unit = if c < 3 { 1f64.to_radians() } else { 1.0 };
                let reading = unit * (bias[c] + added[c]);
                out.raw[c].push(reading + NOISE[c / 3] * random.normal());
            }
        }
        let manifest = Manifest::new("desk", RATE_HZ, GRAVITY, RawUnit::Si, Reference::Gravity);
        (manifest, out)
    }

    fn fitted(&self, seed: u64, steps: Steps) -> Result<ThermalFit, mimu::Error> {
        let (manifest, samples) = self.record(seed);
        let search = DwellSearch {
            still_factor: STILL_FACTOR,
            steps,
        };
        let session = Session::of(&Prepared::of(manifest, &samples, search)?)?;
        fit(vec![session], &[], JOINT)
    }
}

/// The curves of the gyro agree with the biases of the simulation to a hundredth of a degree per second, over the whole range.
fn assert_biases(result: &ThermalResult) {
    for (axis, name) in ["gyro_bias_x", "gyro_bias_y", "gyro_bias_z"]
        .iter()
        .enumerate()
    {
        let curve = result.curve(name).unwrap();
        for (t, value) in curve.temp_c.iter().zip(&curve.value) {
            let off = value.to_degrees() - bias(*t)[axis];
            assert!(off.abs() < 0.01, "{name} at {t} °C: {off} deg/s off");
        }
    }
}

#[test]
fn a_turn_that_the_accelerometer_sees_is_still_left_out_while_the_temperature_ramps() {
    // A quarter of each minute it turns about x by 2.4 deg/s, to one side and back.
    fn angle(t_s: f64) -> [f64; 2] {
        let (minute, s) = ((t_s / 60.0) as u64, t_s % 60.0);
        let rate: f64 = if s < 15.0 { 2.4 } else { 0.0 };
        let share = (s / 15.0).min(1.0);
        match minute % 2 {
            0 => [36.0 * share, rate],
            _ => [36.0 * (1.0 - share), -rate],
        }
    }
    let desk = Desk {
        temp_c: there_and_back,
        added: |t| {
            let [angle, rate] = angle(t);
            let (sin, cos) = angle.to_radians().sin_cos();
            [rate, 0.0, 0.0, 0.0, GRAVITY * sin, GRAVITY * (cos - 1.0)]
        },
        ..Desk::STILL
    };
    let result = ThermalResult::of(&desk.fitted(3, Steps::AsRecorded).unwrap());
    let used = result.sensors.gyro.as_ref().unwrap().used.unwrap();
    assert!((0.5..0.76).contains(&used.samples), "{used:?}");
    let covers = |w: &Warning| matches!(w, Warning::Coverage { .. });
    assert!(result.warnings.iter().any(covers));
    // Sixty rests in two poses, in which gravity contributes to the biases: the curves agree within their intervals. A turn of 2.4 deg/s in
    // one row of a rest would be far outside.
    let curve = result.curve("gyro_bias_x").unwrap();
    for (k, t) in curve.temp_c.iter().enumerate() {
        let off = curve.value[k] - bias(*t)[0].to_radians();
        assert!(
            off.abs() < curve.upper[k] - curve.lower[k],
            "{t} °C: {off} rad/s off"
        );
    }
}

#[test]
fn a_recording_that_is_mostly_shaken_is_refused_unless_it_is_declared_to_be_at_rest() {
    // For four fifths of each ten seconds a machine next to it runs.
    let desk = Desk {
        temp_c: there_and_back,
        added: |t| {
            let shake = if t % 10.0 < 8.0 {
                0.4 * (160.0 * t).sin()
            } else {
                0.0
            };
            [0.0, 0.0, 0.0, shake, shake, shake]
        },
        ..Desk::STILL
    };
    let error = desk.fitted(4, Steps::AsRecorded).unwrap_err().to_string();
    says(&error, &["% of the samples", "declare"]);
    let result = ThermalResult::of(&desk.fitted(4, Steps::AtRest).unwrap());
    let used = result.sensors.accel.as_ref().unwrap().used.unwrap();
    assert!(used.samples > 0.99, "{used:?}");
    assert_biases(&result);
}

#[test]
fn axes_that_want_other_lags_leave_the_lag_undetermined() {
    // The bias of y lags the temperature by two minutes; the others follow at once.
    let desk = Desk {
        temp_c: there_and_back,
        added: |t| {
            let late = bias(there_and_back((t - 120.0).max(0.0)))[1] - bias(there_and_back(t))[1];
            [0.0, late, 0.0, 0.0, 0.0, 0.0]
        },
        ..Desk::STILL
    };
    let result = ThermalResult::of(&desk.fitted(5, Steps::AtRest).unwrap());
    let gyro = result.sensors.gyro.as_ref().unwrap();
    assert!(gyro.lag_s.is_none(), "{:?}", gyro.lag_s);
    let why = gyro.lag_reason.as_ref().unwrap();
    assert!(why.contains("the axes contradict each other"), "{why}");
    let still = Desk {
        temp_c: there_and_back,
        ..Desk::STILL
    };
    let result = ThermalResult::of(&still.fitted(5, Steps::AtRest).unwrap());
    assert!(result.sensors.gyro.unwrap().lag_s.is_some());
}

#[test]
fn errors_far_beyond_the_noise_are_no_fit() {
    // A bias that jumps by 0.3 deg/s every three minutes.
    let desk = Desk {
        temp_c: there_and_back,
        added: |t| {
            let jump = if ((t / 180.0) as u64).is_multiple_of(2) {
                0.3
            } else {
                -0.3
            };
            [jump, 0.0, 0.0, 0.0, 0.0, 0.0]
        },
        ..Desk::STILL
    };
    let found = desk.fitted(6, Steps::AtRest).unwrap();
    let result = ThermalResult::of(&found);
    assert_eq!(result.verdict, FitVerdict::Misfit);
}

#[test]
fn a_hysteresis_is_no_temperature_where_the_bias_has_no_slope() {
    let desk = Desk {
        temp_c: there_and_back,
        // Removes the effect of temperature on gyro z.
        added: |t| {
            let off = bias(there_and_back(t))[2];
            [0.0, 0.0, -off, 0.0, 0.0, 0.0]
        },
        ..Desk::STILL
    };
    let result = ThermalResult::of(&desk.fitted(8, Steps::AtRest).unwrap());
    let all = result.sensors.gyro.unwrap().hysteresis.unwrap();
    assert!(
        all[0].kelvin.is_some() && all[2].kelvin.is_none(),
        "{all:?}"
    );
}
