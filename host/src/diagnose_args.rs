//! `mimu diagnose`: arguments and what follows from them.

use std::path::PathBuf;

use clap::Args;
use mimu::diagnose::diagnose;
use mimu::diagnose::removal::remove;
use mimu::dwell::Sensor;
use mimu::error::{Error, Result};
use mimu::fit::{Method, Options};
use mimu::report::{self, DiagnosisReport};
use mimu::verify::judge;

use crate::{JsonArgs, NoiseArgs, StillArgs, print, read};

#[derive(Args)]
pub struct DiagnoseArgs {
    /// Directory of the recording
    recording: PathBuf,
    /// Another recording of the unit, to judge what was found by
    #[arg(long, value_name = "REC")]
    verify: Option<PathBuf>,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub fn run(args: &DiagnoseArgs) -> Result<()> {
    let options = Options {
        method: Method::LeastSquares,
        holdout_blocks: 0,
        still_factor: args.still.factor,
        only: None,
    };
    let outputs = [args.json.file()];
    let inputs = [args.noise.file.as_deref()];
    let prepared = read(&args.recording, args.still.factor, &outputs, &inputs)?;
    let diagnosis = diagnose(args.noise.state(prepared)?, options)?;
    let mut second = None;
    if let Some(path) = &args.verify {
        let other = args
            .noise
            .state(read(path, args.still.factor, &outputs, &inputs)?)?;
        let model = |fit: &mimu::fit::Fit, s| fit.sensor(s).map(|f| f.estimated.triad.inverse);
        let [g0, a0] = Sensor::BOTH.map(|s| model(&diagnosis.before, s));
        let [g1, a1] = Sensor::BOTH.map(|s| model(&diagnosis.after, s));
        let cleaned =
            remove(&other, g1.as_ref(), a1.as_ref(), &diagnosis.effects).ok_or_else(|| {
                Error::new(
                    path.display(),
                    "the calibration is singular",
                    "look at the recordings",
                )
            })?;
        let before = judge(&other, [g0.as_ref(), a0.as_ref()])?;
        let after = judge(&cleaned, [g1.as_ref(), a1.as_ref()])?;
        second = Some((path.display().to_string(), [before, after]));
    }
    let found = DiagnosisReport { diagnosis, second };
    print(
        &args.json,
        &report::diagnosis_text(&found),
        &report::diagnosis_json(&found),
        None,
    )
}
