//! Whether the 95 % intervals hold the truth, over recordings from the virtual bench.

use mimu_tests::coverage::{Tally, by_hand, with_a_table};

use crate::page::{Block, Table};

/// Recordings of each kind.
const RUNS: u64 = 1000;

fn table(tallies: &[Tally]) -> Table {
    let mut table = Table::new(&[
        "estimator and sensor",
        "parameters",
        "holds the truth, %",
        "lowest to highest parameter, %",
        "rms error, sigmas",
    ]);
    for tally in tallies {
        let [mean, low, high] = tally.summary().map(|s| 100.0 * s);
        table.row([
            tally.name.clone(),
            tally.free.len().to_string(),
            format!("{mean:.1}"),
            format!("{low:.1} to {high:.1}"),
            format!("{:.3}", tally.rms()),
        ]);
    }
    table
}

/// With a table in an order drawn by lot and as listed, and by hand.
pub fn blocks() -> Vec<Block> {
    let hand = [by_hand(RUNS, false), by_hand(RUNS, true)].concat();
    vec![
        Block::table("intervals, by lot", &table(&with_a_table(RUNS, true))),
        Block::table("intervals, as listed", &table(&with_a_table(RUNS, false))),
        Block::table("intervals, by hand", &table(&hand)),
    ]
}
