//! Errors of the estimates over temperature, their bounds, and how often their intervals contain the truth: the table of `docs/thermal.md`.
//!
//! `cargo run --release -p mimu-tests --features studies --bin thermal -- RUNS`, or one of
//!
//! | command | what |
//! |---|---|
//! | `estimators RUNS` | estimators side by side, on a soak and on a ramp |
//! | `cooling` | lines against curvature on a recording that only cools |
//! | `compensation [FOLDER]` | niu's six tests of compensation, by the device's arithmetic |
//! | `fang RUNS` | fang's soak, with and without misalignments |
//! | `planned RUNS` | what `mimu thermal plan --procedure ramp` promises |
//! | `sweep RUNS` | poses spread over the sphere while the temperature goes up and down, with the default unit |

mod compensation;
mod cooling;
mod fang;
mod on_bench;
mod planned;
mod side_by_side;
mod simulation;
mod soak;
mod study;
mod sweep;

use std::path::Path;

use simulation::Experiment;
use study::{Study, print_header};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count = |k: usize| arguments.get(k).and_then(|a| a.parse().ok());
    match arguments.first().map_or("", String::as_str) {
        "estimators" => side_by_side::run(count(1).unwrap_or(40)),
        "compensation" => compensation::run(arguments.get(1).map(Path::new)),
        "cooling" => cooling::run(),
        "fang" => fang::run(count(1).unwrap_or(10)),
        "planned" => planned::run(count(1).unwrap_or(20)),
        "sweep" => sweep::run(count(1).unwrap_or(20)),
        _ => coverage(count(0).unwrap_or(200), arguments.get(1)),
    }
}

/// Errors of the joint estimate and how often its intervals contain the truth; `only` selects an experiment.
fn coverage(runs: u64, only: Option<&String>) {
    let wanted = |name: &str| only.is_none_or(|o| name.contains(o.as_str()));
    print_header(runs);
    for (name, lag_s, whole) in [
        ("lag 60 s, whole cycle", 60.0, true),
        ("lag 20 s, whole cycle", 20.0, true),
        ("lag 180 s, whole cycle", 180.0, true),
        ("die leads by 30 s, whole cycle", -30.0, true),
        ("lag 60 s, half a cycle", 60.0, false),
    ] {
        if wanted(name) {
            let study = Study::new(name, Experiment::ramp(lag_s, whole));
            study.run_joint(runs);
            if lag_s == 60.0 {
                study.run_without_lag(runs);
            }
        }
    }
    if wanted("wander") {
        let walk = Experiment {
            walk: 0.03,
            ..Experiment::ramp(60.0, true)
        };
        Study::new("lag 60 s, whole cycle, biases that wander", walk).run_joint(runs);
    }
}
