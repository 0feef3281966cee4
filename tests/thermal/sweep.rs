//! `rig/plans/thermal.toml` with units of `rig/rigs/thermal.toml`: one fit per seed, against the truth.
//!
//! The bench itself gives the truth: the same unit without noise, for a few seconds at each of several temperatures in equilibrium, with six faces
//! and rates in both directions.

use std::fmt::Write as _;

use mimu::quantity::Sensor;
use mimu_allan::model::FLOOR;
use mimu_allan::variance::AllanModel;
use mimu_rig::rig_file::RigFile;
use mimu_tests::page::{Block, Table};
use mimu_thermal::fit::{Options, ThermalFit, fit};
use mimu_thermal::row::Row;
use nalgebra::{Matrix4, Matrix4x3, SVector};
use rayon::prelude::*;

use crate::on_bench::{noiseless, read, session, unit};

/// Temperatures of the chamber at which the truth is determined, °C.
const PROBES: [f64; 7] = [-16.0, -5.0, 6.0, 17.0, 28.0, 39.0, 50.0];
/// Units of bias, scale factor and cross terms: of the gyro, then of the accelerometer.
const UNITS: [f64; 6] = [
    180.0 / std::f64::consts::PI * 3600.0,
    1e6,
    1e6,
    1e6 / 9.80665,
    1e6,
    1e6,
];
/// If the rms of the errors over their standard deviations exceeds this, the standard deviations are wrong.
const WRONG: f64 = 2.0;

/// Twelve numbers at a temperature of the thermometer.
type At = (f64, SVector<f64, 12>);

/// Of one seed: for each of the six kinds the errors and their claimed standard deviations.
struct Outcome {
    /// Whether no kind of standard deviation is wrong.
    right: bool,
    numbers: [Vec<[f64; 2]>; 6],
}

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, sweep"];

/// The table: `runs` seeds, without and with the noise at rest.
pub fn blocks(runs: u64) -> Vec<Block> {
    let rig = read("rigs/thermal.toml");
    let plan = read("plans/thermal.toml");
    let of = |stated: bool| -> Vec<Outcome> {
        let each = (1..=runs).into_par_iter();
        each.map(|seed| once(&plan, &rig, stated, seed)).collect()
    };
    vec![Block::table(NAMES[0], &units(&of(false), &of(true)))]
}

/// Rms, in figures of the table.
fn cell(outcomes: &[Outcome], kind: usize, of: impl Fn(&[f64; 2]) -> f64) -> String {
    let all = outcomes.iter().flat_map(|o| &o.numbers[kind]);
    let (sum, n) = all.fold((0.0, 0.0), |(s, n), e| (s + of(e).powi(2), n + 1.0));
    let rms: f64 = f64::sqrt(sum / n);
    match rms {
        x if x < 10.0 => format!("{x:.1}"),
        x if x < 1000.0 => format!("{x:.0}"),
        x => format!("{:.0}", 100.0 * (x / 100.0).round()),
    }
}

/// Share of the 95 % intervals that contain the truth, %.
fn held(outcomes: &[Outcome], kind: usize) -> String {
    let all: Vec<&[f64; 2]> = outcomes.iter().flat_map(|o| &o.numbers[kind]).collect();
    let inside = all.iter().filter(|n| n[0].abs() <= 1.96 * n[1]).count();
    format!("{:.0}", 100.0 * inside as f64 / all.len() as f64)
}

fn units(bare: &[Outcome], stated: &[Outcome]) -> Table {
    let mut table = Table::new(&[
        &format!("{} seeds", bare.len()),
        "gyro: bias, deg/h; scale, cross terms, ppm",
        "accel: bias, µg; scale, cross terms, ppm",
    ]);
    let kinds = 0..6;
    let mut row = |name: String, cells: Vec<String>| {
        let cells = cells.chunks(3).map(|c| c.join(", "));
        table.row([name].into_iter().chain(cells));
    };
    for (with, outcomes) in [("", bare), ("with `--noise`: ", stated)] {
        let each = |of: fn(&[f64; 2]) -> f64| -> Vec<String> {
            kinds.clone().map(|k| cell(outcomes, k, of)).collect()
        };
        row(format!("{with}rms error"), each(|n| n[0]));
        row(
            format!("{with}error over its claimed standard deviation, rms"),
            each(|n| n[0] / n[1]),
        );
        row(
            format!("{with}95 % intervals that contain the truth, %"),
            kinds.clone().map(|k| held(outcomes, k)).collect(),
        );
        let right = outcomes.iter().filter(|o| o.right).count();
        let name = format!("{with}units that are right, of {}", outcomes.len());
        row(name, vec![right.to_string()]);
    }
    table
}

fn once(plan: &str, rig: &str, stated: bool, seed: u64) -> Outcome {
    let file = unit(rig, seed);
    let mut recorded = session(plan, &file, seed);
    if stated {
        recorded.noise_at_rest = at_rest(&file, seed);
    }
    match fit(vec![recorded], &[], Options::default()) {
        Err(refused) => {
            eprintln!("seed {seed}: refused: {refused}");
            Outcome {
                right: false,
                numbers: Default::default(),
            }
        }
        Ok(found) => judged(&found, &file, seed),
    }
}

