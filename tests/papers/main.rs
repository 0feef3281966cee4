//! `make papers`: computes every figure of the pages in docs/papers and inserts it.
//!
//! People write the prose. This program makes the plots and the blocks between markers: `papers` writes them, `papers --check` compares them with the
//! document. The check omits the intervals, which take longest and have their own tests; `papers --keep-intervals` writes everything else.

mod estimators;
mod fang;
mod intervals;
mod niu;
mod plot;
mod published;
mod schemes;
mod xu;
mod xu_table_3;

use std::process::ExitCode;

use mimu_tests::page::{self, Pages};

/// Indices into fang, Table 2, of the positions that the filters for x, y and z are given, fang (26)-(28).
const FANG_FILTERS: [[usize; 4]; 3] = [[0, 1, 2, 3], [4, 5, 2, 6], [7, 8, 6, 3]];

/// The pages with places for figures.
const PAGES: [&str; 4] = [
    "papers/fang.md",
    "papers/xu.md",
    "papers/niu.md",
    "papers/designs.md",
];

fn main() -> ExitCode {
    let is_given = |flag: &str| std::env::args().any(|a| a == flag);
    let check = is_given("--check");
    match run(check, check || is_given("--keep-intervals")) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("papers: {problem}");
            ExitCode::from(1)
        }
    }
}

fn run(check: bool, keep_intervals: bool) -> Result<(), Box<dyn std::error::Error>> {
    let written = Pages::read(&PAGES)?;
    let mut blocks: Vec<page::Block> = fang::blocks()
        .into_iter()
        .chain(xu::blocks())
        .chain(xu_table_3::blocks())
        .chain(niu::blocks())
        .chain(schemes::blocks())
        .collect();
    blocks.extend(match keep_intervals {
        true => intervals::kept(),
        false => intervals::blocks(),
    });
    let computed = written.filled(&blocks)?;
    if check {
        return match written.first_difference(&computed) {
            Some([page, written, computed]) => Err(format!(
                "docs/{page} says\n  {written}\nand it comes out as\n  {computed}\nrun make papers"
            )
            .into()),
            None => Ok(()),
        };
    }
    let folder = page::docs().join("papers");
    std::fs::create_dir_all(&folder)?;
    xu_table_3::figure().draw(&folder)?;
    Ok(computed.write()?)
}
