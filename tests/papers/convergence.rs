//! fang, Figs. 8 to 15: the bank of filters (26) to (28) while the readings come in, with the calibration of Table 4 and the noise of Table 5 at 25 °C.

use mimu::quantity::Sensor;
use mimu::triad::{Angles, Forward, Physical, Triad};
use mimu_core::kalman::Filter;
use mimu_rig::ideal::{self, Fang, Ideal};
use mimu_rig::random::Random;
use mimu_tests::page::{Block, Table, significant};
use nalgebra::{Matrix3, Vector3};

use crate::FANG_FILTERS;
use crate::plot::{Figure, Line, Panel};
use crate::published::Scheme;

/// Readings a second, and readings of each position: two seconds, after which the paper has its results.
const RATE_HZ: usize = 1000;
const READINGS: usize = 2 * RATE_HZ;
/// Rate of the table, deg/s, which the paper does not give; gravity, m/s².
const INPUTS: [f64; 2] = [100.0, 9.80665];
/// Runs of the Monte Carlo.
const RUNS: u64 = 100;

/// Table 4 in volts per deg/s and per m/s², rad, volts. (It prints the biases in deg/s and m/s²; see `rig/rigs/fang.toml`.)
fn table_4() -> [Fang; 2] {
    let rad = |degrees: [f64; 3]| degrees.map(f64::to_radians);
    [
        Fang {
            scale: [5.07e-3, 5.09e-3, 5.17e-3],
            bias: [2.51, 2.52, 2.48],
            theta: rad([-0.18, 0.05, 0.15]),
            beta: rad([1.32, 1.05, 1.15]),
        },
        Fang {
            scale: [80.80e-3, 80.14e-3, 80.84e-3],
            bias: [1.79, 1.66, 1.74],
            theta: rad([0.06, 0.20, 0.19]),
            beta: rad([0.01, -0.02, -0.01]),
        },
    ]
}

/// Table 5 at 25 °C, V².
const VARIANCES: [[f64; 3]; 2] = [[1.27e-5, 0.92e-5, 1.92e-5], [3.57e-5, 4.23e-5, 2.47e-5]];
/// Corner frequencies of the parts' filters, Hz: ADXRS300 with the capacitor of its data sheet, MMA7260QT.
const FILTERS_HZ: [[f64; 3]; 2] = [[40.0; 3], [350.0, 350.0, 150.0]];

/// Kinds of parameters, with their units as in Table 4: volts, mV per SI unit, degrees.
const KINDS: [(&str, f64); 4] = [
    ("bias, V", 1.0),
    ("scale factor, mV per unit", 1e3),
    ("package misalignment, deg", 180.0 / std::f64::consts::PI),
    ("non-orthogonality, deg", 180.0 / std::f64::consts::PI),
];

/// Errors by kind and axis, in the units of [`KINDS`].
type Errors = [[f64; 3]; 4];

/// Noise of one axis in one position: white, or behind a single-pole filter, with the same variance.
struct Noise {
    last: f64,
    /// Correlation of neighbouring readings.
    keeps: f64,
    sigma: f64,
}

impl Noise {
    fn next(&mut self, random: &mut Random) -> f64 {
        let fresh = (1.0 - self.keeps * self.keeps).sqrt();
        self.last = self.keeps * self.last + fresh * self.sigma * random.normal();
        self.last
    }
}

