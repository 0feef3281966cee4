//! fang, 5.2 and 5.3: a soak at nine temperatures with the noise of Table 5, and the errors that each estimator leaves.

use mimu::quantity::Sensor;
use mimu::triad::Forward;
use mimu_core::compensation::Affine;
use mimu_rig::rig_file::RigFile;
use mimu_tests::page::{Block, Table};
use mimu_thermal::joint::{self, Choice, Joint};
use mimu_thermal::session::Session;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::classic::{self, Classic};
use crate::on_bench::{noiseless, read, rms, session, unit};

/// Steps of a round: six faces, then six rates.
const STEPS: i32 = 12;
const FACES: i32 = 6;
const Z_UP: i32 = 4;

/// How the model at a temperature is made from the curves.
#[derive(Clone, Copy, PartialEq)]
enum Model {
    /// As they are.
    AsFitted,
    /// Scale factors and biases of the printed equations; misalignments from all scalars in the middle of the range, constant over temperature.
    WithM,
    /// The model of the middle of the range at all temperatures.
    OneTemperature,
}

/// Name, estimator (`None`: the joint one), and how its curves are used.
#[rustfmt::skip]
const ROWS: [(&str, Option<Classic>, Model); 6] = [
    ("all 18 scalars of a triad, at one temperature", Some(Classic::Soak), Model::OneTemperature),
    ("(33), (34) as printed", Some(Classic::SoakAsPrinted), Model::AsFitted),
    ("the same, with M of one temperature", Some(Classic::SoakAsPrinted), Model::WithM),
    ("(31), (32) with M constant", Some(Classic::SoakConstantM), Model::AsFitted),
    ("all 18 scalars of each plateau", Some(Classic::Soak), Model::AsFitted),
    ("`mimu thermal fit`", None, Model::AsFitted),
];

/// Errors of one run: accelerometer with z up, on all faces, gyro on the faces, gyro at rates.
type Errors = [Vec<Vector3<f64>>; 4];

const DEG_PER_H: f64 = 180.0 / std::f64::consts::PI * 3600.0;

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, fang, noise alone"];

/// The table, over `runs` soaks with the noise of Table 5 alone and the unit off the axes of the table by 2, -3 and 5 mm.
pub fn blocks(runs: u64) -> Vec<Block> {
    let (plan, mut file) = (
        read("plans/fang-soak.toml"),
        unit(&read("rigs/fang-soak.toml"), 1),
    );
    let truth = session(&plan, &noiseless(&file), 1);
    for axes in [&mut file.unit.gyro_axes, &mut file.unit.accel_axes] {
        (axes.instability_si, axes.walk_si) = (Some([0.0; 3]), Some([0.0; 3]));
    }
    vec![Block::table(NAMES[0], &table(runs, &plan, &file, &truth))]
}

fn table(runs: u64, plan: &str, file: &RigFile, truth: &Session) -> Table {
    let each = (0..runs)
        .into_par_iter()
        .map(|k| once(&session(plan, file, 100 + k), truth));
    let each: Vec<Vec<Errors>> = each.collect();
    let mut table = Table::new(&[
        "estimator",
        "accel, z up, x / y / z, mm/s²",
        "six faces, mm/s²",
        "gyro at rest, deg/h",
        "at 50 deg/s, deg/h",
    ]);
    for (row, (name, ..)) in ROWS.iter().enumerate() {
        let all = |kind: usize| -> Vec<Vector3<f64>> {
            each.iter()
                .flat_map(|r| r[row][kind].iter().copied())
                .collect()
        };
        let axes = rms(&all(0)).map(|e| format!("{:.1}", 1e3 * e));
        let whole = |kind, unit| (rms(&all(kind)).norm_squared() / 3.0).sqrt() * unit;
        table.row([
            name.to_string(),
            axes.as_slice().join(" / "),
            format!("{:.1}", whole(1, 1e3)),
            format!("{:.0}", whole(2, DEG_PER_H)),
            format!("{:.0}", whole(3, DEG_PER_H)),
        ]);
    }
    table
}

fn once(noisy: &Session, truth: &Session) -> Vec<Errors> {
    let by = |classic: Option<Classic>| {
        let sessions = [noisy.clone()];
        match classic {
            Some(classic) => classic::estimate(&sessions, classic),
            None => joint::estimate(&sessions, Choice::JOINT),
        }
        .expect("it is fitted")
    };
    let soak = by(Some(Classic::Soak));
    let each = ROWS
        .iter()
        .map(|(_, estimator, model)| errors(&by(*estimator), &soak, *model, truth));
    each.collect()
}

/// Errors on the noiseless readings: compensated minus known input.
fn errors(joint: &Joint, soak: &Joint, how: Model, truth: &Session) -> Errors {
    let mut out = Errors::default();
    for sensor in [0, 1] {
        let lag = joint.applied_s(Sensor::BOTH[sensor]);
        let die = truth.thermometer.die(lag, joint.starts[0]);
        let rows = &truth.rows[Sensor::BOTH[sensor]];
        let errors = rows.iter().map(|row| {
            let model = inverse(joint, soak, how, sensor, die.at(row.middle_s));
            (row.step % STEPS, model.apply(&row.raw) - row.input)
        });
        for (step, error) in errors {
            match (sensor, step < FACES) {
                (1, true) => {
                    out[1].push(error);
                    if step == Z_UP {
                        out[0].push(error);
                    }
                }
                (0, true) => out[2].push(error),
                (0, false) => out[3].push(error),
                _ => {}
            }
        }
    }
    out
}

fn inverse(joint: &Joint, soak: &Joint, how: Model, sensor: usize, die_c: f64) -> Affine<f64> {
    let at = |joint: &Joint, temp_c: f64| {
        let curves = joint.curves[Sensor::BOTH[sensor]]
            .as_ref()
            .expect("both were recorded");
        curves.forward(temp_c)[0]
    };
    let [low, high] = soak.curves[Sensor::BOTH[sensor]]
        .as_ref()
        .expect("both were recorded")
        .range_c;
    let middle = 0.5 * (low + high);
    let model = match how {
        Model::AsFitted => at(joint, die_c),
        Model::OneTemperature => at(joint, middle),
        Model::WithM => {
            let (own, all) = (at(joint, die_c), at(soak, middle).matrix);
            let m = Matrix3::from_fn(|i, j| all[(i, j)] / all[(i, i)]);
            let scale = Matrix3::from_diagonal(&own.matrix.diagonal());
            Forward {
                matrix: scale * m,
                bias: own.bias,
            }
        }
    };
    model.inverse().expect("scale factors do not vanish")
}
