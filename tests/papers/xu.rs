//! xu: its schedules, Tables 1 and 2 as truth, and the scatter of its five repeats as noise.

use mimu::estimate::{EarthShare, Observation};
use mimu::quantity::Sensor;
use mimu_core::compensation::Affine;
use mimu_rig::ideal::Inverse;
use mimu_rig::random::Random;
use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::estimators::{Estimator, inverse_by_least_squares, inverse_form, opposite_rates};
use crate::published::Scheme;
use mimu_tests::page::{Block, Table, significant};

/// Runs of the Monte Carlo.
pub const RUNS: u64 = 1000;

/// Table 1, five repeats: k_g11 to k_g33 by rows, then the offsets. The table's unit is rad/s, but only deg/s agrees with its Table 3.
const TABLE_1: [[f64; 5]; 12] = [
    [0.99974, 0.99973, 0.99973, 0.99970, 0.99969],
    [-0.01196, -0.01191, -0.01191, -0.01208, -0.01209],
    [-0.00059, -0.00056, -0.00063, -0.00058, -0.00058],
    [0.02402, 0.02390, 0.02394, 0.02391, 0.02393],
    [1.00045, 1.00047, 1.00044, 1.00046, 1.00050],
    [0.01051, 0.01053, 0.01052, 0.01055, 0.01055],
    [0.01089, 0.01087, 0.01075, 0.01090, 0.01093],
    [0.01486, 0.01487, 0.01487, 0.01495, 0.01496],
    [1.00546, 1.00551, 1.00590, 1.00607, 1.00600],
    [-0.03732, -0.04505, -0.04289, -0.04636, -0.04424],
    [-0.14450, -0.14354, -0.13033, -0.11033, -0.09103],
    [-0.29703, -0.41339, -0.30428, -0.36567, -0.37728],
];

/// Table 2: k_a11 to k_a33 by rows, then the offsets, according to the paper in mg.
const TABLE_2: [[f64; 5]; 12] = [
    [0.96698, 0.96695, 0.96676, 0.96642, 0.96625],
    [0.01448, 0.01419, 0.01444, 0.01441, 0.01417],
    [-0.00145, -0.00245, -0.00191, -0.00096, -0.00221],
    [-0.01760, -0.01753, -0.01748, -0.01769, -0.01769],
    [0.96947, 0.96966, 0.96998, 0.96948, 0.96964],
    [-0.00835, -0.00860, -0.00852, -0.00859, -0.00851],
    [0.01555, 0.014672, 0.01467, 0.014361, 0.01454],
    [-0.01525, -0.01447, -0.01490, -0.01503, -0.01505],
    [0.99333, 0.99286, 0.99299, 0.99357, 0.99357],
    [-0.16403, -0.16128, -0.17054, -0.16464, -0.16037],
    [0.11392, 0.10270, 0.11108, 0.10385, 0.10464],
    [0.28710, 0.256601, 0.27716, 0.25291, 0.25164],
];

fn mean(repeats: &[f64; 5]) -> f64 {
    repeats.iter().sum::<f64>() / 5.0
}

fn scatter(repeats: &[f64; 5]) -> f64 {
    let m = mean(repeats);
    (repeats.iter().map(|r| (r - m).powi(2)).sum::<f64>() / 4.0).sqrt()
}

/// Inverse model `x = C u + o` with the averages of a table.
pub fn averages(table: &[[f64; 5]; 12]) -> Affine<f64> {
    Affine {
        matrix: Matrix3::from_fn(|i, j| mean(&table[3 * i + j])),
        offset: Vector3::from_fn(|i, _| mean(&table[9 + i])),
    }
}

/// One of the two experiments: inputs in the paper's units, its repeats and its estimator.
pub struct Experiment {
    /// Known inputs of the dwells.
    pub inputs: Vec<Vector3<f64>>,
    /// What the linear sensors would need as inputs to read the same. Equal to the inputs, except for a sensor that is not linear.
    pub sensed: Vec<Vector3<f64>>,
    /// Its five repeats.
    pub table: &'static [[f64; 5]; 12],
    /// The paper's estimator.
    pub estimator: Estimator,
}

/// The multirate tests.
pub fn gyro() -> Experiment {
    let settings = Scheme::XuRates.settings(Sensor::Gyro).expect("rates");
    let inputs: Vec<Vector3<f64>> = (settings.iter())
        .map(|s| (s.rate * s.up).map(f64::to_degrees))
        .collect();
    Experiment {
        sensed: inputs.clone(),
        inputs,
        table: &TABLE_1,
        estimator: opposite_rates,
    }
}

fn accel() -> Experiment {
    let settings = Scheme::Xu33.settings(Sensor::Accel).expect("poses");
    let inputs: Vec<Vector3<f64>> = settings.iter().map(|s| s.up).collect();
    Experiment {
        sensed: inputs.clone(),
        inputs,
        table: &TABLE_2,
        estimator: inverse_form,
    }
}

impl Experiment {
    /// Dwell means of a unit, with independent noise `sigma` in the readings.
    pub fn dwells(
        &self,
        unit: &Affine<f64>,
        sigma: [f64; 3],
        random: &mut Random,
    ) -> Vec<Observation> {
        let truth = Inverse {
            matrix: std::array::from_fn(|i| std::array::from_fn(|j| unit.matrix[(i, j)])),
            offset: unit.offset.into(),
        };
        let truth = truth.forward(sigma).expect("regular");
        let each = self.inputs.iter().zip(&self.sensed);
        let read =
            |(dwell, (input, sensed)): (usize, (&Vector3<f64>, &Vector3<f64>))| Observation {
                dwell,
                raw: truth.read((*sensed).into(), 1, random).into(),
                variance: Vector3::from(sigma).map(|s| s * s),
                input: *input,
                earth: EarthShare::NONE,
                change: Vector3::zeros(),
            };
        each.enumerate().map(read).collect()
    }