/// Errors of the bank after every reading of the positions. The filters of the axes have four positions each.
fn run(sensor: Sensor, filtered: bool, seed: u64) -> Vec<Errors> {
    let s = sensor as usize;
    let truth: Ideal = table_4()[s].forward(ideal::Angles::Linear, [0.0; 3]);
    let positions = Scheme::FangNine.settings(Sensor::Accel).expect("poses");
    let mut random = Random::new(seed, &format!("fang convergence, {sensor}"));
    let mut out = vec![Errors::default(); READINGS];
    let mut found = vec![
        Forward {
            matrix: Matrix3::zeros(),
            bias: Vector3::zeros(),
        };
        READINGS
    ];
    for (axis, chosen) in FANG_FILTERS.iter().enumerate() {
        let variance = VARIANCES[s][axis];
        let keeps = match filtered {
            true => (-std::f64::consts::TAU * FILTERS_HZ[s][axis] / RATE_HZ as f64).exp(),
            false => 0.0,
        };
        let sigma = variance.sqrt();
        let mut noises = chosen.map(|_| Noise {
            last: sigma * random.normal(),
            keeps,
            sigma,
        });
        let mut filter = Filter::<f64>::diffuse(variance, INPUTS[s]);
        for forward in &mut found {
            for (noise, position) in noises.iter_mut().zip(chosen) {
                let input = INPUTS[s] * positions[*position].up;
                let clean = truth.read(input.into(), 1, &mut random)[axis];
                let raw = clean + noise.next(&mut random);
                filter.update(&input, raw, variance).expect("finite");
            }
            let mean = filter.mean();
            forward.bias[axis] = mean[0];
            for j in 0..3 {
                forward.matrix[(axis, j)] = mean[j + 1];
            }
        }
    }
    let t = &table_4()[s];
    let known = [t.bias, t.scale, t.theta, t.beta];
    for (errors, forward) in out.iter_mut().zip(found) {
        let triad = Triad::from_forward(forward, Vec::new()).expect("regular");
        let Physical {
            scale,
            misalignment,
            non_orthogonality,
            bias,
            ..
        } = triad.physical(Angles::Small);
        let all = [bias, scale, misalignment, non_orthogonality];
        for (kind, (values, known)) in all.iter().zip(known).enumerate() {
            errors[kind] = std::array::from_fn(|i| (values[i].value - known[i]) * KINDS[kind].1);
        }
    }
    out
}

/// The figure: a column for each figure of the paper, accelerometers above and gyros below.
pub fn figure() -> Figure {
    let mut panels = Vec::new();
    for (sensor, figures) in [
        (Sensor::Accel, [8, 9, 10, 11]),
        (Sensor::Gyro, [12, 13, 14, 15]),
    ] {
        let errors = run(sensor, true, 1);
        for (kind, figure) in figures.into_iter().enumerate() {
            let line = |axis: usize| Line {
                name: ["x (yz)", "y (zy)", "z (zx)"][axis].to_string(),
                points: (errors.iter().enumerate().skip(20).step_by(10))
                    .map(|(k, e)| ((k + 1) as f64 / RATE_HZ as f64, e[kind][axis]))
                    .collect(),
            };
            panels.push(Panel {
                title: format!("{sensor} (Fig. {figure})"),
                x: "time, s".into(),
                y: format!("error of {}", KINDS[kind].0),
                lines: (0..3).map(line).collect(),
            });
        }
    }
    Figure {
        file: "fang-convergence.svg".into(),
        columns: 4,
        panels,
    }
}

/// Rms errors after 0.1, 0.5 and 2 s, if the readings are independent and if they come through the parts' filters.
fn convergence() -> Table {
    let mut table = Table::new(&[
        "parameter",
        "after 0.1 s",
        "0.5 s",
        "2 s",
        "2 s, independent readings",
    ]);
    for sensor in [Sensor::Gyro, Sensor::Accel] {
        let rms = |filtered: bool, at: &[usize]| -> Vec<[f64; 4]> {
            let mut squares = vec![[0.0; 4]; at.len()];
            for seed in 0..RUNS {
                let errors = run(sensor, filtered, seed);
                for (squares, at) in squares.iter_mut().zip(at) {
                    for (square, errors) in squares.iter_mut().zip(&errors[*at - 1]) {
                        let each = errors.iter().map(|e| e * e).sum::<f64>();
                        *square += each / 3.0 / RUNS as f64;
                    }
                }
            }
            let root = |s: &[f64; 4]| s.map(f64::sqrt);
            squares.iter().map(root).collect()
        };
        let real = rms(true, &[RATE_HZ / 10, RATE_HZ / 2, READINGS]);
        let white = rms(false, &[READINGS]);
        for (kind, (name, _)) in KINDS.iter().enumerate() {
            let figures = real.iter().chain(&white).map(|r| significant(r[kind]));
            let name = format!("{sensor}, {name}");
            table.row([name].into_iter().chain(figures));
        }
    }
    table
}

/// The block of this study.
pub fn blocks() -> Vec<Block> {
    vec![Block::table("fang, convergence", &convergence())]
}
