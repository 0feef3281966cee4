//! Flights with known truth: readings and a trajectory computed from the same curves, with errors of the reference and of the biases alone. With rests, the
//! same curves are followed from one rest to the next.

use std::fmt::Write as _;
use std::ops::Range;
use std::sync::Arc;

use mimu::in_use::Trajectory;
use mimu::noise::noise_file::NoiseFile;
use mimu_recording::error::Result;
use mimu_recording::{Column, Columns, InMemory, Manifest, RawUnit, Recording, Reference};
use mimu_rig::random::Random;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Samples of the unit, and poses of the reference, a second.
const RATE_HZ: f64 = 200.0;
const POSES_HZ: f64 = 20.0;
const GRAVITY: f64 = 9.81;
/// Densities at rest of gyro and accelerometer: white noise and random walk, in SI.
pub const WHITE: [f64; 2] = [1.7e-4, 2e-3];
const WALK: [f64; 2] = [2e-5, 5e-4];

/// What differs from a unit whose biases are zero, with a reference that is mounted and timed as it and errs by nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Flight {
    /// Length, s.
    pub duration_s: f64,
    /// What the readings have more than their inputs, for each input: errors of scale factors on the diagonal, of angles beside it.
    pub error: [Matrix3<f64>; 2],
    /// Biases in the middle, rad/s and m/s².
    pub bias: [Vector3<f64>; 2],
    /// Rotation vector from the unit's axes to those of the reference, rad.
    pub mounting: Vector3<f64>,
    /// Where the reference's point lies, m.
    pub lever_m: Vector3<f64>,
    /// How late the trajectory is: its pose at `t` is that of `t - late_s`.
    pub late_s: f64,
    /// White noise of its attitudes, rad, and of its positions, m.
    pub reference: [f64; 2],
    /// White noise of both sensors in motion over that at rest.
    pub white: [f64; 2],
    /// Whether it rests for half of each `CYCLE_S`.
    pub rests: bool,
    /// What the reference's frame is distorted by, alike in all of the flight: a point at `p` is seen at `p + strain p`.
    pub strain: Matrix3<f64>,
}

/// Markers about their centre, m, on a plate that is mounted as the reference.
const MARKERS: [[f64; 3]; 4] = [
    [0.06, 0.04, 0.0],
    [-0.06, 0.04, 0.0],
    [-0.06, -0.04, 0.0],
    [0.06, -0.04, 0.0],
];

/// The attitude that fits best to where the markers are seen (Wahba's problem, by Kabsch). A distorted plate seems turned, by an angle that depends on its attitude.
fn seen(attitude: &Rotation3<f64>, strain: &Matrix3<f64>) -> Rotation3<f64> {
    let each = MARKERS.map(|marker| {
        let marker = Vector3::from(marker);
        let at = attitude * marker;
        (at + strain * at) * marker.transpose()
    });
    let svd = each.into_iter().sum::<Matrix3<f64>>().svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return *attitude;
    };
    let last = (u * v_t).determinant().signum();
    // The markers of a plate have no extent across it: the least singular value is that of its normal.
    let least = svd.singular_values.imin();
    let mut signs = Vector3::repeat(1.0);
    signs[least] = last;
    Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&signs) * v_t)
}

/// A rest and a motion.
const CYCLE_S: f64 = 6.0;

/// A sum of sines.
struct Sines(Vec<[f64; 3]>);

impl Sines {
    /// `count` of the given amplitude together, `lowest` to `highest` Hz.
    fn new(random: &mut Random, count: usize, amplitude: f64, [lowest, highest]: [f64; 2]) -> Self {
        let mut one = || {
            let hz = lowest + (highest - lowest) * random.uniform();
            let turn = std::f64::consts::TAU;
            [
                amplitude / (count as f64).sqrt(),
                turn * hz,
                turn * random.uniform(),
            ]
        };
        Self((0..count).map(|_| one()).collect())
    }

