//! `mimu verify`.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::Calibration;
use mimu::calibration::verify::verify;
use mimu_recording::error::Result;

use crate::arguments::{JsonArgs, NoiseArgs, StillArgs, StrictArgs, VerboseArgs, WholeTurnArgs};
use crate::output::print;
use crate::reading::{LogArgs, read_samples_or_means};
use crate::report;
use crate::status::Status;

#[derive(Args)]
pub(crate) struct VerifyArgs {
    /// Recording, of samples or of means, or a log that `mimu import` reads
    recording: PathBuf,
    /// Calibration file
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,
    #[command(flatten)]
    log: LogArgs,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    whole: WholeTurnArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    strict: StrictArgs,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub(crate) fn run(args: &VerifyArgs) -> Result<Status> {
    let calibration = Calibration::read(&args.calibration)?;
    let outputs = [args.json.file()];
    let log = args.log.or_gravity(calibration.recording.gravity_mps2);
    let prepared = read_samples_or_means(
        &args.recording,
        &log,
        args.still.finding(),
        &outputs,
        &[Some(&args.calibration), args.noise.file.as_deref()],
    )?;
    let prepared = args.whole.apply(args.noise.apply(prepared)?)?;
    let result = verify(&prepared, &calibration)?;
    print(
        &args.json,
        &report::verify_text(&result, args.verbose.verbose),
        &result,
        None,
    )?;
    Ok(args.strict.status(&result.judgement))
}
