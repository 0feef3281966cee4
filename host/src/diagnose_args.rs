//! `mimu diagnose`: arguments and what follows from them.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::{Calibration, EffectTable, stage, to_toml};
use mimu::diagnose::diagnose;
use mimu::error::Result;
use mimu::fit::{Method, Options};
use mimu::report::{self, DiagnosisReport};
use mimu::verify::verify;

use crate::{JsonArgs, NoiseArgs, StillArgs, print, read};

#[derive(Args)]
pub struct DiagnoseArgs {
    /// Directory of the recording
    recording: PathBuf,
    /// Another recording of the unit, to judge what was found by
    #[arg(long, value_name = "REC")]
    verify: Option<PathBuf>,
    /// Calibration file to write, with the effects
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
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
    let outputs = [args.output.as_deref(), args.json.file()];
    let inputs = [args.noise.file.as_deref()];
    let prepared = read(&args.recording, args.still.factor, &outputs, &inputs)?;
    let diagnosis = diagnose(args.noise.state(prepared)?, options)?;
    let now = jiff::Timestamp::now()
        .round(jiff::Unit::Second)
        .unwrap_or_default()
        .to_string();
    let effects: Vec<EffectTable> = diagnosis
        .sensors
        .iter()
        .flat_map(|s| s.decision.accepted.iter().map(EffectTable::from))
        .collect();
    let after = to_toml(&diagnosis.after, &effects, &now);
    let mut second = None;
    if let Some(path) = &args.verify {
        let other = args
            .noise
            .state(read(path, args.still.factor, &outputs, &inputs)?)?;
        // By the files that they would be: what is judged is what is given away.
        let before = to_toml(&diagnosis.before, &[], &now);
        let judged = |text: &str| verify(&other, &Calibration::parse(text, "calibration")?);
        second = Some((
            path.display().to_string(),
            [judged(&before)?, judged(&after)?],
        ));
    }
    let mut calibration = None;
    if let Some(path) = &args.output {
        calibration = Some(stage(path, after)?);
    }
    let found = DiagnosisReport { diagnosis, second };
    print(
        &args.json,
        &report::diagnosis_text(&found),
        &report::diagnosis_json(&found),
        calibration,
    )
}
