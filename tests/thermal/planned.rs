//! Standard deviations that `mimu thermal plan --procedure ramp` predicts, against the scatter over recordings of that plan.

use mimu::plan::design::budget::DwellNoise;
use mimu::quantity::Sensor;
use mimu_tests::page::{Block, Table};
use mimu_thermal::basis::Shape;
use mimu_thermal::joint::{Choice, Joint, estimate};
use mimu_thermal::plan::{Procedure, Request, plan, to_toml};
use nalgebra::SVector;
use rayon::prelude::*;

use crate::on_bench::{noiseless, read, session, unit};

/// The command's request without further options.
fn request() -> Request {
    Request {
        procedure: Procedure::Ramp,
        range_c: [-10.0, 70.0],
        shape: Shape::Cubic,
        kelvin_per_min: 2.0,
        set_points: 9,
        both_ways: false,
        course: Vec::new(),
        soak_s: 1800.0,
        dwell_s: 20.0,
        largest_dps: 50.0,
        sample_rate_hz: 100.0,
        noise: Sensor::BOTH.map(DwellNoise::fang),
    }
}

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, planned"];

/// Found over predicted values of the worst axis, at both ends of the range and between them.
pub fn blocks(runs: u64) -> Vec<Block> {
    let planned = plan(&request()).expect("a plan");
    let text = to_toml(&planned, request().sample_rate_hz);
    let mut file = unit(&read("rigs/fang-soak.toml"), 1);
    // As the plan assumes, the dies follow the chamber's temperature, and the noise is the one it was made for.
    file.thermal.board_lag_s = Some(10.0);
    file.thermal.board_heating_c = Some(0.0);
    file.thermal.die_heating_c = Some([0.0; 4]);
    (
        file.curves.gyro.noise_at_c_raw,
        file.curves.accel.noise_at_c_raw,
    ) = (None, None);
    file.converter.bits = Some(24);
    for (axes, noise) in [&mut file.unit.gyro_axes, &mut file.unit.accel_axes]
        .into_iter()
        .zip(request().noise)
    {
        (axes.white_si, axes.instability_si, axes.walk_si) =
            (Some([noise.n; 3]), Some([noise.b; 3]), Some([noise.k; 3]));
    }
    let choice = Choice {
        shape: Shape::Cubic,
        lag_s: None,
    };
    let by = |session| estimate(&[session], choice).expect("it is fitted");
    let each = (0..runs)
        .into_par_iter()
        .map(|k| by(session(&text, &file, 100 + k)));
    let each: Vec<Joint> = each.collect();
    // The curves of this unit are cubics, so a fit without noise is the truth.
    let truth = by(session(&text, &noiseless(&file), 1));
    let mut table = Table::new(&[
        "found over predicted at -10, 30, 70 °C",
        "bias",
        "scale factor",
        "cross terms",
    ]);
    for prediction in &planned.sensors {
        let sensor = prediction.sensor as usize;
        let mut cells: [Vec<String>; 3] = Default::default();
        for at in &prediction.at {
            let model = |joint: &Joint| {
                let curves = joint.curves[Sensor::BOTH[sensor]]
                    .as_ref()
                    .expect("recorded");
                curves.forward(at.temp_c)[0]
            };
            let numbers = |joint: &Joint| -> SVector<f64, 12> {
                mimu::triad::vector(&model(joint).matrix, &model(joint).bias)
            };
            let gains = model(&truth).matrix.diagonal();
            let errors: Vec<SVector<f64, 12>> = each
                .iter()
                .map(|joint| numbers(joint) - numbers(&truth))
                .collect();
            let squares = errors
                .iter()
                .map(|e| e.map(|x| x * x))
                .sum::<SVector<f64, 12>>()
                / runs as f64;
            let kinds = [
                (at.bias, &[9, 10, 11][..]),
                (at.scale, &[0, 4, 8]),
                (at.cross, &[1, 2, 3, 5, 6, 7]),
            ];
            for (cell, (promised, kind)) in cells.iter_mut().zip(kinds) {
                let relative = |k: usize| 1.0 / gains[if k < 9 { k / 3 } else { k - 9 }];
                let worst = kind
                    .iter()
                    .map(|k| squares[*k].sqrt() * relative(*k))
                    .fold(0.0, f64::max);
                cell.push(format!("{:.1}", worst / promised.unwrap_or(f64::NAN)));
            }
        }
        let cells = cells.map(|c| c.join(", "));
        table.row([prediction.sensor.to_string()].into_iter().chain(cells));
    }
    vec![Block::table(NAMES[0], &table)]
}
