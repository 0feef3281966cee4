//! `make papers`: computes every figure of docs/papers.md and inserts it.
//!
//! People write the prose. This program makes the plots and the blocks between markers: `papers` writes them, `papers --check` compares them with the
//! document. The check omits the intervals, which take longest and have their own tests; `papers --keep-intervals` writes everything else.

mod convergence;
mod dwells;
mod fang;
mod intervals;
mod niu;
mod plot;
mod schemes;
mod xu;
mod xu_table_3;

use std::path::Path;
use std::process::ExitCode;

use mimu_tests::page;

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
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let path = docs.join("papers.md");
    let written = std::fs::read_to_string(&path)?;
    let (dwells, charts) = dwells::blocks();
    let mut blocks: Vec<page::Block> = fang::blocks()
        .into_iter()
        .chain(convergence::blocks())
        .chain(xu::blocks())
        .chain(xu_table_3::blocks())
        .chain(niu::blocks())
        .chain(dwells)
        .chain(schemes::blocks())
        .collect();
    blocks.extend(match keep_intervals {
        true => intervals::kept(),
        false => intervals::blocks(),
    });
    let computed = page::filled("docs/papers.md", &written, &blocks)?;
    if check {
        let differs = written
            .lines()
            .zip(computed.lines())
            .find(|(w, c)| !page::agree(w, c));
        return match differs {
            Some((w, c)) => Err(format!(
                "docs/papers.md says\n  {w}\nand it comes out as\n  {c}\nrun make papers"
            )
            .into()),
            None => Ok(()),
        };
    }
    let folder = docs.join("papers");
    std::fs::create_dir_all(&folder)?;
    for chart in &charts {
        chart.draw(&folder)?;
    }
    for figure in [convergence::figure(), xu_table_3::figure()] {
        figure.draw(&folder)?;
    }
    std::fs::write(&path, computed)?;
    Ok(())
}
