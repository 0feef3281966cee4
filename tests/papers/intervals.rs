//! Whether the 95 % intervals contain the truth, over recordings from the virtual bench.

use mimu_tests::coverage::{Dwells, Tally, by_hand, with_a_table};

use mimu_tests::page::{Block, Table};

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

const NAMES: [&str; 4] = [
    "intervals, by lot",
    "intervals, as listed",
    "intervals, as listed, noise known",
    "intervals, by hand",
];

/// On a table in random order, in the listed order, in the listed order with the noise of the unit at rest; and by hand.
pub fn blocks() -> Vec<Block> {
    let hand = [by_hand(RUNS, false), by_hand(RUNS, true)].concat();
    let [randomised, listed, known] = [
        Dwells::Randomised,
        Dwells::AsListed,
        Dwells::AsListedWithNoise,
    ]
    .map(|dwells| with_a_table(RUNS, dwells));
    let all = [randomised, listed, known, hand];
    let block = |(name, tallies): (_, &Vec<Tally>)| Block::table(name, &table(tallies));
    NAMES.into_iter().zip(&all).map(block).collect()
}

/// The same blocks, without text: the document keeps what it has.
pub fn kept() -> Vec<Block> {
    NAMES.map(|name| Block { name, text: None }).into()
}
