//! Whether the 95 % intervals of least squares contain the truth, over recordings from the virtual bench.

use mimu_tests::coverage::{Dwells, Tally, by_hand, with_a_table};

use mimu_tests::page::{Block, Table};

/// Recordings of each kind.
const RUNS: u64 = 1000;

const NAME: &str = "intervals";

/// On a table in random order, in the listed order, in the listed order with the noise of the unit at rest; and by hand.
pub fn blocks() -> Vec<Block> {
    let mut table = Table::new(&[
        "recordings and sensor",
        "parameters",
        "holds the truth, %",
        "lowest to highest parameter, %",
        "rms error, sigmas",
    ]);
    let mut row = |name: String, tally: &Tally| {
        let [mean, low, high] = tally.summary().map(|s| 100.0 * s);
        table.row([
            name,
            tally.free.len().to_string(),
            format!("{mean:.1}"),
            format!("{low:.1} to {high:.1}"),
            format!("{:.3}", tally.rms()),
        ]);
    };
    for (order, dwells) in [
        ("random order", Dwells::Randomised),
        ("listed order", Dwells::AsListed),
        ("listed order, noise known", Dwells::AsListedWithNoise),
    ] {
        for tally in with_a_table(RUNS, dwells) {
            let name = tally.name.replace("known inputs", order);
            row(name, &tally);
        }
    }
    for quiet in [false, true] {
        for tally in by_hand(RUNS, quiet) {
            row(tally.name.clone(), &tally);
        }
    }
    vec![Block::table(NAME, &table)]
}

/// The same block, without text: the document keeps what it has.
pub fn kept() -> Vec<Block> {
    vec![Block {
        name: NAME,
        text: None,
    }]
}
