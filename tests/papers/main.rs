//! `make papers`: computes every figure of docs/papers.md and inserts it.
//!
//! People write the prose. This program makes the plots and the blocks between markers: `papers` writes them, `papers --check` compares them with the
//! document. The check omits the intervals, which take longest and have their own tests.

mod dwells;
mod fang;
mod intervals;
mod niu;
mod page;
mod plot;
mod schemes;
mod xu;

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let check = std::env::args().any(|a| a == "--check");
    match run(check) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("papers: {problem}");
            ExitCode::from(1)
        }
    }
}

fn run(check: bool) -> Result<(), Box<dyn std::error::Error>> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let path = docs.join("papers.md");
    let written = std::fs::read_to_string(&path)?;
    let (dwells, charts) = dwells::blocks();
    let mut blocks: Vec<page::Block> = fang::blocks()
        .into_iter()
        .chain(xu::blocks())
        .chain(niu::blocks())
        .chain(dwells)
        .chain(schemes::blocks())
        .collect();
    blocks.extend(match check {
        true => intervals::kept(),
        false => intervals::blocks(),
    });
    let computed = page::filled(&written, &blocks)?;
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
    std::fs::write(&path, computed)?;
    Ok(())
}
