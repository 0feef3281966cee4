//! fang, section 5.1: its Table 3 and noise, with six positions and its nine.

use mimu::estimate::known_input::least_squares;
use mimu::estimate::{EarthShare, Observation};
use mimu::quantity::Sensor;
use mimu::triad::{Angles, Forward, Physical};
use mimu_rig::ideal::{self, FANG_TABLE_3, Ideal};
use mimu_rig::random::Random;
use nalgebra::{Matrix3, Vector3};

use crate::FANG_FILTERS;
use crate::estimators::{kalman, six_positions};
use crate::published::Scheme;
use mimu_tests::page::{Block, Table, significant};

/// Runs of the Monte Carlo.
const RUNS: u64 = 1000;
/// Standard deviation of a reading, fang (35).
const SIGMA: f64 = 1e-3;
/// Readings at each position.
const READINGS: u32 = 2;

/// How the readings are fitted.
#[derive(Clone, Copy)]
enum Estimator {
    Scalar,
    LeastSquares,
    Kalman,
    /// fang (26)-(28): each filter is given four of the nine positions.
    KalmanOfFour,
}

/// A scheme and an estimator.
struct Contender {
    name: &'static str,
    positions: Vec<Vector3<f64>>,
    estimator: Estimator,
}

fn contenders() -> [Contender; 5] {
    let [six, nine] = [Scheme::SixFace, Scheme::FangNine].map(|scheme| {
        let settings = scheme.settings(Sensor::Accel).expect("a scheme of poses");
        settings.iter().map(|s| s.up).collect::<Vec<_>>()
    });
    [
        ("six faces, scale and bias only", &six, Estimator::Scalar),
        ("six faces, least squares", &six, Estimator::LeastSquares),
        ("fang's nine, least squares", &nine, Estimator::LeastSquares),
        ("fang's nine, Kalman", &nine, Estimator::Kalman),
        (
            "fang's nine, Kalman, four each",
            &nine,
            Estimator::KalmanOfFour,
        ),
    ]
    .map(|(name, positions, estimator)| Contender {
        name,
        positions: positions.clone(),
        estimator,
    })
}

impl Contender {
    fn dwells(&self, truth: &Ideal, random: &mut Random) -> Vec<Observation> {
        let dwell = |(dwell, up): (usize, &Vector3<f64>)| Observation {
            dwell,
            raw: truth.read((*up).into(), READINGS, random).into(),
            variance: Vector3::repeat(SIGMA * SIGMA / f64::from(READINGS)),
            input: *up,
            earth: EarthShare::NONE,
            change: Vector3::zeros(),
        };
        self.positions.iter().enumerate().map(dwell).collect()
    }
}

/// Errors of one calibration, by kind: bias, scale factor, package misalignment, non-orthogonality.
type Errors = [[f64; 3]; 4];

fn physical(forward: &Forward, angles: Angles) -> [Vector3<f64>; 4] {
    // Only the decomposition is needed, so no covariance is given.
    let triad = mimu::triad::Triad::from_forward(*forward, Vec::new()).expect("regular");
    let Physical {
        scale,
        misalignment,
        non_orthogonality,
        bias,
        ..
    } = triad.physical(angles);
    [bias, scale, misalignment, non_orthogonality]
        .map(|triple| Vector3::from(triple.map(|e| e.value)))
}

fn estimate(contender: &Contender, dwells: &[Observation]) -> Forward {
    match contender.estimator {
        Estimator::Scalar => six_positions(dwells),
        Estimator::LeastSquares => {
            let found = least_squares(dwells, &[], None).expect("determined");
            found.triad.forward
        }
        Estimator::Kalman => kalman(dwells, &[0; 3].map(|_| (0..dwells.len()).collect())),
        Estimator::KalmanOfFour => kalman(dwells, &FANG_FILTERS.map(|four| four.to_vec())),
    }
}

/// Mean squared errors over the runs.
fn monte_carlo(contender: &Contender, truth: &Ideal, of_truth: &[Vector3<f64>; 4]) -> Errors {
    let mut squares = Errors::default();
    for run in 0..RUNS {
        let mut random = Random::new(run, "fang");
        let dwells = contender.dwells(truth, &mut random);
        let found = physical(&estimate(contender, &dwells), Angles::Small);
        for kind in 0..4 {
            for i in 0..3 {
                let error = found[kind][i] - of_truth[kind][i];
                squares[kind][i] += error * error / RUNS as f64;
            }
        }
    }
    squares
}

/// Root mean square over the three sensors.
fn over_axes(squares: &[f64; 3]) -> f64 {
    (squares.iter().sum::<f64>() / 3.0).sqrt()
}

