//! xu: Table 3 and Figs. 4 to 6, the errors over the rates. They show that the gyro about z is not linear.

use mimu_rig::random::Random;
use mimu_tests::page::{Block, Table, significant};
use nalgebra::Vector3;

use crate::plot::{Figure, Line, Panel};
use crate::xu::{Experiment, RUNS, averages, gyro};

/// Table 3, deg/s, as printed: input about x, y, z; error of x, y, z; lowest and highest.
const TABLE_3_BEFORE: [[[f64; 2]; 3]; 3] = [
    [[0.004, 0.288], [-7.305, -7.185], [-3.474, 2.825]],
    [[-3.445, 3.738], [-0.364, 0.4684], [-4.829, 4.105]],
    [[-37.773, 37.959], [-1.174, 1.607], [-17.449, 16.48]],
];
/// The same after calibration by the proposed method.
const TABLE_3_AFTER: [[[f64; 2]; 3]; 3] = [
    [[-0.142, 0.144], [-0.005, 0.034], [-0.081, 0.039]],
    [[-0.005, 0.014], [-0.15, 0.162], [0.007, 0.069]],
    [[-0.149, 0.218], [-0.214, 0.358], [-2.954, 4.838]],
];

/// Largest rate about z, deg/s.
const LARGEST: f64 = 3600.0;
const AXES: [&str; 3] = ["x", "y", "z"];

/// The multirate tests with a gyro z that is not linear.
///
/// After calibration (z, z) is not symmetric about zero: half the difference of its ends is odd in the rate, and their mean is even. The odd part is a
/// cubic minus its best line, which C contains; the even part is a square, which no pair of opposite rates shows. Its sign over the rates is that of
/// the ends before calibration, where half the span is 17.0 deg/s and 20.2 by Table 1.
fn bent() -> Experiment {
    let mut experiment = gyro();
    let [square, cube, line] = coefficients(&experiment);
    for sensed in &mut experiment.sensed {
        let w = sensed.z / LARGEST;
        sensed.z += square * w * w + cube * (w.powi(3) - line * w);
    }
    experiment
}

/// Of the square and the cube of the rate over 3600 deg/s, deg/s, and of the best line through that cube.
fn coefficients(experiment: &Experiment) -> [f64; 3] {
    let [low, high] = TABLE_3_AFTER[2][2];
    let rates = experiment.inputs.iter().map(|x| x.z / LARGEST);
    let power = |p: i32| rates.clone().map(|w| w.powi(p)).sum::<f64>();
    let line = power(4) / power(2);
    [-0.5 * (high + low), 0.5 * (high - low) / (1.0 - line), line]
}

/// Ends of the errors, input minus output, over the rates about each axis.
type Ends = [[[f64; 2]; 3]; 3];

/// Input minus output of each dwell.
type Errors = Vec<(Vector3<f64>, Vector3<f64>)>;

fn ends(errors: &Errors) -> Ends {
    std::array::from_fn(|about| {
        std::array::from_fn(|of| {
            let along = errors.iter().filter(|(input, _)| input[about] != 0.0);
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (_, e)| {
                [low.min(e[of]), high.max(e[of])]
            })
        })
    })
}

/// Before calibration, from the averages of Table 1 alone.
fn before(experiment: &Experiment) -> Errors {
    let unit = averages(experiment.table);
    let c = unit.matrix.try_inverse().expect("regular");
    let each = experiment.inputs.iter().zip(&experiment.sensed);
    each.map(|(input, sensed)| (*input, input - c * (sensed - unit.offset)))
        .collect()
}

/// After calibration, in one verification. The noise is that of linear gyros: the repeats of Table 1 do not see a nonlinearity that all share.
fn after(experiment: &Experiment, run: u64) -> Errors {
    let (sigma, rest) = gyro().noise();
    let mut random = Random::new(run, "xu after");
    let unit = experiment.of_the_day(&rest, &mut random);
    let found = (experiment.estimator)(&experiment.dwells(&unit, sigma, &mut random));
    let model = found;
    let verification = experiment.dwells(&unit, sigma, &mut random);
    let error = |o: &mimu::estimate::Observation| (o.input, o.input - model.apply(&o.raw));
    verification.iter().map(error).collect()
}