    /// Sigmas of the twelve parameters for dwell means with unit noise: the root of the sum over the readings of the squared change that one of them makes.
    ///
    /// The estimator's own covariance would not do: it is scaled by the scatter of the one draw that it has seen.
    fn gains(&self) -> [f64; 12] {
        let step = 1e-6;
        let mut random = Random::new(0, "xu gains");
        let dwells = self.dwells(&averages(self.table), [step; 3], &mut random);
        let of = |dwells: &[Observation]| {
            let found = (self.estimator)(dwells);
            mimu::triad::vector(&found.matrix, &found.offset)
        };
        let (plain, mut squares) = (of(&dwells), [0.0; 12]);
        for reading in 0..3 * dwells.len() {
            let mut moved = dwells.clone();
            moved[reading / 3].raw[reading % 3] += step;
            let change = (of(&moved) - plain) / step;
            for (square, by) in squares.iter_mut().zip(change.iter()) {
                *square += by * by;
            }
        }
        squares.map(f64::sqrt)
    }

    /// For each axis the noise of a dwell mean that explains as much of the five repeats as possible, and for each parameter the remaining scatter.
    ///
    /// Five repeats determine a scatter to 35 %. The noise is the largest that no scatter of its row contradicts: the smallest ratio of scatter to
    /// gain.
    pub fn noise(&self) -> ([f64; 3], [f64; 12]) {
        let gains = self.gains();
        let row = |k: usize| if k < 9 { k / 3 } else { k - 9 };
        let sigma = [0, 1, 2].map(|i| {
            let of_row = (0..12).filter(|k| row(*k) == i);
            of_row
                .map(|k| scatter(&self.table[k]) / gains[k])
                .fold(f64::INFINITY, f64::min)
        });
        let rest = std::array::from_fn(|k| {
            let by_dwells = sigma[row(k)] * gains[k];
            (scatter(&self.table[k]).powi(2) - by_dwells.powi(2))
                .max(0.0)
                .sqrt()
        });
        (sigma, rest)
    }

    /// The paper's estimator and least squares.
    pub fn estimators(&self) -> [(&'static str, Estimator); 2] {
        [
            ("xu's inverse form", self.estimator),
            ("least squares, forward form", inverse_by_least_squares),
        ]
    }

    /// The unit on one day: the averages plus a random change from repeat to repeat.
    pub fn of_the_day(&self, rest: &[f64; 12], random: &mut Random) -> Affine<f64> {
        let mut unit = averages(self.table);
        for k in 0..12 {
            let off = rest[k] * random.normal();
            match k {
                0..9 => unit.matrix[(k / 3, k % 3)] += off,
                _ => unit.offset[k - 9] += off,
            }
        }
        unit
    }
}

/// Errors of the estimators against the unit of the day: rms over all elements of C and over o.
fn estimators(experiments: [&Experiment; 2]) -> Table {
    let mut table = Table::new(&[
        "estimator",
        "gyro: C",
        "o, deg/s",
        "accelerometer: C",
        "o, g",
    ]);
    let noises = experiments.map(Experiment::noise);
    for k in 0..2 {
        let cells = [0, 1].map(|sensor| {
            let (experiment, (sigma, rest)) = (experiments[sensor], &noises[sensor]);
            let [mut c, mut o] = [0.0; 2];
            for run in 0..RUNS {
                let mut random = Random::new(run, "xu estimators");
                let unit = experiment.of_the_day(rest, &mut random);
                let dwells = experiment.dwells(&unit, *sigma, &mut random);
                let (_, estimator) = experiment.estimators()[k];
                let found = estimator(&dwells);
                c += (found.matrix - unit.matrix).norm_squared();
                o += (found.offset - unit.offset).norm_squared();
            }
            let n = RUNS as f64;
            [c / n / 9.0, o / n / 3.0].map(|s| significant(s.sqrt()))
        });
        let name = experiments[0].estimators()[k].0.to_string();
        table.row([name].into_iter().chain(cells.into_iter().flatten()));
    }
    table
}

/// How much regression on the noisy side shrinks C: the largest ratio, among the axes, of noise variance to mean squared input.
fn attenuation(experiment: &Experiment) -> f64 {
    let (sigma, _) = experiment.noise();
    let n = experiment.inputs.len();
    let signal = DMatrix::from_fn(n, 3, |i, j| experiment.inputs[i][j]);
    let normal = signal.transpose() * &signal / n as f64;
    (0..3)
        .map(|j| sigma[j] * sigma[j] / normal[(j, j)])
        .fold(0.0, f64::max)
}

/// All blocks of this study.
pub fn blocks() -> Vec<Block> {
    let (g, a) = (gyro(), accel());
    let block = |name, table| Block::table(name, &table);
    let noise = |e: &Experiment| e.noise().0.map(significant).join(", ");
    let facts = format!(
        "- Noise of a dwell mean, x, y, z: gyro {} deg/s; accelerometer {} g.\n- Regressing on the noisy side shrinks C by at most {:.1e} (gyro) and {:.1e} (accelerometer).",
        noise(&g),
        noise(&a),
        attenuation(&g),
        attenuation(&a)
    );
    vec![
        Block {
            name: "xu, noise",
            text: Some(facts),
        },
        block("xu, estimators", estimators([&g, &a])),
    ]
}