/// Rms errors of all contenders.
fn errors() -> Table {
    let (truth, of_truth) = (linear(), table_3());
    let mut table = Table::new(&[
        "scheme and estimator",
        "bias",
        "scale factor",
        "misalignment, rad",
        "non-orthogonality, rad",
        "largest mean error of P and b, standard errors",
    ]);
    for contender in contenders() {
        let squares = monte_carlo(&contender, &truth, &of_truth);
        let cells = squares.iter().map(|s| significant(over_axes(s)));
        let mean = match contender.estimator {
            Estimator::Scalar => "-".to_string(),
            _ => format!("{:.1}", largest_mean_error(&contender, &truth)),
        };
        let start = [contender.name.to_string()];
        table.row(start.into_iter().chain(cells).chain([mean]));
    }
    table
}

/// Decomposition of noiseless truth: the error of the small-angle approximation if the angles are not small.
fn decompositions() -> Table {
    let mut table = Table::new(&[
        "unit made with",
        "taken apart with",
        "bias",
        "scale factor, relative",
        "misalignment, rad",
        "non-orthogonality, rad",
    ]);
    let made = |angles| forward(&FANG_TABLE_3.forward(angles, [0.0; 3]));
    #[rustfmt::skip]
    let cases = [
        ("(16)", ideal::Angles::Linear, "small angles", Angles::Small, table_3()),
        ("(14), products kept", ideal::Angles::Small, "small angles", Angles::Small, table_3()),
        ("rotations", ideal::Angles::Exact, "small angles", Angles::Small, table_3()),
        ("rotations", ideal::Angles::Exact, "rotations", Angles::Exact, table_3_of_axes()),
    ];
    for (how, angles, apart, decomposition, truth) in cases {
        let found = physical(&made(angles), decomposition);
        let errors = (0..4).map(|kind| {
            let error = found[kind] - truth[kind];
            let error = if kind == 1 {
                error.component_div(&truth[kind])
            } else {
                error
            };
            match error.amax() {
                rounding if rounding < 1e-12 => "0".to_string(),
                largest => significant(largest),
            }
        });
        table.row(
            [how.to_string(), apart.to_string()]
                .into_iter()
                .chain(errors),
        );
    }
    table
}

fn forward(truth: &Ideal) -> Forward {
    Forward {
        matrix: Matrix3::from_fn(|i, j| truth.matrix[i][j]),
        bias: truth.bias.into(),
    }
}

/// Table 3 in the model that fang simulates, (16) and (18).
fn linear() -> Ideal {
    FANG_TABLE_3.forward(ideal::Angles::Linear, [SIGMA; 3])
}

/// Table 3 as bias, scale factors, misalignment, non-orthogonality.
fn table_3() -> [Vector3<f64>; 4] {
    let t = &FANG_TABLE_3;
    [t.bias, t.scale, t.theta, t.beta].map(Vector3::from)
}

/// The same for exact angles, with the scale factors of the sensors' true axes. An axis that (13) writes as 1 and β has the length √(1 + β²), which
/// belongs to the scale factor.
fn table_3_of_axes() -> [Vector3<f64>; 4] {
    let [bias, scale, theta, beta] = table_3();
    let lengths = Vector3::new(
        1.0,
        (1.0 + beta.x * beta.x).sqrt(),
        (1.0 + beta.y * beta.y + beta.z * beta.z).sqrt(),
    );
    let sines = Vector3::new(beta.x / lengths.y, beta.y / lengths.z, beta.z / lengths.z);
    [
        bias,
        scale.component_mul(&lengths),
        theta,
        sines.map(f64::asin),
    ]
}

/// The largest ratio of mean error to its standard error among all twelve parameters: shows whether an estimator is biased.
fn largest_mean_error(contender: &Contender, truth: &Ideal) -> f64 {
    let (mut sum, mut squares) = ([0.0; 12], [0.0; 12]);
    for run in 0..RUNS {
        let mut random = Random::new(run, "fang");
        let found = estimate(contender, &contender.dwells(truth, &mut random));
        for k in 0..12 {
            let error = match k {
                0..9 => found.matrix[(k / 3, k % 3)] - truth.matrix[k / 3][k % 3],
                _ => found.bias[k - 9] - truth.bias[k - 9],
            };
            sum[k] += error;
            squares[k] += error * error;
        }
    }
    let n = RUNS as f64;
    let in_errors = (0..12).map(|k| (sum[k] / n).abs() / (squares[k] / n / n).sqrt());
    in_errors.fold(0.0, f64::max)
}

/// All blocks of this study.
pub fn blocks() -> Vec<Block> {
    let block = |name, table| Block::table(name, &table);
    vec![
        block("fang, two readings", errors()),
        block("fang, angles", decompositions()),
    ]
}
