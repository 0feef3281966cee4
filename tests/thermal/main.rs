//! Errors of the estimates over temperature, their bounds, and how often their intervals hold the truth: the table of `docs/thermal.md`.
//!
//! `cargo run --release -p mimu-tests --bin thermal -- RUNS`

mod simulation;
mod study;

use simulation::Experiment;
use study::{Study, print_header};

fn main() {
    let runs = std::env::args()
        .nth(1)
        .and_then(|a| a.parse().ok())
        .unwrap_or(200);
    let only = std::env::args().nth(2);
    let wanted = |name: &str| only.as_ref().is_none_or(|o| name.contains(o.as_str()));
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
