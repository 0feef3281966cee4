//! The folder of a recording and the file of its truth: written completely or not at all.

use std::fmt::{Display, Write as _};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Output, Run, storage};
use crate::converter::RawUnit;
use crate::plan::{CarriedBy, Plan, Samples};
use crate::rig_file::{self, RigTruth};

/// Format of `recording.toml`.
const FORMAT: &str = "mimu-recording/1";
/// All files that a recording may contain.
const FILES: [&str; 3] = ["recording.toml", "samples.csv", "samples.parquet"];

/// Beginning of a truth file, which a rig file written by hand lacks.
const TRUTH: &str = "# The truth of the recording ";

/// `recording.toml`.
#[derive(Serialize)]
struct Recording<'a> {
    format: &'a str,
    device: &'a str,
    sample_rate_hz: f64,
    gravity_mps2: f64,
    raw_unit: RawUnit,
    /// Omitted if the Earth does not turn: otherwise readers would subtract the Earth's rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    latitude_deg: Option<f64>,
    reference: &'a str,
}

fn said(path: &Path, problem: impl Display, remedy: &str) -> String {
    format!("{}: {problem}; {remedy}", path.display())
}

/// The folder that contains `path`.
fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Refuses destinations that cannot or must not be written, before any time is spent.
pub(super) fn check(output: &Output) -> Result<(), String> {
    let Output { folder, truth, .. } = output;
    // Two paths to one place must not look like two places.
    let place = |path: &Path| match (parent(path).canonicalize(), path.file_name()) {
        (Ok(parent), Some(name)) if parent.is_dir() => Ok(parent.join(name)),
        _ => {
            let problem = "the folder for it does not exist";
            Err(said(path, problem, "make that folder first"))
        }
    };
    if place(truth)?.starts_with(place(folder)?) {
        let remedy = "write it elsewhere: a reader of the recording must not see the truth";
        return Err(said(
            truth,
            "the truth would be inside the recording",
            remedy,
        ));
    }
    if folder.symlink_metadata().is_ok() {
        if !is_recording(folder) {
            return Err(said(
                folder,
                "exists and is not a recording",
                "give another name",
            ));
        }
        if !output.replace {
            return Err(said(
                folder,
                "exists already",
                "give another name, or --replace",
            ));
        }
    }
    if truth.symlink_metadata().is_ok() {
        let begins = fs::read_to_string(truth).is_ok_and(|text| text.starts_with(TRUTH));
        if !begins || !has_format(truth, rig_file::FORMAT) {
            return Err(said(
                truth,
                "exists and is not a truth",
                "give another name with --truth",
            ));
        }
        if !output.replace {
            return Err(said(
                truth,
                "exists already",
                "give another name with --truth, or --replace",
            ));
        }
    }
    Ok(())
}

/// Whether a TOML file has this format.
fn has_format(path: &Path, format: &str) -> bool {
    #[derive(Deserialize)]
    struct Head {
        format: String,
    }
    let head = fs::read_to_string(path)
        .ok()
        .and_then(|text| toml::from_str::<Head>(&text).ok());
    head.is_some_and(|head| head.format == format)
}

/// Whether a folder contains only a recording, so that replacing it loses nothing else.
fn is_recording(folder: &Path) -> bool {
    let Ok(entries) = fs::read_dir(folder) else {
        return false;
    };
    let known = |name: &std::ffi::OsStr| FILES.iter().any(|file| name == *file);
    has_format(&folder.join(FILES[0]), FORMAT)
        && entries.flatten().all(|entry| known(&entry.file_name()))
}

