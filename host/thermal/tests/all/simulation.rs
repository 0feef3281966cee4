//! A unit with the curves of niu's MTi-G in a chamber, simulated sample by sample. It shares no code with the estimators.

use mimu_recording::{Batch, Manifest, RawUnit, Reference};
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};

/// Samples a second.
pub const RATE_HZ: f64 = 10.0;
/// Gravity, m/s².
pub const GRAVITY: f64 = 9.80665;
/// Raw per SI of gyro and accelerometer.
pub const GAIN: [f64; 2] = [0.06, 0.03];
/// White noise of gyro (3 deg/√h) and accelerometer (niu, Table 3), SI/√Hz.
pub const WHITE: [f64; 2] = [3.0 / 60.0 * std::f64::consts::PI / 180.0, 0.002];
const DEG_PER_H: f64 = std::f64::consts::PI / 180.0 / 3600.0;
const MICRO_G: f64 = 1e-6 * 9.80665;

/// niu, Table 9, MTi-G, by powers of the temperature in °C. Biases in deg/h and µg, the rest in ppm.
const BIAS: [[[f64; 4]; 3]; 2] = [
    [
        [-31.0, -13.65, 0.177, 0.00142],
        [1.0, -15.33, 0.260, -0.00136],
        [-2112.0, 45.24, -0.682, 0.00352],
    ],
    [
        [-1472.0, -37.02, 0.120, 0.01575],
        [2758.0, -6.76, 0.443, -0.00128],
        [411.0, 38.25, -0.876, 0.00360],
    ],
];
/// Rows of the matrix, likewise: scale factors on the diagonal.
const MATRIX: [[[[f64; 4]; 3]; 3]; 2] = [
    [
        [
            [-3108.0, 1.31, 0.232, -0.01783],
            [611.0, 17.20, -0.906, 0.00896],
            [4527.0, -18.12, -0.733, 0.01023],
        ],
        [
            [701.0, -8.14, 0.077, 0.00111],
            [-1380.0, 119.62, 0.107, -0.00931],
            [-3371.0, 39.47, 0.620, -0.00810],
        ],
        [
            [-2017.0, -10.81, -0.783, 0.00761],
            [593.0, 6.73, -0.293, 0.00813],
            [-4541.0, 232.23, -1.134, -0.01477],
        ],
    ],
    [
        [
            [-100.0, 7.71, -0.073, 0.00034],
            [-174.0, -1.77, 0.026, 0.00052],
            [9996.0, -1.75, -0.129, 0.00149],
        ],
        [
            [372.0, 1.50, -0.037, -0.00003],
            [102.0, 5.25, -0.090, 0.00055],
            [7648.0, 8.42, 0.017, -0.00088],
        ],
        [
            [-4158.0, -15.85, 0.095, -0.00034],
            [-3530.0, -7.14, -0.032, 0.00018],
            [157.0, 4.32, -0.108, 0.00038],
        ],
    ],
];

/// Forward model of gyro (0) or accelerometer (1) at `temp_c`, SI to raw: P and b.
pub fn truth(sensor: usize, temp_c: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let cubic = |a: &[f64; 4]| a[0] + temp_c * (a[1] + temp_c * (a[2] + temp_c * a[3]));
    let unit = [DEG_PER_H, MICRO_G][sensor];
    let gain = GAIN[sensor];
    let matrix = Matrix3::from_fn(|i, j| {
        let ratio = 1e-6 * cubic(&MATRIX[sensor][i][j]);
        gain * (ratio + if i == j { 1.0 } else { 0.0 })
    });
    let bias = Vector3::from_fn(|i, _| gain * unit * cubic(&BIAS[sensor][i]));
    (matrix, bias)
}

/// An experiment with the unit.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// Corners of the driving temperature: s, °C. The die follows it; if the lag is negative, the thermometer follows it.
    pub corners: Vec<(f64, f64)>,
    /// Lag of the dies behind the thermometer, s.
    pub lag_s: f64,
    /// Lag of the accelerometer's die, s, if it differs. Then neither lag may be negative.
    pub accel_lag_s: Option<f64>,
    /// Random walk of the biases over the white noise in one second, per √s; zero for none.
    pub walk: f64,
    /// White noise of the thermometer, K, at 10 Hz.
    pub thermometer_noise: f64,
    /// Additional bias of this session, SI; gyro, accelerometer.
    pub offset: [f64; 2],
}

