//! Estimators of the literature and the joint one on the same recordings, with the hours in the chamber.

use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::{Batch, Manifest};
use mimu_thermal::classic::Classic;
use mimu_thermal::fit::{Estimator, Options, fit};
use mimu_thermal::session::Session;
use rayon::prelude::*;

use crate::simulation::Experiment;
use crate::soak;
use crate::study::{Errors, bound, rms, shares};

/// Lag of the dies, s.
const LAG_S: f64 = 60.0;

/// Name, estimator, and whether its lag is given as zero.
type Row = (&'static str, Estimator, bool);

const ON_SOAK: [Row; 2] = [
    ("soak", Estimator::Classic(Classic::Soak), false),
    ("joint", Estimator::Joint, false),
];
const ON_RAMP: [Row; 5] = [
    ("joint", Estimator::Joint, false),
    ("joint, without a lag", Estimator::Joint, true),
    ("one cubic", Estimator::Cubic, false),
    ("nodes", Estimator::Classic(Classic::Nodes), false),
    ("ramp-niu", Estimator::Classic(Classic::RampNiu), false),
];

/// Prints all tables.
pub fn run(runs: u64) {
    println!("{runs} runs, lag {LAG_S} s, worst axis, rms over -4 to 66 °C\n");
    println!(
        "| recording | chamber, h | estimator | gyro bias, deg/h | scale, ppm | cross terms, ppm | accel bias, µg | scale, ppm | cross terms, ppm | 95 % intervals that hold the truth, % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let of_soak = |seed| soak::record(LAG_S, seed);
    table(runs, "soak", soak::HOURS, &of_soak, &ON_SOAK);
    for (name, whole) in [("ramp, whole cycle", true), ("ramp, half a cycle", false)] {
        let experiment = Experiment::ramp(LAG_S, whole);
        let hours = experiment.corners.last().map_or(0.0, |c| c.0) / 3600.0;
        let of_ramp = |seed| experiment.record(seed);
        table(runs, name, hours, &of_ramp, &ON_RAMP);
        for (bound_of, lag) in [("lag unknown", true), ("lag known", false)] {
            let bound = bound(&experiment, lag);
            print(
                name,
                hours,
                &format!("Cramér-Rao bound, {bound_of}"),
                &bound,
                "",
            );
        }
    }
}

fn table(
    runs: u64,
    name: &str,
    hours: f64,
    record: &(impl Fn(u64) -> (Manifest, Batch) + Sync),
    rows: &[Row],
) {
    // All estimators use the same recordings; each is made and read once.
    let each = (0..runs).into_par_iter().map(|seed| {
        let (manifest, batch) = record(seed);
        let prepared = Prepared::of(manifest, &batch, STILL_FACTOR).expect("it is prepared");
        let session = Session::of(&prepared).expect("its thermometer works");
        let by = |(_, estimator, no_lag): &Row| {
            let options = Options {
                estimator: *estimator,
                lag_s: no_lag.then_some(0.0),
                range_c: None,
            };
            let found = fit(vec![session.clone()], &[], options);
            found
                .map(|f| Errors::of(&f.joint.curves))
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
            println!(
                "{name}, {estimator}: {refused} refused: {}",
                why.map_or("", |w| w)
            );
        }
        if !good.is_empty() {
            let held = shares(&good).map(|s| format!("{s:.0}")).join(", ");
            print(name, hours, estimator, &rms(&good), &held);
        }
    }
}

fn print(name: &str, hours: f64, estimator: &str, errors: &[f64; 6], held: &str) {
    let cells = errors.map(|e| format!("{e:.1}")).join(" | ");
    println!("| {name} | {hours:.2} | {estimator} | {cells} | {held} |");
}
