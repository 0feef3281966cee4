//! `mimu apply`.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::apply::{Applied, Compensated};
use mimu_body::aligned::{Aligned, MeanUnit, apply};
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{CopiedTable, MANIFEST_FILE, Recording, ReplacedTriad, SampleFormat};

use crate::arguments::JsonArgs;
use crate::hint::OF_A_LOG;
use crate::opening::{Opened, open as open_calibration};
use crate::output::{check_outputs, print, progress};
use crate::reading::{LogArgs, imported_to, named, open};
use crate::report::{self, Joined};

#[derive(Args)]
pub(crate) struct ApplyArgs {
    /// Directory of the recording
    recording: PathBuf,
    /// Calibration file
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,
    /// Format of the samples: parquet or csv
    #[arg(long, default_value = "parquet")]
    format: SampleFormat,
    /// Replace an existing recording
    #[arg(long)]
    replace: bool,
    /// Write the mean unit of an array in the place of its first gyro and accelerometer: each in their frame and at their place
    #[arg(long)]
    mean: bool,
    /// Directory of the compensated recording, in which further triads are rotated into the frame of their reference and moved by their delays; for a log of text also a CSV file: a copy of its rows with compensated readings
    #[arg(short, value_name = "DIR|FILE.csv")]
    output: PathBuf,
    #[command(flatten)]
    json: JsonArgs,
    #[command(flatten, next_help_heading = OF_A_LOG)]
    log: LogArgs,
}

pub(crate) fn run(args: &ApplyArgs) -> Result<()> {
    let calibration = open_calibration(&args.calibration)?;
    let is_table = args
        .output
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    let (applied, mean) = match args.recording.is_file() && is_table {
        true => copied(args, calibration)?,
        false => written(args, calibration)?,
    };
    let mut text = report::apply_text(&applied);
    text.extend(mean.as_ref().map(report::mean_text));
    let mean = mean.map(|mean| serde_json::json!({ "mean": mean }));
    print(
        &args.json,
        &text,
        &Joined::of(&applied, mean.as_ref()),
        None,
    )
}

type Made = (Applied, Option<MeanUnit>);

/// Writes a recording.
fn written(args: &ApplyArgs, calibration: Opened) -> Result<Made> {
    let recording = open(&args.recording, &args.log)?;
    let calibration = calibration.of_readings(recording.manifest.raw_unit)?;
    let manifest = args.recording.join(MANIFEST_FILE);
    let inputs = [
        manifest.as_path(),
        &recording.samples,
        &args.calibration,
        &args.recording,
    ];
    check_outputs(&[args.json.file()], &inputs)?;
    let bar = progress("compensating");
    let done = apply(
        &recording,
        &calibration,
        (&args.output, args.format, args.replace),
        args.mean,
        |share| bar.reach(share),
    );
    bar.finish();
    done
}

/// Writes a copy of a text file, with its readings compensated: stamps and all other columns stay as they are.
fn copied(args: &ApplyArgs, calibration: Opened) -> Result<Made> {
    if args.output.exists() && !args.replace {
        let error = Error::new(
            args.output.display(),
            "it exists already",
            "choose another name, or replace it",
        );
        return Err(error.about(Argument::Replace));
    }
    let outputs = [Some(args.output.as_path()), args.json.file()];
    check_outputs(&outputs, &[&args.calibration, &args.recording])?;
    let (folder, options) = imported_to(&args.recording, &args.log)?;
    let recording = named(Recording::open(&folder)?, &args.recording);
    let calibration = calibration.of_readings(recording.manifest.raw_unit)?;
    let bar = progress("compensating");
    let mut aligned = Aligned::of(&recording, &calibration, args.mean)?;
    let mut compensated =
        Compensated::new(&recording, &calibration, |share| bar.reach(0.5 * share))?;
    let replaced = compensated.units().map(|(triad, unit)| ReplacedTriad {
        triad,
        unit: unit.to_owned(),
    });
    let mut copy = CopiedTable::open(&options, replaced.collect())?;
    let mut rows = 0;
    compensated.for_each(
        |share| bar.reach(0.5 + 0.5 * share),
        |_, clean| {
            aligned.place(clean);
            rows += clean.len() as u64;
            (0..clean.len()).try_for_each(|k| {
                copy.row(|column| {
                    let cell = clean.values(column).and_then(|values| values.get(k));
                    cell.copied().unwrap_or(f64::NAN)
                })
            })
        },
    )?;
    bar.finish();
    copy.write(&args.output)?;
    Ok(aligned.finish(compensated.into_applied(&args.output, rows)))
}
