//! Studies over temperature: the tables of the pages in `docs/thermal`. `make papers` computes all of them and inserts them.
//!
//! `cargo run --release -p mimu-tests --features studies --bin thermal --` with one of
//!
//! | command | what |
//! |---|---|
//! | `dies [RUNS]` | errors of the joint estimate, their bounds, and how often its intervals contain the truth |
//! | `estimators [RUNS]` | estimators side by side, on a soak and on a ramp |
//! | `fang [RUNS]` | fang's soak, with and without misalignments |
//! | `compensation` | niu's six tests of compensation, by the device's arithmetic |
//! | `sweep [RUNS]` | poses spread over the sphere while the temperature goes up and down, with the default unit |
//! | `planned [RUNS]` | what `mimu thermal plan --procedure ramp` promises |
//! | `write [COMMAND ...]` | these tables, or all, into the pages, each with the number of runs of the pages |

mod classic;
mod compensation;
mod dies;
mod fang;
mod on_bench;
mod planned;
mod points;
mod side_by_side;
mod simulation;
mod soak;
mod study;
mod sweep;

use std::process::ExitCode;

use mimu_tests::page::{Block, Pages};

/// The pages with places for tables.
const PAGES: [&str; 3] = [
    "thermal/measured.md",
    "thermal/papers.md",
    "thermal/planning.md",
];

/// A command that computes tables.
struct Study {
    command: &'static str,
    /// Runs of the pages' tables.
    runs: u64,
    /// Places of its tables in the pages.
    names: &'static [&'static str],
    blocks: fn(u64) -> Vec<Block>,
}

const STUDIES: [Study; 6] = [
    Study {
        command: "dies",
        runs: 200,
        names: &dies::NAMES,
        blocks: dies::blocks,
    },
    Study {
        command: "estimators",
        runs: 20,
        names: &side_by_side::NAMES,
        blocks: side_by_side::blocks,
    },
    Study {
        command: "fang",
        runs: 1,
        names: &fang::NAMES,
        blocks: fang::blocks,
    },
    Study {
        command: "compensation",
        runs: 1,
        names: &compensation::NAMES,
        blocks: compensation::blocks,
    },
    Study {
        command: "sweep",
        runs: 20,
        names: &sweep::NAMES,
        blocks: sweep::blocks,
    },
    Study {
        command: "planned",
        runs: 8,
        names: &planned::NAMES,
        blocks: planned::blocks,
    },
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("thermal: {problem}");
            ExitCode::from(1)
        }
    }
}

fn run(arguments: &[String]) -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["write", wanted @ ..] => write(wanted),
        [command, runs @ ..] => {
            let study = found(command)?;
            let runs = match runs.first() {
                Some(runs) => runs.parse()?,
                None => study.runs,
            };
            for block in (study.blocks)(runs) {
                let text = block.text.unwrap_or_else(|| "no recording".into());
                println!("{}\n\n{text}", block.name);
            }
            Ok(())
        }
        [] => Err(format!("give a command: {}", commands()).into()),
    }
}

fn commands() -> String {
    STUDIES.each_ref().map(|s| s.command).join(", ") + " or write"
}

fn found(command: &str) -> Result<&'static Study, String> {
    let study = STUDIES.iter().find(|s| s.command == command);
    study.ok_or_else(|| format!("{command:?} is no command; choose {}", commands()))
}

/// Computes the studies `wanted`, or all, and inserts their tables. Each study is written as soon as it is ready.
fn write(wanted: &[&str]) -> Result<(), Box<dyn std::error::Error>> {
    for command in wanted {
        found(command)?;
    }
    for study in &STUDIES {
        if !wanted.is_empty() && !wanted.contains(&study.command) {
            continue;
        }
        let blocks = (study.blocks)(study.runs);
        let mut blocks: Vec<Block> = blocks.into_iter().map(Block::made_here).collect();
        let others = STUDIES.iter().filter(|s| s.command != study.command);
        blocks.extend(
            others
                .flat_map(|s| s.names)
                .map(|name| Block { name, text: None }),
        );
        Pages::read(&PAGES)?.filled(&blocks)?.write()?;
    }
    Ok(())
}
