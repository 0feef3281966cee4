//! `mimu apply`.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::Calibration;
use mimu::calibration::apply::apply;
use mimu_recording::error::Result;
use mimu_recording::{MANIFEST_FILE, Recording, SampleFormat};

use crate::arguments::JsonArgs;
use crate::output::{check_outputs, print, progress};
use crate::reading::{LogArgs, folder};
use crate::report;

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
    /// Directory of the compensated recording
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    log: LogArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub(crate) fn run(args: &ApplyArgs) -> Result<()> {
    let calibration = Calibration::read(&args.calibration)?;
    let recording = Recording::open(&folder(&args.recording, &args.log)?)?;
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
        &args.output,
        args.format,
        args.replace,
        |share| bar.reach(share),
    );
    bar.finish();
    let applied = done?;
    print(&args.json, &report::apply_text(&applied), &applied, None)
}
