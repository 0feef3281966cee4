//! Recordings by hand and on a table with known truth. Their physics is written here and shares nothing with the program: a wrong convention shared
//! by both would otherwise go unnoticed.

use std::f64::consts::PI;
use std::fs;
use std::ops::Range;
use std::path::Path;

pub use crate::random::Random;

pub type Vector = [f64; 3];
pub type Matrix = [[f64; 3]; 3];

pub const RATE_HZ: f64 = 100.0;
pub const GRAVITY: f64 = 9.81;

/// Raw readings (counts) for a perfect sensor's input: `u = P x + b`. The accelerometer's P is lower triangular, so the frame of a recording by hand
/// (x along its x, y in the plane of its x and y) is the frame here.
pub const GYRO_P: Matrix = [
    [5020.0, 60.0, -35.0],
    [-48.0, 4910.0, 72.0],
    [25.0, -66.0, 5105.0],
];
pub const GYRO_B: Vector = [37.0, -61.0, 18.0];
pub const ACCEL_P: Matrix = [
    [1655.0, 0.0, 0.0],
    [14.0, 1602.0, 0.0],
    [-9.0, 21.0, 1640.0],
];
pub const ACCEL_B: Vector = [-120.0, 64.0, 210.0];
/// Standard deviation of the noise of one sample, counts.
pub const GYRO_NOISE: f64 = 8.0;
pub const ACCEL_NOISE: f64 = 12.0;

pub fn times(m: &Matrix, v: &Vector) -> Vector {
    [0, 1, 2].map(|i| (0..3).map(|j| m[i][j] * v[j]).sum())
}

pub fn inverse(m: &Matrix) -> Matrix {
    let minor = |i: usize, j: usize| {
        let at = |r: usize, c: usize| m[(i + r) % 3][(j + c) % 3];
        at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| minor(j, i) / determinant))
}

/// Unit quaternion, w first: rotates a vector from the body frame to the world frame.
#[derive(Clone, Copy)]
pub struct Attitude([f64; 4]);

impl Attitude {
    pub fn about(axis: Vector, angle: f64) -> Self {
        let size = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        let (sin, cos) = (0.5 * angle).sin_cos();
        let [x, y, z] = axis.map(|a| a / size * sin);
        Self([cos, x, y, z])
    }

    pub fn then(self, next: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, next.0);
        Self([
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ])
    }

    /// Specific force at rest, which points up, in the body.
    pub fn gravity(self) -> Vector {
        let [w, x, y, z] = self.0;
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ]
        .map(|up| GRAVITY * up)
    }
}

/// A recording in memory, to be damaged before it is written.
#[derive(Clone)]
pub struct Samples {
    pub manifest: Vec<(&'static str, String)>,
    pub names: Vec<String>,
    /// NaN is an empty cell.
    pub rows: Vec<Vec<f64>>,
    /// Row range of each dwell.
    pub dwells: Vec<Range<usize>>,
}

impl Samples {
    pub fn new(reference: &str, names: &str) -> Self {
        let manifest = [
            ("format", "\"mimu-recording/1\"".to_string()),
            ("device", "\"unit-7\"".to_string()),
            ("sample_rate_hz", format!("{RATE_HZ:?}")),
            ("gravity_mps2", format!("{GRAVITY:?}")),
            ("raw_unit", "\"count\"".to_string()),
            ("reference", format!("\"{reference}\"")),
        ];
        Self {
            manifest: manifest.to_vec(),
            names: names.split(',').map(str::to_string).collect(),
            rows: Vec::new(),
            dwells: Vec::new(),
        }
    }

    pub fn column(&self, name: &str) -> usize {
        let found = self.names.iter().position(|known| known == name);
        found.unwrap_or_else(|| panic!("no column {name}"))
    }

    pub fn set(&mut self, key: &'static str, value: &str) {
        self.manifest.retain(|(known, _)| *known != key);
        if !value.is_empty() {
            self.manifest.push((key, value.to_string()));
        }
    }

    /// Changes the cells of `column` in `rows`.
    pub fn edit(&mut self, column: &str, rows: Range<usize>, change: impl Fn(f64) -> f64) {
        let column = self.column(column);
        for row in &mut self.rows[rows] {
            row[column] = change(row[column]);
        }
    }

    /// Changes the cells of all columns whose names begin so.
    pub fn edit_all(&mut self, prefix: &str, change: impl Fn(f64) -> f64) {
        for name in self.names.clone() {
            if name.starts_with(prefix) {
                self.edit(&name, self.all(), &change);
            }
        }
    }

    /// About as readings in SI.
    pub fn in_si(&mut self) {
        self.set("raw_unit", "\"SI\"");
        self.edit_all("accel", |u| u / 1640.0);
        self.edit_all("gyro", |u| u / 5000.0);
    }

    /// The channel keeps its first value.
    pub fn stick(&mut self, column: &str, rows: Range<usize>) {
        let value = self.rows[rows.start][self.column(column)];
        self.edit(column, rows, |_| value);
    }

    /// Writes rows twice, the last of them first.
    pub fn repeat(&mut self, rows: &[usize]) {
        for row in rows {
            self.rows.insert(*row, self.rows[*row].clone());
        }
    }

    pub fn keep_every(&mut self, nth: usize, from: usize) {
        let mut row = 0;
        self.rows.retain(|_| {
            row += 1;
            row <= from || row % nth == 0
        });
    }

