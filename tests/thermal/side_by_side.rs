//! Estimators of the literature and the joint one on the same recordings, with the hours in the chamber.

use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::{Batch, Manifest};
use mimu_tests::page::{Block, Table};
use mimu_thermal::basis::Shape;
use mimu_thermal::joint::{Choice, estimate};
use mimu_thermal::session::Session;
use rayon::prelude::*;

use crate::classic::{self, Classic};
use crate::simulation::Experiment;
use crate::soak;
use crate::study::{Errors, bound, rms, shares};

/// Lag of the dies, s.
const LAG_S: f64 = 60.0;

/// An estimator.
#[derive(Clone, Copy)]
enum Estimator {
    Joint(Choice),
    Classic(Classic),
}

/// Name and estimator.
type Row = (&'static str, Estimator);

const fn joint(shape: Shape, lag_s: Option<f64>) -> Estimator {
    Estimator::Joint(Choice { shape, lag_s })
}

const ON_SOAK: [Row; 2] = [
    ("each plateau", Estimator::Classic(Classic::Soak)),
    ("`mimu thermal fit`", joint(Shape::Spline, None)),
];
const ON_RAMP: [Row; 3] = [
    ("`mimu thermal fit`", joint(Shape::Spline, None)),
    ("the same with cubics", joint(Shape::Cubic, None)),
    ("niu's", Estimator::Classic(Classic::RampNiu)),
];

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, estimators"];

/// The table, over `runs` recordings of each kind.
pub fn blocks(runs: u64) -> Vec<Block> {
    let mut out = Table::new(&[
        "recording",
        "h",
        "estimator",
        "gyro: bias, deg/h; scale, cross terms, ppm",
        "accel: bias, µg; scale, cross terms, ppm",
        "95 % intervals that contain the truth, %",
    ]);
    let of_soak = |seed| soak::record(LAG_S, seed);
    table(runs, ("soak", soak::HOURS), &of_soak, &ON_SOAK, &mut out);
    for (name, whole) in [("whole cycle", true), ("half a cycle", false)] {
        let experiment = Experiment::ramp(LAG_S, whole);
        let hours = experiment.corners.last().map_or(0.0, |c| c.0) / 3600.0;
        let of_ramp = |seed| experiment.record(seed);
        table(runs, (name, hours), &of_ramp, &ON_RAMP, &mut out);
        let errors = bound(&experiment);
        row(&mut out, (name, hours), "Cramér-Rao bound", &errors, "-");
    }
    vec![Block::table(NAMES[0], &out)]
}

fn table(
    runs: u64,
    (name, hours): (&str, f64),
    record: &(impl Fn(u64) -> (Manifest, Batch) + Sync),
    rows: &[Row],
    out: &mut Table,
) {
    // All estimators use the same recordings; each is made and read once.
    let each = (0..runs).into_par_iter().map(|seed| {
        let (manifest, batch) = record(seed);
        let prepared = Prepared::of(manifest, &batch, STILL_FACTOR).expect("it is prepared");
        let session = Session::of(&prepared).expect("its thermometer works");
        let by = |(_, estimator): &Row| {
            let sessions = [session.clone()];
            let found = match *estimator {
                Estimator::Joint(choice) => estimate(&sessions, choice),
                Estimator::Classic(classic) => classic::estimate(&sessions, classic),
            };
            found
                .map(|joint| Errors::of(&joint.curves))
                .map_err(|e| e.to_string())
        };
        rows.iter().map(by).collect::<Vec<_>>()
    });
    let runs: Vec<Vec<Result<Errors, String>>> = each.collect();
    for (k, (estimator, ..)) in rows.iter().enumerate() {
        let good: Vec<&Errors> = runs.iter().filter_map(|r| r[k].as_ref().ok()).collect();
        if good.len() < runs.len() {
            let why = runs.iter().find_map(|r| r[k].as_ref().err());
            let refused = runs.len() - good.len();
            eprintln!(
                "{name}, {estimator}: {refused} refused: {}",
                why.map_or("", |w| w)
            );
        }
        if !good.is_empty() {
            let held = shares(&good).map(|s| format!("{s:.0}")).join(", ");
            row(out, (name, hours), estimator, &rms(&good), &held);
        }
    }
}

fn row(
    table: &mut Table,
    (name, hours): (&str, f64),
    estimator: &str,
    errors: &[f64; 6],
    held: &str,
) {
    let start = [
        name.to_string(),
        format!("{hours:.2}"),
        estimator.to_string(),
    ];
    let cells = errors.map(|e| format!("{e:.1}"));
    let cells = cells.chunks(3).map(|c| c.join(", "));
    table.row(start.into_iter().chain(cells).chain([held.to_string()]));
}