/// Writes everything beside its destination first, then moves it there.
pub(super) fn write(
    plan: &Plan,
    truth: &RigTruth,
    seed: u64,
    run: Run,
    output: &Output,
) -> Result<(), String> {
    let Output {
        folder,
        truth: truth_path,
        ..
    } = output;
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |e: io::Error| {
            said(
                &path,
                format_args!("cannot be written: {e}"),
                "check space and permissions",
            )
        }
    };
    let unfinished = |path: &Path| {
        tempfile::Builder::new()
            .prefix(".unfinished-")
            .tempdir_in(parent(path))
            .map_err(failed(path))
    };
    let (beside, truth_beside) = (unfinished(folder)?, unfinished(truth_path)?);
    let (new, new_truth) = (
        beside.path().join("recording"),
        truth_beside.path().join("truth.toml"),
    );
    fs::create_dir(&new).map_err(failed(folder))?;
    let head = Recording {
        format: FORMAT,
        device: &plan.device,
        sample_rate_hz: plan.sample_rate_hz,
        gravity_mps2: plan.place.gravity,
        raw_unit: truth.converter.raw_unit,
        latitude_deg: truth.earth_rate.then_some(plan.place.latitude_deg),
        reference: match plan.carrier {
            CarriedBy::Table => "table",
            CarriedBy::Hands => "gravity",
        },
    };
    let head = toml::to_string(&head).expect("numbers and texts only");
    fs::write(new.join(FILES[0]), head).map_err(failed(folder))?;
    let stored = match output.samples {
        Samples::Csv => storage::csv(&new.join(FILES[1]), plan, &truth.further, run),
        Samples::Parquet => storage::parquet(&new.join(FILES[2]), plan, &truth.further, run),
    };
    stored.map_err(failed(folder))?;
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let text = format!(
        "{TRUTH}{name}, made with seed {seed}. As a rig file, with the same plan and seed, it\n\
         # makes the same samples again. It is for judging estimates; estimators must not read it.\n\
         # On a long ramp the dies (gyros x, y, z, accelerometer) lag temp_c by {} s.\n{}\n{}",
        truth
            .unit
            .die_lag_behind_reported_s()
            .map(|lag| format!("{lag:.3}"))
            .join(", "),
        further(truth),
        truth.file.to_toml()
    );
    fs::write(&new_truth, text).map_err(failed(truth_path))?;
    let (old, old_truth) = (beside.path().join("old"), truth_beside.path().join("old"));
    let away = [(folder, folder, &old), (truth_path, truth_path, &old_truth)];
    let here = [(truth_path, &new_truth, truth_path), (folder, &new, folder)];
    // A destination that did not exist at the start has been created since then, and is not replaced.
    let away = away
        .into_iter()
        .filter(|(path, ..)| output.replace && path.symlink_metadata().is_ok());
    put(&away.chain(here).collect::<Vec<_>>()).map_err(|(path, e)| failed(path)(e))
}

/// Comments on the further triads: their calibrations, as an estimator would give them.
fn further(truth: &RigTruth) -> String {
    let mut text = String::new();
    for triad in &truth.further {
        let Some(relation) = triad.relation(&truth.unit) else {
            continue;
        };
        let iron = match relation.iron_per_c {
            [0.0, 0.0, 0.0] => String::new(),
            per_c => format!(" Per kelvin of the board above 25 °C its iron adds {per_c:?} to x."),
        };
        let _ = writeln!(
            text,
            "# {}: x = C u + o in its own frame (x along its first axis, y in the plane of the first two), in {}, with C = {:?} and o = {:?}.\n\
             # Rotation vector to the frame of the first accelerometer: {:?} deg. It is {:.4} ms later than {}, at {:?} mm.{}",
            triad.name,
            triad.kind.unit(),
            relation.inverse.matrix,
            relation.inverse.offset,
            relation.rotation_deg,
            relation.delay_ms,
            triad.kind.reference(),
            relation.lever_mm,
            iron,
        );
    }
    text
}

/// Carries out moves (of what, from, to) in order, all or none. Errors: what could not be moved.
///
/// An old recording moves first and a new one last. So if this is interrupted anywhere, there is no recording without its truth or with another's.
fn put<'a>(moves: &[(&'a PathBuf, &PathBuf, &PathBuf)]) -> Result<(), (&'a Path, io::Error)> {
    for (i, (what, from, to)) in moves.iter().enumerate() {
        if let Err(e) = fs::rename(from, to) {
            // After a failure all moves are undone, the last first.
            for (_, from, to) in moves[..i].iter().rev() {
                let _ = fs::rename(to, from);
            }
            return Err((what, e));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_move_that_fails_takes_back_those_before_it() {
        let folder = tempfile::tempdir().unwrap();
        let [rec, old, truth, new_truth, new] =
            ["rec", "old", "truth", "new_truth", "new"].map(|name| folder.path().join(name));
        fs::write(&rec, "old recording").unwrap();
        fs::write(&new_truth, "new truth").unwrap();
        // There is no new recording to move.
        let moves = [
            (&rec, &rec, &old),
            (&truth, &new_truth, &truth),
            (&rec, &new, &rec),
        ];
        let (what, error) = put(&moves).unwrap_err();
        assert_eq!(
            (what, error.kind()),
            (rec.as_path(), io::ErrorKind::NotFound)
        );
        assert_eq!(fs::read_to_string(&rec).unwrap(), "old recording");
        assert!(!truth.exists() && new_truth.exists() && !old.exists());
    }
}
