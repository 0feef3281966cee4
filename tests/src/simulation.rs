//! Inertial units with known truth, held by hand or put on a table.
//!
//! Written from kinematics with its own quaternions and its own random numbers: a truth made by the code
//! under test would prove nothing.

/// Gravity of the simulated place, m/s².
pub const GRAVITY: f64 = 9.80665;

/// Three numbers along x, y, z.
pub type Vector = [f64; 3];

/// xorshift64*: the same numbers on every machine.
pub struct Random(u64);

impl Random {
    /// Generator with a seed of its own.
    pub fn new(seed: u64) -> Self {
        // Seeds are small numbers in a row; the generator needs many bits set.
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..8 {
            random.uniform();
        }
        random
    }

    /// Uniform from 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Zero mean, unit variance (Box and Muller).
    pub fn gaussian(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Between `-size` and `size`.
    pub fn within(&mut self, size: f64) -> f64 {
        size * (2.0 * self.uniform() - 1.0)
    }
}

/// Unit quaternion w, x, y, z: turns body axes into world axes.
#[derive(Debug, Clone, Copy)]
pub struct Attitude([f64; 4]);

impl Attitude {
    /// A turn by `angle` (rad) about the unit vector `axis`.
    pub fn turn(axis: Vector, angle: f64) -> Self {
        let (s, c) = (0.5 * angle).sin_cos();
        Self([c, s * axis[0], s * axis[1], s * axis[2]])
    }

    /// Any attitude, all equally likely.
    pub fn any(random: &mut Random) -> Self {
        let q: [f64; 4] = std::array::from_fn(|_| random.gaussian());
        let n = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        Self(q.map(|x| x / n))
    }

    /// `self` after `before`, both body to world.
    pub fn then(self, Self([w, x, y, z]): Self) -> Self {
        let [a, b, c, d] = self.0;
        Self([
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ])
    }

    /// The other way.
    pub fn back(self) -> Self {
        let [w, x, y, z] = self.0;
        Self([w, -x, -y, -z])
    }

    /// Axis and angle (0 to π) of the turn.
    pub fn axis_angle(self) -> (Vector, f64) {
        let [w, x, y, z] = if self.0[0] < 0.0 {
            self.0.map(|q| -q)
        } else {
            self.0
        };
        let s = (x * x + y * y + z * z).sqrt();
        let axis = if s > 0.0 {
            [x / s, y / s, z / s]
        } else {
            [1.0, 0.0, 0.0]
        };
        (axis, 2.0 * s.atan2(w))
    }

    /// Specific force at rest in body axes, m/s²: up, as the ground pushes.
    pub fn force(self) -> Vector {
        let [w, x, y, z] = self.0;
        // World's z axis seen from the body: last row of the body-to-world matrix.
        [
            GRAVITY * 2.0 * (x * z - w * y),
            GRAVITY * 2.0 * (y * z + w * x),
            GRAVITY * (1.0 - 2.0 * (x * x + y * y)),
        ]
    }
}

/// A triad with known truth: `u = P x + b + noise`, SI to raw.
#[derive(Debug, Clone, Copy)]
pub struct Triad {
    /// P by rows, raw per SI.
    pub matrix: [Vector; 3],
    /// b, raw.
    pub bias: Vector,
    /// Standard deviation of the white noise of one sample, raw.
    pub sigma: f64,
}

impl Triad {
    /// Noiseless reading of the input `x` (SI).
    pub fn exact(&self, x: Vector) -> Vector {
        std::array::from_fn(|i| {
            self.bias[i] + (0..3).map(|j| self.matrix[i][j] * x[j]).sum::<f64>()
        })
    }

    /// Reading of the input `x` (SI), averaged over `n` samples.
    pub fn read(&self, x: Vector, n: f64, random: &mut Random) -> Vector {
        self.exact(x)
            .map(|u| u + self.sigma / n.sqrt() * random.gaussian())
    }
}

/// An inertial unit with known truth.
#[derive(Debug, Clone, Copy)]
pub struct Unit {
    /// Gyro triad, rad/s to V.
    pub gyro: Triad,
    /// Accelerometer triad, m/s² to V. Lower triangular, so that its x axis and xy plane are the body's.
    pub accel: Triad,
}

impl Unit {
    /// A unit as fang's Table 4 has them (5 mV per deg/s about 2.5 V, 80 mV per m/s² about 1.65 V) with errors of some per
    /// cent and some degrees.
    pub fn any(random: &mut Random) -> Self {
        let mut triad = |scale: f64, null: f64, sigma: f64, lower: bool| Triad {
            matrix: std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    if i == j {
                        scale * (1.0 + random.within(0.03))
                    } else if lower && j > i {
                        0.0
                    } else {
                        scale * random.within(0.03)
                    }
                })
            }),
            bias: std::array::from_fn(|_| null + random.within(0.05)),
            sigma,
        };
        Self {
            gyro: triad(5e-3f64.to_degrees(), 2.5, 2e-3, false),
            accel: triad(0.08, 1.65, 2e-3, true),
        }
    }
}

/// One sample of a simulated recording.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Time, s.
    pub t_s: f64,
    /// Raw gyro, V.
    pub gyro: Vector,
    /// Raw accelerometer, V.
    pub accel: Vector,
}

/// How a person turns the unit from pose to pose.
#[derive(Debug, Clone, Copy)]
pub struct ByHand {
    /// Number of poses.
    pub poses: usize,
    /// Time in each pose, s.
    pub dwell_s: f64,
    /// Time of each turn, s.
    pub turn_s: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
}

/// Recording by hand: poses drawn at random, turns about one axis each that start and stop smoothly.
pub fn by_hand(unit: &Unit, plan: ByHand, random: &mut Random) -> Vec<Sample> {
    let [rest, moving] = [plan.dwell_s, plan.turn_s].map(|s| (s * plan.rate_hz).round() as usize);
    let mut samples = Vec::with_capacity(plan.poses * (rest + moving));
    let mut attitude = Attitude::any(random);
    let mut push = |attitude: Attitude, rate: Vector, random: &mut Random| {
        samples.push(Sample {
            t_s: samples.len() as f64 / plan.rate_hz,
            gyro: unit.gyro.read(rate, 1.0, random),
            accel: unit.accel.read(attitude.force(), 1.0, random),
        });
    };
    for pose in 0..plan.poses {
        for _ in 0..rest {
            push(attitude, [0.0; 3], random);
        }
        if pose + 1 == plan.poses {
            break;
        }
        let next = Attitude::any(random);
        let (axis, angle) = attitude.back().then(next).axis_angle();
        for k in 1..=moving {
            // Angle a(s) = A (s - sin(2πs)/2π): at rest at both ends.
            let s = k as f64 / moving as f64;
            let done = angle * (s - (std::f64::consts::TAU * s).sin() / std::f64::consts::TAU);
            let rate = angle / plan.turn_s * (1.0 - (std::f64::consts::TAU * s).cos());
            push(
                attitude.then(Attitude::turn(axis, done)),
                axis.map(|a| a * rate),
                random,
            );
        }
        attitude = next;
    }
    samples
}
