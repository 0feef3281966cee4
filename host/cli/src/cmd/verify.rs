//! `mimu verify`.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::Calibration;
use mimu::calibration::verify::verify;
use mimu::data_sheet::DataSheet;
use mimu::noise::noise_file::NoiseFile;
use mimu_recording::error::Result;

use crate::arguments::{
    JsonArgs, NoiseArgs, PartArgs, StillArgs, StrictArgs, VerboseArgs, WholeTurnArgs,
};
use crate::output::print;
use crate::reading::{LogArgs, read_samples_or_means};
use crate::report;
use crate::report::data_sheet::{WithDataSheet, data_sheet_text};
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
    part: PartArgs,
    #[command(flatten)]
    strict: StrictArgs,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub(crate) fn run(args: &VerifyArgs) -> Result<Status> {
    let calibration = Calibration::read(&args.calibration)?;
    let part = args.part.part()?;
    let outputs = [args.json.file()];
    let log = args.log.or_gravity(calibration.recording.gravity_mps2);
    let prepared = read_samples_or_means(
        &args.recording,
        &log,
        args.still.search(),
        &outputs,
        &[Some(&args.calibration), args.noise.file.as_deref()],
    )?;
    let prepared = args.whole.apply(args.noise.apply(prepared)?)?;
    let result = verify(&prepared, &calibration)?;
    let noise = args
        .noise
        .file
        .as_deref()
        .map(NoiseFile::read)
        .transpose()?;
    let sheet = part.map(|part| DataSheet::of(&calibration, noise.as_ref(), &part));
    let mut text = report::verify_text(&result, args.verbose.verbose);
    text.extend(sheet.as_ref().map(data_sheet_text));
    let both = WithDataSheet {
        result: &result,
        data_sheet: sheet.as_ref(),
    };
    print(&args.json, &text, &both, None)?;
    Ok(args.strict.status(&result.judgement))
}
