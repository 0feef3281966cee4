//! Results of recordings of every kind, frozen: values, kinds and ids; no sentences. A change of code that is meant to change nothing shows no difference.
//!
//! | module | what |
//! |---|---|
//! | `bench` | a folder with recordings, in which the command runs |
//! | `cases` | the recordings by kind, and the commands that are frozen of each |
//! | `snapshot` | what of a JSON is frozen, how it is written, and how two are compared |
//!
//! The command line and its JSON are frozen, not the library: both are promised to users ([changelog](../../../CHANGELOG.md)), and what stands behind them
//! may change.
//!
//! The snapshots, `tests/frozen/KIND.json`, are the behaviour at a time, right or wrong. A number that changes is a decision, and the commit that changes it
//! names it. This rewrites them; `git diff` then shows what changed:
//!
//! ```text
//! MIMU_FREEZE=write cargo test -p mimu-tests --test all frozen
//! ```
//!
//! `MIMU_FROZEN_CASES=hand,array` compares only the cases whose names contain one of these.

mod bench;
mod cases;
mod snapshot;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Map, Value};

use bench::Bench;
use cases::Case;

/// Snapshot of a kind of recordings.
fn file(kind: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("frozen/{kind}.json"))
}

/// The results of a case by its commands; `None` if its recordings are missing.
fn result(case: &Case) -> Option<Value> {
    let bench = Bench::new();
    (case.run)(&bench).then(|| bench.results())
}

#[test]
fn every_result_is_as_frozen() {
    let only = std::env::var("MIMU_FROZEN_CASES").unwrap_or_default();
    let of_interest = |case: &Case| {
        let name = format!("{}/{}", case.kind, case.name);
        only.is_empty() || only.split(',').any(|part| name.contains(part))
    };
    let cases: Vec<Case> = cases::all().into_iter().filter(of_interest).collect();
    let results: Vec<Option<Value>> = cases.par_iter().map(result).collect();
    let mut now: BTreeMap<&str, Map<String, Value>> = BTreeMap::new();
    for (case, result) in cases.iter().zip(results) {
        let kind = now.entry(case.kind).or_default();
        match result {
            Some(result) => {
                let before = kind.insert(case.name.clone(), result);
                assert!(before.is_none(), "two cases {}/{}", case.kind, case.name);
            }
            None => println!("skipped: {}/{}", case.kind, case.name),
        }
    }
    let write = std::env::var("MIMU_FREEZE").is_ok_and(|v| v == "write");
    let mut differences = Vec::new();
    for (kind, results) in now {
        let text = std::fs::read_to_string(file(kind)).unwrap_or_else(|_| "{}".into());
        let frozen: Value = serde_json::from_str(&text).expect("JSON");
        let Value::Object(mut frozen) = frozen else {
            panic!("{} is no object", file(kind).display());
        };
        if write {
            frozen.extend(results);
            // What no case makes any more goes.
            frozen.retain(|name, _| {
                !only.is_empty() || cases.iter().any(|c| c.kind == kind && c.name == *name)
            });
            std::fs::write(file(kind), snapshot::text(&Value::Object(frozen))).expect("writable");
            continue;
        }
        // As it is read: both have the digits that a file has.
        let results = snapshot::text(&Value::Object(results));
        let results: Map<String, Value> = serde_json::from_str(&results).expect("JSON");
        for (name, result) in &results {
            let before = frozen.get(name).unwrap_or(&Value::Null);
            differences.extend(snapshot::differences(
                &format!("{kind}/{name}"),
                before,
                result,
            ));
        }
    }
    assert!(differences.is_empty(), "{}", snapshot::report(differences));
}

/// The command itself, in a process of its own: [`Bench::mimu`] starts this test with its arguments, so that 150 summaries are not printed.
#[test]
fn command() {
    if let Ok(arguments) = std::env::var(bench::ARGUMENTS) {
        let arguments = arguments.split('\n').map(Into::into);
        std::process::exit(mimu_cli::run(arguments).into());
    }
}