impl Experiment {
    /// From -10 to 70 °C by 2 K/min and, if `whole`, back.
    pub fn ramp(lag_s: f64, whole: bool) -> Self {
        let up = vec![(0.0, -10.0), (2400.0, 70.0)];
        let back = whole.then_some((4800.0, -10.0));
        Self {
            corners: up.into_iter().chain(back).collect(),
            lag_s,
            accel_lag_s: None,
            walk: 0.0,
            thermometer_noise: 0.02,
            offset: [0.0; 2],
        }
    }

    /// Driving temperature at `t_s`.
    fn driven(&self, t_s: f64) -> f64 {
        let k = self.corners.partition_point(|c| c.0 <= t_s);
        match (
            k.checked_sub(1).map(|i| self.corners[i]),
            self.corners.get(k),
        ) {
            (Some((t0, a)), Some(&(t1, b))) => a + (b - a) * (t_s - t0) / (t1 - t0),
            (Some((_, held)), None) | (None, Some(&(_, held))) => held,
            (None, None) => 20.0,
        }
    }

    /// Temperatures of thermometer, gyro and accelerometer, sample by sample.
    pub fn temperatures(&self) -> Vec<[f64; 3]> {
        let n = (self.corners.last().map_or(0.0, |c| c.0) * RATE_HZ) as usize;
        let step = 1.0 / RATE_HZ;
        let accel_lag_s = self.accel_lag_s.unwrap_or(self.lag_s);
        let mut followers = [self.driven(0.0); 2];
        let follow = [self.lag_s, accel_lag_s].map(|lag| 1.0 - (-step / lag.abs().max(1e-6)).exp());
        let mut out = Vec::with_capacity(n);
        for k in 0..n {
            let driven = self.driven(k as f64 * step);
            out.push(match self.lag_s {
                lag if lag >= 0.0 => [driven, followers[0], followers[1]],
                _ => [followers[0], driven, driven],
            });
            // Between two samples the driving temperature is taken in their middle.
            let middle = self.driven((k as f64 + 0.5) * step);
            for (follower, follow) in followers.iter_mut().zip(follow) {
                *follower += follow * (middle - *follower);
            }
        }
        out
    }

    /// Recording of the repeated scheme; the same seed gives the same noise.
    pub fn record(&self, seed: u64) -> (Manifest, Batch) {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d);
        let mut out = Batch::default();
        let mut scheme = Scheme::new();
        let mut wander = [Vector3::<f64>::zeros(); 2];
        for (k, [thermometer, gyro_c, accel_c]) in self.temperatures().into_iter().enumerate() {
            let (step, rate, force) = scheme.next();
            out.t_s.push(k as f64 / RATE_HZ);
            out.step.push(step);
            out.temp_c
                .push(thermometer + self.thermometer_noise * random.normal());
            for (sensor, input) in [rate, force].into_iter().enumerate() {
                let (matrix, bias) = truth(sensor, [gyro_c, accel_c][sensor]);
                let sigma = WHITE[sensor] * RATE_HZ.sqrt();
                let raw = matrix * input + bias;
                for axis in 0..3 {
                    wander[sensor][axis] +=
                        WHITE[sensor] * self.walk / RATE_HZ.sqrt() * random.normal();
                    let error =
                        sigma * random.normal() + wander[sensor][axis] + self.offset[sensor];
                    out.raw[3 * sensor + axis].push(raw[axis] + GAIN[sensor] * error);
                    let unit = [180.0 / std::f64::consts::PI, 1.0][sensor];
                    out.reference[3 * sensor + axis].push(input[axis] * unit);
                }
            }
        }
        let manifest = Manifest::new("mti-g", RATE_HZ, GRAVITY, RawUnit::Volt, Reference::Table);
        (manifest, out)
    }
}

/// niu's eight turns by 90 degrees and eight dwells, repeated.
struct Scheme {
    up: Vector3<f64>,
    /// Sample within the current part, and the part: even ones are turns.
    at: usize,
    part: usize,
}

/// Samples of a dwell of 10 s and of a turn at 10 deg/s.
const DWELL: usize = 100;
const TURN: usize = 90;
/// Axes of the turns, with their signs: from z down through y down, y up, x up, y up and x down.
const TURNS: [(usize, f64); 8] = [
    (0, 1.0),
    (0, -1.0),
    (0, -1.0),
    (2, 1.0),
    (2, -1.0),
    (0, 1.0),
    (1, -1.0),
    (1, 1.0),
];