    /// Value, first and second derivative at `t`.
    fn at(&self, t: f64) -> [f64; 3] {
        let each = self.0.iter().map(|[a, w, p]| {
            let (sin, cos) = (w * t + p).sin_cos();
            [a * sin, a * w * cos, -a * w * w * sin]
        });
        each.fold([0.0; 3], |sum, own| {
            std::array::from_fn(|k| sum[k] + own[k])
        })
    }
}

/// Roll, pitch and yaw, and the position, as functions of time.
struct Curves {
    angles: [Sines; 3],
    position: [Sines; 3],
    rests: bool,
}

impl Curves {
    fn new(random: &mut Random, rests: bool) -> Self {
        let angles = [(0.4, [0.1, 0.7]), (0.4, [0.1, 0.7]), (1.5, [0.05, 0.3])];
        Self {
            angles: angles.map(|(size, hz)| Sines::new(random, 4, size, hz)),
            position: [1.0, 1.0, 0.5].map(|size| Sines::new(random, 4, size, [0.05, 0.5])),
            rests,
        }
    }

    /// Where on the curves the unit is at `t`, and the first and second derivative of that: in a motion it goes as far as it would have without the rest.
    fn place(&self, t: f64) -> [f64; 3] {
        if !self.rests {
            return [t, 1.0, 0.0];
        }
        let (cycles, half) = ((t / CYCLE_S).floor(), 0.5 * CYCLE_S);
        let moved = (t - cycles * CYCLE_S - half).max(0.0);
        let turn = std::f64::consts::TAU / half;
        let (sin, cos) = (turn * moved).sin_cos();
        let begun = cycles * CYCLE_S;
        [
            begun + 2.0 * (moved - sin / turn),
            2.0 * (1.0 - cos),
            2.0 * turn * sin,
        ]
    }

    /// Value, first and second derivative by time of a curve.
    fn of(&self, curve: &Sines, t: f64) -> [f64; 3] {
        let [place, speed, faster] = self.place(t);
        let [value, first, second] = curve.at(place);
        [
            value,
            first * speed,
            second * speed * speed + first * faster,
        ]
    }

    fn attitude(&self, t: f64) -> Rotation3<f64> {
        let [roll, pitch, yaw] = [0, 1, 2].map(|k| self.of(&self.angles[k], t)[0]);
        Rotation3::from_euler_angles(roll, pitch, yaw)
    }

    fn position(&self, t: f64) -> Vector3<f64> {
        Vector3::from_fn(|k, _| self.of(&self.position[k], t)[0])
    }

    /// Rate and specific force in axes of the unit; the rate by the derivatives of the angles (Titterton and Weston, 3.6.3).
    fn inputs(&self, t: f64) -> [Vector3<f64>; 2] {
        let [[roll, p, _], [pitch, q, _], [_, r, _]] =
            [0, 1, 2].map(|k| self.of(&self.angles[k], t));
        let rate = Vector3::new(
            p - r * pitch.sin(),
            q * roll.cos() + r * pitch.cos() * roll.sin(),
            -q * roll.sin() + r * pitch.cos() * roll.cos(),
        );
        let acceleration = Vector3::from_fn(|k, _| self.of(&self.position[k], t)[2]);
        let force = self.attitude(t).inverse() * (acceleration + Vector3::z() * GRAVITY);
        [rate, force]
    }
}

/// Readings, a column for each axis.
#[derive(Debug)]
struct Samples(Vec<[f64; 6]>);

impl InMemory for Samples {
    fn rows(&self) -> usize {
        self.0.len()
    }

    fn columns(&self) -> Columns {
        Columns {
            gyro: true,
            accel: true,
            ..Columns::default()
        }
    }

    fn append(&self, column: Column, rows: Range<usize>, values: &mut Vec<f64>) -> Result<()> {
        values.extend(rows.map(|row| match column {
            Column::Raw(k) => self.0[row][k],
            _ => row as f64 / RATE_HZ,
        }));
        Ok(())
    }
}