    /// Vibration in a dwell.
    pub fn shake(&mut self, column: &str, dwell: usize) {
        let column = self.column(column);
        for (k, row) in self.rows[self.dwells[dwell].clone()].iter_mut().enumerate() {
            row[column] += 400.0 * (k as f64).sin();
        }
    }

    pub fn all(&self) -> Range<usize> {
        0..self.rows.len()
    }

    pub fn second_half(&self) -> Range<usize> {
        self.rows.len() / 2..self.rows.len()
    }

    /// Rows between dwell `k` and the next.
    pub fn turn(&self, k: usize) -> Range<usize> {
        self.dwells[k].end..self.dwells[k + 1].start
    }

    pub fn csv(&self) -> String {
        let mut text = self.names.join(",");
        for row in &self.rows {
            let cell = |x: &f64| match x.is_nan() {
                true => String::new(),
                false => x.to_string(),
            };
            text.push('\n');
            text.push_str(&row.iter().map(cell).collect::<Vec<_>>().join(","));
        }
        text + "\n"
    }

    pub fn manifest(&self) -> String {
        let line = |(key, value): &(&str, String)| format!("{key} = {value}\n");
        self.manifest.iter().map(line).collect()
    }

    pub fn write(&self, directory: &Path) {
        fs::create_dir_all(directory).unwrap();
        fs::write(directory.join("recording.toml"), self.manifest()).unwrap();
        fs::write(directory.join("samples.csv"), self.csv()).unwrap();
    }

    pub fn push(&mut self, row: Vec<f64>, random: &mut Random, rate: &Vector, force: &Vector) {
        let mut row = row;
        for (p, b, x, noise) in [
            (&GYRO_P, &GYRO_B, rate, GYRO_NOISE),
            (&ACCEL_P, &ACCEL_B, force, ACCEL_NOISE),
        ] {
            let u = times(p, x);
            row.extend((0..3).map(|i| (u[i] + b[i] + noise * random.normal()).round()));
        }
        self.rows.push(row);
    }
}

/// Poses of 3 s at rest, with smooth turns of 1.5 s between them.
pub fn by_hand_at(poses: usize, seed: u64, axis: impl Fn(&mut Random) -> Vector) -> Samples {
    const POSE_S: f64 = 3.0;
    const TURN_S: f64 = 1.5;
    let mut random = Random(seed);
    let mut out = Samples::new(
        "gravity",
        "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
    );
    let mut attitude = Attitude([1.0, 0.0, 0.0, 0.0]);
    let time = |out: &Samples| vec![out.rows.len() as f64 / RATE_HZ];
    for pose in 0..poses {
        let from = out.rows.len();
        for _ in 0..(POSE_S * RATE_HZ) as usize {
            out.push(time(&out), &mut random, &[0.0; 3], &attitude.gravity());
        }
        out.dwells.push(from..out.rows.len());
        if pose + 1 == poses {
            break;
        }
        let (axis, angle) = (axis(&mut random), 1.2 + 1.3 * random.uniform());
        let size = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        let count = (TURN_S * RATE_HZ) as usize;
        for k in 1..count {
            // The rate is a raised cosine: it begins and ends without a jerk.
            let part = k as f64 / count as f64;
            let turned = angle * (part - (2.0 * PI * part).sin() / (2.0 * PI));
            let rate = angle * (1.0 - (2.0 * PI * part).cos()) / TURN_S;
            let now = attitude.then(Attitude::about(axis, turned));
            let rate = axis.map(|a| a / size * rate);
            out.push(time(&out), &mut random, &rate, &now.gravity());
        }
        attitude = attitude.then(Attitude::about(axis, angle));
    }
    out
}

pub fn by_hand() -> Samples {
    by_hand_at(20, 1, Random::direction)
}

/// Each axis up and down on a rate table, at five rates about the vertical.
pub fn on_table() -> Samples {
    on_table_at(&[-90.0, -30.0, 0.0, 30.0, 90.0], &[0, 1, 2])
}

pub fn on_table_at(rates_dps: &[f64], axes: &[usize]) -> Samples {
    let mut random = Random(2);
    let mut out = Samples::new(
        "table",
        "t_s,step,ref_rate_x_dps,ref_rate_y_dps,ref_rate_z_dps,ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2,\
         gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
    );
    for &axis in axes {
        for up in [1.0, -1.0] {
            for &dps in rates_dps {
                let (mut rate, mut force) = ([0.0; 3], [0.0; 3]);
                (rate[axis], force[axis]) = (dps, up * GRAVITY);
                for dwelling in [false, true] {
                    let from = out.rows.len();
                    let step = match dwelling {
                        true => out.dwells.len() as f64,
                        false => -1.0,
                    };
                    let count = if dwelling { 200 } else { 30 };
                    for k in 0..count {
                        let part = if dwelling { 1.0 } else { f64::from(k) / 30.0 };
                        let mut row = vec![out.rows.len() as f64 / RATE_HZ, step];
                        let known = rate.iter().chain(&force);
                        row.extend(known.map(|x| if dwelling { *x } else { f64::NAN }));
                        let rate = rate.map(|r| part * r * PI / 180.0);
                        out.push(row, &mut random, &rate, &force);
                    }
                    if dwelling {
                        out.dwells.push(from..out.rows.len());
                    }
                }
            }
        }
    }
    out
}