impl Scheme {
    fn new() -> Self {
        Self {
            up: -Vector3::z(),
            at: 0,
            part: 1,
        }
    }

    /// Step, rate (rad/s) and mean specific force over the next sample.
    fn next(&mut self) -> (i32, Vector3<f64>, Vector3<f64>) {
        let turning = self.part.is_multiple_of(2);
        let length = if turning { TURN } else { DWELL };
        let step = self.part as i32;
        let mut rate = Vector3::zeros();
        let mut force = GRAVITY * self.up;
        if turning {
            let (axis, sign) = TURNS[(self.part / 2 - 1) % 8];
            rate[axis] = sign * 10f64.to_radians();
            let turned = |angle: f64| Rotation3::new(-rate.normalize() * angle) * self.up;
            let angle = 1f64.to_radians();
            force = GRAVITY * turned((self.at as f64 + 0.5) * angle);
        }
        self.at += 1;
        if self.at == length {
            if turning {
                self.up = Rotation3::new(-rate.normalize() * 90f64.to_radians()) * self.up;
            }
            (self.at, self.part) = (0, self.part + 1);
        }
        (step, rate, force)
    }
}

/// Cramér-Rao bounds of the forward models at `temps`, relative to the gain (SI for b), if the curves are cubics and the lag is unknown too.
/// Gyro and accelerometer; at each temperature P by rows, then b.
pub fn bounds(experiment: &Experiment, temps: &[f64]) -> [Vec<[f64; 12]>; 2] {
    const H: f64 = 0.5;
    let other = Experiment {
        lag_s: experiment.lag_s + H,
        ..experiment.clone()
    };
    let driven = [experiment.temperatures(), other.temperatures()];
    let powers = |t: f64| {
        let x = (t - 30.0) / 40.0;
        [1.0, x, x * x, x * x * x]
    };
    let mut information = DMatrix::<f64>::zeros(97, 97);
    let mut scheme = Scheme::new();
    for k in 0..driven[0].len() {
        let (step, rate, force) = scheme.next();
        // The same rows as for a user: forces during turns are not used.
        let still = step % 2 == 1;
        let die = driven[0][k][1];
        // If the die lags the thermometer, its temperature changes with the lag; if it leads, the thermometer's does.
        let by_lag = match experiment.lag_s >= 0.0 {
            true => (driven[1][k][1] - die) / H,
            false => -(driven[1][k][0] - driven[0][k][0]) / H,
        };
        for (sensor, input) in [rate, force].into_iter().enumerate() {
            if sensor == 1 && !still {
                continue;
            }
            let variance = WHITE[sensor] * WHITE[sensor] * RATE_HZ;
            let [above, below] = [0.05, -0.05].map(|d| truth(sensor, die + d));
            let slope =
                (above.0 * input + above.1 - below.0 * input - below.1) / 0.1 / GAIN[sensor];
            for axis in 0..3 {
                let mut row: Vec<(usize, f64)> = Vec::with_capacity(17);
                for curve in 0..4 {
                    let factor = if curve < 3 { input[curve] } else { 1.0 };
                    for (p, v) in powers(die).into_iter().enumerate() {
                        row.push((48 * sensor + 16 * axis + 4 * curve + p, v * factor));
                    }
                }
                row.push((96, slope[axis] * by_lag));
                for &(i, a) in &row {
                    for &(j, b) in &row {
                        information[(i, j)] += a * b / variance;
                    }
                }
            }
        }
    }
    let scale = information.diagonal().map(|d| 1.0 / d.max(1e-30).sqrt());
    let scaled = DMatrix::from_fn(97, 97, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled
        .try_inverse()
        .expect("the scheme determines everything");
    [0, 1].map(|sensor| {
        let at = |t: &f64| {
            std::array::from_fn(|number| {
                let (axis, curve) = match number {
                    0..9 => (number / 3, number % 3),
                    _ => (number - 9, 3),
                };
                let from = 48 * sensor + 16 * axis + 4 * curve;
                let (p, mut sum) = (powers(*t), 0.0);
                for i in 0..4 {
                    for j in 0..4 {
                        let (a, b) = (from + i, from + j);
                        sum += p[i] * p[j] * inverse[(a, b)] * scale[a] * scale[b];
                    }
                }
                sum.sqrt()
            })
        };
        temps.iter().map(at).collect()
    })
}

/// SplitMix64, and normal numbers by Box and Muller.
pub struct Random(pub u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A normal number.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}