impl Flight {
    /// The readings, and the trajectory as its file has it.
    pub fn flown(&self, seed: u64) -> (Recording, Trajectory) {
        let curves = Curves::new(&mut Random::new(seed, "curves"), self.rests);
        let mut random = Random::new(seed, "noise");
        let count = (self.duration_s * RATE_HZ) as usize;
        let mut walked = [Vector3::<f64>::zeros(); 2];
        let mut middle = walked;
        let rows = (0..count).map(|row| {
            let t = row as f64 / RATE_HZ;
            let (inputs, moves) = (curves.inputs(t), curves.place(t)[1] > 0.0);
            if row == count / 2 {
                middle = walked;
            }
            std::array::from_fn(|k| {
                let (s, axis) = (k / 3, k % 3);
                walked[s][axis] += WALK[s] / RATE_HZ.sqrt() * random.normal();
                let more = if moves { self.white[s] } else { 1.0 };
                let white = more * WHITE[s] * RATE_HZ.sqrt() * random.normal();
                inputs[s][axis]
                    + (self.error[s] * inputs[s])[axis]
                    + self.bias[s][axis]
                    + walked[s][axis]
                    + white
            })
        });
        let mut rows: Vec<[f64; 6]> = rows.collect();
        for row in &mut rows {
            for (k, cell) in row.iter_mut().enumerate() {
                *cell -= middle[k / 3][k % 3];
            }
        }
        let samples = Samples(rows);
        let manifest = Manifest::new("flight", RATE_HZ, GRAVITY, RawUnit::Si, Reference::Gravity);
        let recording = Recording::in_memory(manifest, Arc::new(samples)).expect("a recording");
        (recording, self.trajectory(&curves, &mut random))
    }

    /// White noise over that at rest in a segment of `segment_s`, if it is `white` in motion: a segment between rests includes some rest on both sides.
    pub fn in_segment(&self, white: f64, segment_s: f64) -> f64 {
        let moving = match self.rests {
            true => 0.5 * CYCLE_S / segment_s,
            false => 1.0,
        };
        (moving * white * white + 1.0 - moving).sqrt()
    }

    fn trajectory(&self, curves: &Curves, random: &mut Random) -> Trajectory {
        let mut text = String::new();
        let poses = ((self.duration_s - 1.0) * POSES_HZ) as usize;
        for k in 0..poses {
            let stamp = 0.5 + k as f64 / POSES_HZ;
            let t = stamp - self.late_s;
            let mut noise = |size: f64| Vector3::from_fn(|_, _| size * random.normal());
            let [turned, moved] = self.reference.map(&mut noise);
            let attitude = curves.attitude(t);
            let mut position = curves.position(t) + attitude * self.lever_m;
            let mut mounted = attitude * Rotation3::from_scaled_axis(self.mounting);
            if self.strain != Matrix3::zeros() {
                position += self.strain * position;
                mounted = seen(&mounted, &self.strain);
            }
            position += moved;
            mounted *= Rotation3::from_scaled_axis(turned);
            let q = UnitQuaternion::from_rotation_matrix(&mounted);
            let _ = writeln!(
                text,
                "{stamp} {} {} {} {} {} {} {}",
                position.x, position.y, position.z, q.i, q.j, q.k, q.w
            );
        }
        Trajectory::parse(&text, "flight").expect("a trajectory")
    }
}

/// The unit's noise at rest.
pub fn noise() -> NoiseFile {
    let mut text = String::from(
        "format = \"mimu-noise/1\"\ndevice = \"flight\"\nsample_rate_hz = 200.0\nduration_s = 10800.0\nconfidence = 0.95\n",
    );
    for (s, (sensor, unit)) in [("gyro", "rad/s"), ("accel", "m/s^2")]
        .into_iter()
        .enumerate()
    {
        for axis in ["x", "y", "z"] {
            let _ = writeln!(
                text,
                "[[channel]]\nname = \"{sensor}_{axis}\"\nunit = \"{unit}\"\nsamples = 2160000"
            );
            for (key, value) in [("n", WHITE[s]), ("k", WALK[s])] {
                let _ = writeln!(
                    text,
                    "{key} = {{ value = {value:e}, sigma = 0.0, lower = {value:e}, upper = {value:e}, unit = \"{unit}\" }}"
                );
            }
        }
    }
    NoiseFile::parse(&text, "noise").expect("a noise file")
}
