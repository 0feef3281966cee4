//! Whether six poses with the population of a part end in a calibration whose intervals hold, against as many as the targets need without.

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use rayon::prelude::*;

use crate::sensors::Sensor;
use crate::{End, Session, session};

/// Sessions of `units` units of a part make its population, and `sessions` further units are calibrated with it and without it; `kept` keeps those with it.
pub fn run(part: u64, units: u64, sessions: u64, kept: Option<&Path>) -> ExitCode {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, prior) = (folder.path().join("units"), folder.path().join("kind.toml"));
    let seeds = |from: u64, count: u64| (from..from + count).map(move |k| part + 10 * k);
    let first: Vec<u64> = seeds(0, units).collect();
    first.par_iter().for_each(|seed| {
        println!(
            "population: {}",
            session(*seed, Sensor::of(*seed), None, (Some(&made), "")).line()
        );
    });
    // Each session is a folder with the calibration and what else the wizard wrote; all boards have the same name.
    let fleet = ["fleet", "--labels"].map(OsString::from);
    let labels = folder.path().join("labels.csv");
    let stored = first.iter().filter(|s| calibration(&made, **s).exists());
    let rows: String = stored
        .map(|s| format!("{s}/calibration.toml,{s}\n"))
        .collect();
    std::fs::write(&labels, format!("file,unit\n{rows}")).expect("written");
    let paths = [
        labels.as_os_str(),
        made.as_os_str(),
        "--prior".as_ref(),
        prior.as_os_str(),
    ];
    let all = std::iter::once(OsString::from("mimu")).chain(fleet);
    if mimu_cli::run(all.chain(paths.map(OsString::from))) == 1 {
        return ExitCode::FAILURE;
    }
    let with = format!(" --prior {} --as-planned", prior.display());
    let further: Vec<u64> = seeds(units, sessions).collect();
    let each = further.par_iter().map(|seed| {
        let both = [("", None), (&with[..], kept)]
            .map(|(more, kept)| session(*seed, Sensor::of(*seed), None, (kept, more)));
        println!("without: {}\nwith:    {}", both[0].line(), both[1].line());
        both
    });
    let each: Vec<[Session; 2]> = each.collect();
    println!(
        "\n| | right | not right | dwells | minutes | inside, % | deg/s | mg |\n|---|---|---|---|---|---|---|---|"
    );
    for (k, name) in [(0, "without"), (1, "with the prior")] {
        println!("| {name} | {} |", line(each.iter().map(|both| &both[k])));
    }
    ExitCode::SUCCESS
}

fn calibration(folder: &Path, seed: u64) -> std::path::PathBuf {
    folder.join(seed.to_string()).join("calibration.toml")
}

/// How many ended in a right calibration and how many did not, medians of dwells and minutes, the share of the true values inside, and median errors
/// at 60 deg/s and at gravity.
fn line<'a>(all: impl Iterator<Item = &'a Session>) -> String {
    let (right, not): (Vec<&Session>, Vec<&Session>) = all.partition(|s| s.right());
    let median = |of: &dyn Fn(&Session) -> f64| {
        let mut all: Vec<f64> = right.iter().map(|s| of(s)).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let (dwells, minutes) = (median(&|s| s.dwells as f64), median(&|s| s.minutes));
    let (mut out, mut of) = (0_u32, 0_u32);
    for session in right.iter().chain(&not) {
        if let End::Stored(_, [outside, all], _) = session.end {
            (out, of) = (out + outside as u32, of + all as u32);
        }
    }
    let inside = 100.0 * f64::from(of - out) / f64::from(of);
    let error = |k: usize| {
        median(&|s| match s.end {
            End::Stored(errors, ..) => errors[k],
            _ => f64::NAN,
        })
    };
    format!(
        "{} | {} | {dwells} | {minutes:.1} | {inside:.1} | {:.3} | {:.2}",
        right.len(),
        not.len(),
        error(0),
        error(1)
    )
}
