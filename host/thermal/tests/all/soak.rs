//! The unit of `simulation` soaked: nine set points, an hour each; the last minutes of each are measured (`rig/plans/soak.toml`).

use mimu_recording::{Batch, Manifest, RawUnit, Reference};
use nalgebra::Vector3;

use crate::simulation::{GAIN, GRAVITY, RATE_HZ, Random, WHITE, truth};

/// Set points from -10 °C on, 10 K apart, an hour each, with ramps of 2 K/min before all but the first.
const POINTS: usize = 9;
const ROUND_S: f64 = 3600.0;
const RAMP_S: f64 = 300.0;
/// Duration of each of the six faces, s; then of each rate in both directions about each axis upright, s and deg/s.
const FACE_S: f64 = 20.0;
const RATE_S: f64 = 15.0;
const RATE_DPS: f64 = 50.0;
const MEASURED_S: f64 = 6.0 * (FACE_S + RATE_S);

/// Duration, h.
pub const HOURS: f64 = POINTS as f64 * ROUND_S / 3600.0;

/// Temperature of the chamber and of the thermometer.
fn driven(t_s: f64) -> f64 {
    let point = (t_s / ROUND_S).floor();
    let since = t_s - point * ROUND_S;
    match point > 0.0 {
        true => 10.0 * (point - 2.0) + 10.0 * (since / RAMP_S).min(1.0),
        false => -10.0,
    }
}

/// Number within a round, rate and specific force; none during the soak.
fn pose(t_s: f64) -> Option<(usize, Vector3<f64>, Vector3<f64>)> {
    let since = t_s % ROUND_S - (ROUND_S - MEASURED_S);
    let of = |axis: usize, sign: f64| {
        let mut v = Vector3::zeros();
        v[axis] = sign;
        v
    };
    let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    match since {
        s if s < 0.0 => None,
        s if s < 6.0 * FACE_S => {
            let k = (s / FACE_S) as usize;
            Some((k, Vector3::zeros(), GRAVITY * of(k / 2, sign(k))))
        }
        s => {
            let k = (((s - 6.0 * FACE_S) / RATE_S) as usize).min(5);
            let rate = RATE_DPS.to_radians() * of(k / 2, sign(k));
            Some((6 + k, rate, GRAVITY * of(k / 2, 1.0)))
        }
    }
}

/// Recording of a unit whose dies lag by `lag_s`.
pub fn record(lag_s: f64, seed: u64) -> (Manifest, Batch) {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d);
    let mut out = Batch::default();
    let mut die = driven(0.0);
    let follow = 1.0 - (-1.0 / (RATE_HZ * lag_s)).exp();
    for k in 0..(POINTS as f64 * ROUND_S * RATE_HZ) as usize {
        let t_s = k as f64 / RATE_HZ;
        die += follow * (driven(t_s) - die);
        let pose = pose(t_s);
        let step = pose.map_or(-1, |p| (12.0 * (t_s / ROUND_S).floor()) as i32 + p.0 as i32);
        // The state during the soak is not used.
        let (_, rate, force) = pose.unwrap_or((0, Vector3::zeros(), GRAVITY * Vector3::z()));
        out.t_s.push(t_s);
        out.step.push(step);
        out.temp_c.push(driven(t_s) + 0.02 * random.normal());
        for (sensor, input) in [rate, force].into_iter().enumerate() {
            let (matrix, bias) = truth(sensor, die);
            let sigma = WHITE[sensor] * RATE_HZ.sqrt();
            let raw = matrix * input + bias;
            let unit = [180.0 / std::f64::consts::PI, 1.0][sensor];
            for axis in 0..3 {
                let noise = GAIN[sensor] * sigma * random.normal();
                out.raw[3 * sensor + axis].push(raw[axis] + noise);
                out.reference[3 * sensor + axis].push(input[axis] * unit);
            }
        }
    }
    let manifest = Manifest::new("mti-g", RATE_HZ, GRAVITY, RawUnit::Volt, Reference::Table);
    (manifest, out)
}
