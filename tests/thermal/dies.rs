//! The joint estimate on ramps of units whose dies lag or lead: errors, bounds and intervals.

use mimu_tests::page::{Block, Table};

use crate::simulation::Experiment;
use crate::study::Study;

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, dies"];

/// Experiments, as in the table.
fn studies() -> [Study; 4] {
    [
        ("lag 60 s", 60.0),
        ("20 s", 20.0),
        ("180 s", 180.0),
        ("the dies lead by 30 s", -30.0),
    ]
    .map(|(name, lag_s)| Study::new(name, Experiment::ramp(lag_s, true)))
}

/// The table, over `runs` runs of each experiment.
pub fn blocks(runs: u64) -> Vec<Block> {
    let mut dies = Table::new(&[
        "dies",
        "95 % intervals that contain the truth (bias, scale, cross terms): gyro; accel, %",
        "estimated lag: mean, scatter, mean width of its interval, s",
        "intervals of the lag that contain the truth, %",
    ]);
    for study in studies() {
        let found = study.joint(runs);
        let six = |figures: [String; 6]| {
            let [a, b, c, d, e, f] = figures;
            format!("{a} {b} {c}; {d} {e} {f}")
        };
        dies.row([
            study.name(),
            six(found.held.map(|h| format!("{h:.1}"))),
            found.lag_s.map(|s| format!("{s:.1}")).join(", "),
            format!("{:.1}", found.lag_held),
        ]);
    }
    vec![Block::table(NAMES[0], &dies)]
}