/// The ends after calibration, averaged over the runs.
fn mean_after(experiment: &Experiment) -> Ends {
    let mut mean = Ends::default();
    for run in 0..RUNS {
        let one = ends(&after(experiment, run));
        for (mean, one) in mean.as_flattened_mut().iter_mut().zip(one.as_flattened()) {
            for k in 0..2 {
                mean[k] += one[k] / RUNS as f64;
            }
        }
    }
    mean
}

/// Table 3 recomputed.
fn table_3() -> Table {
    let (linear, bent) = (gyro(), bent());
    let (before, noise, after) = (
        ends(&before(&linear)),
        mean_after(&linear),
        mean_after(&bent),
    );
    let mut table = Table::new(&[
        "input, error of",
        "before, printed",
        "before, from Table 1",
        "after, printed",
        "after, from noise",
        "after, z not linear",
    ]);
    let range = |e: [f64; 2]| format!("{:.3} to {:.3}", e[0], e[1]);
    for about in 0..3 {
        for of in 0..3 {
            let columns = [&TABLE_3_BEFORE, &before, &TABLE_3_AFTER, &noise, &after];
            let cells = columns.map(|ends| range(ends[about][of]));
            let name = format!("{}, {}", AXES[about], AXES[of]);
            table.row([name].into_iter().chain(cells));
        }
    }
    table
}

/// Errors of the offset, axis by axis, for linear gyros and with the square in z.
fn offsets() -> Table {
    let mut table = Table::new(&[
        "estimator",
        "linear: o_x, deg/s",
        "o_y",
        "o_z",
        "z not linear: o_x",
        "o_y",
        "o_z",
    ]);
    let both = [gyro(), bent()];
    for k in 0..2 {
        let cells = both.each_ref().map(|experiment| {
            let (sigma, rest) = gyro().noise();
            let mut squares = Vector3::zeros();
            for run in 0..RUNS {
                let mut random = Random::new(run, "xu estimators");
                let unit = experiment.of_the_day(&rest, &mut random);
                let dwells = experiment.dwells(&unit, sigma, &mut random);
                let (_, estimator) = experiment.estimators()[k];
                let found = estimator(&dwells);
                squares += (found.offset - unit.offset).map(|e| e * e / RUNS as f64);
            }
            squares.map(|s| significant(s.sqrt()))
        });
        let [linear, bent] = cells.map(|c| -> [String; 3] { c.into() });
        let name = both[0].estimators()[k].0.to_string();
        table.row([name].into_iter().chain(linear).chain(bent));
    }
    table
}

/// Figs. 4 to 6: errors over the rates about each axis, before and after calibration, in one run.
pub fn figure() -> Figure {
    let bent = bent();
    let errors = [before(&bent), after(&bent, 0)];
    let mut panels = Vec::new();
    for (errors, when) in errors.iter().zip(["before", "after"]) {
        for about in 0..3 {
            let line = |of: usize| {
                let along = errors.iter().filter(|(x, _)| x[about] != 0.0);
                let mut points: Vec<(f64, f64)> = along.map(|(x, e)| (x[about], e[of])).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Line {
                    name: format!("error of {}", AXES[of]),
                    points,
                }
            };
            panels.push(Panel {
                title: format!("{when}, rate about {}", AXES[about]),
                x: "rate, deg/s".into(),
                y: "input minus output, deg/s".into(),
                lines: (0..3).map(line).collect(),
            });
        }
    }
    Figure {
        file: "xu-rates.svg".into(),
        columns: 3,
        panels,
    }
}

/// All blocks of this study.
pub fn blocks() -> Vec<Block> {
    let block = |name, table| Block::table(name, &table);
    vec![
        block("xu, table 3", table_3()),
        block("xu, offsets", offsets()),
    ]
}