/// Noise coefficients of the unit from a long recording at rest, raw.
fn at_rest(file: &RigFile, seed: u64) -> [Option<AllanModel>; 6] {
    let [gyro, accel] = Sensor::BOTH.map(|sensor| probes(file, sensor, seed)[0].1);
    std::array::from_fn(|channel| {
        let (axes, truth) = match channel < 3 {
            true => (&file.unit.gyro_axes, &gyro),
            false => (&file.unit.accel_axes, &accel),
        };
        let gain = truth[4 * (channel % 3)];
        let raw = |key: Option<[f64; 3]>| gain * key.expect("drawn")[channel % 3];
        Some(AllanModel {
            white: raw(axes.white_si).powi(2),
            flicker: FLOOR * raw(axes.instability_si).powi(2),
            walk: raw(axes.walk_si).powi(2) / 3.0,
        })
    })
}

fn judged(found: &ThermalFit, file: &RigFile, seed: u64) -> Outcome {
    let mut numbers: [Vec<[f64; 2]>; 6] = Default::default();
    for sensor in Sensor::BOTH {
        let curves = found.joint.curves[sensor].as_ref().expect("recorded");
        for (temp_c, truth) in probes(file, sensor, seed) {
            if !(curves.range_c[0]..=curves.range_c[1]).contains(&temp_c) {
                continue;
            }
            let [model, _] = curves.forward(temp_c);
            let error = mimu::triad::vector(&model.matrix, &model.bias) - truth;
            let (covariance, gain) = (curves.covariance(temp_c), truth[0]);
            for k in 0..12 {
                let kind = 3 * sensor as usize
                    + match k {
                        0 | 4 | 8 => 1,
                        9.. => 0,
                        _ => 2,
                    };
                let unit = UNITS[kind] / gain;
                let sigma = covariance[(k, k)].sqrt();
                numbers[kind].push([error[k] * unit, sigma * unit]);
            }
        }
    }
    let wrong = |n: &Vec<[f64; 2]>| {
        (n.iter().map(|n| (n[0] / n[1]).powi(2)).sum::<f64>() / n.len() as f64).sqrt() > WRONG
    };
    let names = [
        "gyro bias",
        "gyro scale",
        "gyro cross",
        "accel bias",
        "accel scale",
        "accel cross",
    ];
    let bad = numbers
        .iter()
        .zip(names)
        .filter(|(n, _)| wrong(n))
        .map(|(_, name)| name);
    let bad: Vec<&str> = bad.collect();
    let lags_s = found.joint.profiles.as_ref().map(|p| p.lag.value);
    let (gyro, accel) = (lags_s.gyro, lags_s.accel);
    eprintln!(
        "seed {seed}: {}, lags {gyro:.1}, {accel:.1} s, wrong: {}",
        found.verdict.name(),
        bad.join(", ")
    );
    Outcome {
        right: bad.is_empty(),
        numbers,
    }
}

/// True forward models of `sensor`, by least squares through readings without noise.
fn probes(file: &RigFile, sensor: Sensor, seed: u64) -> Vec<At> {
    let mut still = noiseless(file);
    still.thermal.on_before_s = Some(f64::INFINITY);
    let each = PROBES.iter().map(|chamber_c| {
        let mut plan = format!(
            "format = \"mimu-plan/1\"\nsample_rate_hz = 50.0\ncarrier = \"table\"\nlatitude_deg = 30.5\ngravity_mps2 = 9.793\n\
             chamber_c = [[0.0, {chamber_c:?}]]\nlead_in_s = 2.0\n"
        );
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let up: [f64; 3] = std::array::from_fn(|i| if i == axis { sign } else { 0.0 });
                let still = format!("[[step]]\nup = {up:?}\ndwell_s = 2.0\n");
                plan.push_str(&still);
                let up = up.map(f64::abs);
                let _ = write!(plan, "[[step]]\nup = {up:?}\nrate_dps = {:?}\ndwell_s = 2.0\n", 50.0 * sign);
            }
        }
        let probe = session(&plan, &still, seed);
        // At a rate, the accelerometer senses its distance from the table's axes, which no reference includes.
        let felt = |r: &&Row| sensor == Sensor::Gyro || r.step % 2 == 0;
        let rows: Vec<&Row> = probe.rows[sensor].iter().filter(felt).collect();
        let (mut gram, mut with) = (Matrix4::zeros(), Matrix4x3::zeros());
        for r in &rows {
            let x = r.input.push(1.0);
            gram += x * x.transpose();
            with += x * r.raw.transpose();
        }
        let solved = gram.try_inverse().expect("it is excited") * with;
        let temp_c = rows.iter().map(|r| probe.thermometer.at(r.middle_s).0).sum::<f64>() / rows.len() as f64;
        let number = |k: usize, _| if k < 9 { solved[(k % 3, k / 3)] } else { solved[(3, k - 9)] };
        (temp_c, SVector::<f64, 12>::from_fn(number))
    });
    each.collect()
}
