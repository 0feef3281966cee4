//! A board of another maker in the hands of a person: the lines that it writes while it is turned. Its physics are independent of the bench and of the
//! program.

use crate::stored_calibration::{Forward, Truth};

/// A vector.
pub type Vector = [f64; 3];
/// A matrix by rows.
pub type Matrix = [[f64; 3]; 3];

/// Local gravity, m/s².
pub const GRAVITY: f64 = 9.793;

/// A board and its faults.
#[derive(Clone, Debug)]
pub struct TextBoard {
    /// True model.
    pub truth: Truth,
    /// Standard deviation of a sample, gyro and accelerometer, raw.
    pub noise: [f64; 2],
    /// Quantisation steps, gyro and accelerometer.
    pub steps: [f64; 2],
    /// What the axis of each name reads: gyro and accelerometer.
    pub wired: [Matrix; 2],
    /// Cubic error of the accelerometer, as a fraction of its reading at gravity.
    pub cubic: f64,
    /// Largest reading, gyro and accelerometer, raw: the end of the range.
    pub largest: [f64; 2],
    /// Drift of the gyro's biases, rad/s a second.
    pub drift: f64,
    /// Unit of its stamps, s.
    pub stamps_s: f64,
    /// Share of the lines that are lost.
    pub lost: f64,
    /// Time of the one line in which a number becomes 1.4e99, s.
    pub garbled_s: Option<f64>,
    /// Virtual time over wall-clock time, where the lines are written to a port.
    pub speed: f64,
    /// Lines per second.
    pub rate_hz: f64,
}

/// Each axis reads itself.
pub const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Pseudo-random numbers.
pub struct Random(u64);

impl Random {
    /// From a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    /// Uniform from 0 to 1 (splitmix64).
    pub fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Normal, of mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.even()).ln()).sqrt() * (std::f64::consts::TAU * self.even()).cos()
    }
}

impl TextBoard {
    /// An ordinary board: scale factors within 2 %, axes within a degree, the noise and counts of an MPU-6050.
    pub fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut triad = |scale: f64, bias: f64| Forward {
            matrix: [0, 1, 2].map(|i| {
                [0, 1, 2].map(|j| scale * (f64::from(u8::from(i == j)) + 0.012 * random.normal()))
            }),
            bias: [0.0; 3].map(|_| bias * random.normal()),
        };
        let gyro = triad(3754.9, 120.0);
        let accel = triad(1670.1, 450.0);
        Self {
            truth: Truth {
                triads: [gyro, accel],
                by_hand: true,
            },
            noise: [5.0, 45.0],
            steps: [1.0; 2],
            wired: [IDENTITY; 2],
            cubic: 0.0,
            largest: [32767.0; 2],
            drift: 0.0,
            stamps_s: 1e-6,
            lost: 0.0,
            garbled_s: None,
            speed: 20.0,
            rate_hz: 100.0,
        }
    }

    /// A line at this time with this rate, rad/s, and specific force, m/s², in the body frame.
    pub fn line(&self, t_s: f64, rate: Vector, force: Vector, random: &mut Random) -> String {
        let mut numbers = Vec::new();
        // In the order of the lines: accelerometer, gyro.
        for k in [1, 0] {
            let input = [rate, force][k];
            let Forward { matrix, bias } = &self.truth.triads[k];
            let own: Vector = std::array::from_fn(|i| {
                let x: f64 = (0..3).map(|j| matrix[i][j] * input[j]).sum();
                let full = matrix[i][i] * GRAVITY;
                let cubic = if k == 1 {
                    self.cubic * full * (x / full).powi(3)
                } else {
                    0.0
                };
                let drift = if k == 0 {
                    matrix[i][i] * self.drift * t_s
                } else {
                    0.0
                };
                x + cubic + drift + bias[i] + self.noise[k] * random.normal()
            });
            for row in &self.wired[k] {
                let read: f64 = row.iter().zip(&own).map(|(a, b)| a * b).sum();
                let step = self.steps[k];
                let read = if step > 0.0 {
                    (read / step).round() * step
                } else {
                    read
                };
                numbers.push(read.clamp(-self.largest[k], self.largest[k]));
            }
        }
        if self
            .garbled_s
            .is_some_and(|at| (t_s - at).abs() < 0.4 / self.rate_hz)
        {
            numbers[2] = 1.4e99;
        }
        let stamp = (t_s / self.stamps_s).round();
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        format!("{stamp},{}\r\n", numbers.join(","))
    }
}

/// `m v`.
pub fn times(m: &Matrix, v: Vector) -> Vector {
    m.map(|row| row.iter().zip(&v).map(|(a, b)| a * b).sum())
}

/// `a b`.
pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
}

/// The transpose.
pub fn transposed(m: &Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

/// Rotation by a rotation vector (Rodrigues).
pub fn rotation(v: Vector) -> Matrix {
    let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (s, c) = match angle < 1e-9 {
        true => (1.0, 0.5),
        false => (angle.sin() / angle, (1.0 - angle.cos()) / (angle * angle)),
    };
    let k = [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]];
    let kk = product(&k, &k);
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| f64::from(u8::from(i == j)) + s * k[i][j] + c * kk[i][j]))
}

/// A turn by hand, from rest to rest, along one rotation vector in the body frame.
pub struct Turn {
    /// Attitude at its beginning, body to world.
    pub from: Matrix,
    /// Rotation vector in the body frame, rad.
    pub by: Vector,
    /// When it begins, s.
    pub begin_s: f64,
    /// Its length, s.
    pub lasts_s: f64,
}

impl Turn {
    /// From the attitude `from` (body to world) to one in which `up` of the body points up, to the accuracy of a hand.
    pub fn to(from: Matrix, up: Vector, begin_s: f64, random: &mut Random) -> Self {
        let held: Vector = std::array::from_fn(|i| up[i] + 0.04 * random.normal());
        let size = held.iter().map(|x| x * x).sum::<f64>().sqrt();
        let held = held.map(|x| x / size);
        let now = from[2];
        let axis = [0, 1, 2]
            .map(|i| held[(i + 1) % 3] * now[(i + 2) % 3] - held[(i + 2) % 3] * now[(i + 1) % 3]);
        let sine = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let cosine: f64 = held.iter().zip(&now).map(|(a, b)| a * b).sum();
        let angle = sine.atan2(cosine);
        // For a half turn any perpendicular axis will do.
        let axis = match sine > 1e-3 {
            true => axis.map(|x| x / sine),
            false if held[0].abs() < 0.7 => unit([0.0, -held[2], held[1]]),
            false => unit([held[2], 0.0, -held[0]]),
        };
        Self {
            from,
            by: axis.map(|x| x * angle),
            begin_s,
            lasts_s: 1.2 + 0.8 * angle + 0.5 * random.even(),
        }
    }

    /// Completed fraction of the way, and its rate of change, 1/s: a quintic without jerk at its ends.
    pub fn share(&self, t_s: f64) -> [f64; 2] {
        let x = ((t_s - self.begin_s) / self.lasts_s).clamp(0.0, 1.0);
        let done = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        let rate = 30.0 * x * x * (1.0 - x) * (1.0 - x) / self.lasts_s;
        [done, rate]
    }
}

/// `v` at length 1.
pub fn unit(v: Vector) -> Vector {
    let size = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / size)
}
