//! `mimu fit`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use mimu::calibration::Calibration;
use mimu::fit::{Method, Options, fit};
use mimu::recording_problem::OfRecording;
use mimu::result::fit::{DwellResult, FitResult};
use mimu_recording::Reference;
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::stage;

use crate::arguments::{
    JsonArgs, KeepArgs, NoiseArgs, SensorArg, StillArgs, StrictArgs, VerboseArgs, WholeTurnArgs,
    WritingArgs,
};
use crate::output::{now, print};
use crate::reading::{LogArgs, read_samples_or_means};
use crate::report;
use crate::report::refused;
use crate::status::Status;

#[derive(Args)]
pub(crate) struct FitArgs {
    /// Recording, of samples or of means, or a log that `mimu import` reads
    recording: PathBuf,
    /// Hold out N contiguous blocks in turn, refit without each, and report the error on it
    #[arg(long, value_name = "blocks=N", default_value = "blocks=4", value_parser = holdout)]
    holdout: usize,
    /// Estimator if the input is known (reference = "table") [default: least-squares]
    #[arg(long, value_enum)]
    method: Option<MethodArg>,
    /// Calibrate one sensor only, if the experiment does not determine the other
    #[arg(long, value_enum, value_name = "SENSOR")]
    only: Option<SensorArg>,
    #[command(flatten)]
    log: LogArgs,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    whole: WholeTurnArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    /// List the dwells
    #[arg(long)]
    dwells: bool,
    /// Calibration file to write
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    writing: WritingArgs,
    #[command(flatten)]
    strict: StrictArgs,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum MethodArg {
    /// Forward form, all dwells at once
    LeastSquares,
    /// Forward form, bank of Kalman filters
    Kalman,
    /// Inverse form, differences of opposite rates
    #[value(alias = "xu")]
    InverseForm,
    /// Scale factors and biases only, from six positions
    SixPositions,
}

fn holdout(text: &str) -> std::result::Result<usize, String> {
    let count = text.strip_prefix("blocks=").unwrap_or(text);
    match count.parse() {
        Ok(1) => Err(
            "with one block nothing remains to be fitted: write at least 2, or 0 for none".into(),
        ),
        Ok(n) if n <= 1000 => Ok(n),
        _ => Err("write blocks=N with N from 2 to 1000, or blocks=0 for none".into()),
    }
}

/// What to do about readings that no calibration describes.
const CHECK: &str =
    "check range, columns and unit of the readings and record again, or write it all the same";

pub(crate) fn run(args: &FitArgs) -> Result<Status> {
    let options = Options {
        method: match args.method {
            None | Some(MethodArg::LeastSquares) => Method::LeastSquares,
            Some(MethodArg::Kalman) => Method::Kalman,
            Some(MethodArg::InverseForm) => Method::InverseForm,
            Some(MethodArg::SixPositions) => Method::SixPositions,
        },
        holdout_blocks: args.holdout,
        only: args.only.map(SensorArg::sensor),
    };
    let outputs = [args.output.as_deref(), args.json.file()];
    let inputs = [args.noise.file.as_deref()];
    let prepared = read_samples_or_means(
        &args.recording,
        &args.log,
        args.still.finding(),
        &outputs,
        &inputs,
    )?;
    args.writing.check(args.output.as_deref())?;
    let prepared = args.keep.apply(args.noise.apply(prepared)?);
    let prepared = args.whole.apply(prepared)?;
    if args.method.is_some() && prepared.manifest.reference != Reference::Table {
        return Err(Error::new(
            args.recording.display(),
            format!(
                "--method chooses between estimators for known inputs, and reference is \"{}\"",
                prepared.manifest.reference
            ),
            "leave --method out, or give the dwells their inputs (reference = \"table\")",
        ));
    }
    let (found, place) = (DwellResult::list(&prepared), prepared.place.clone());
    // After a refusal the user first needs the list of dwells. The error line comes last.
    let problems = OfRecording::prepared(&prepared);
    let fitted = fit(prepared, options).inspect_err(|_| {
        refused(&problems, false);
        eprint!("{}", report::dwell_table(&found));
    })?;
    let result = FitResult::of(&fitted);
    let mut text = report::fit_text(&result, args.verbose.verbose);
    if args.dwells {
        text.push('\n');
        text.push_str(&report::dwell_table(&result.dwells));
    }
    let refusal = args.writing.refusal(&result.judgement, &place, CHECK);
    let mut calibration = None;
    if let Some(path) = args.output.as_ref().filter(|_| refusal.is_none()) {
        let made = Calibration::of(&fitted, &[], &now())?;
        calibration = Some(stage(path, made.to_toml())?);
        text.push_str(&format!("\ncalibration: {}\n", path.display()));
    }
    print(&args.json, &text, &result, calibration)?;
    match refusal {
        Some(error) => Err(error),
        None => Ok(args.strict.status(&result.judgement)),
    }
}
