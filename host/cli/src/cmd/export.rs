//! `mimu export`: one subcommand for each format of [`mimu_export`].

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::Calibration;
use mimu::calibration::thermal_biases::{self, ThermalBiases};
use mimu::noise::noise_file::NoiseFile;
use mimu_export::{Export, Format, Sources, heading};
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::read_text;
use mimu_recording::result_file::stage;
use serde::Serialize;

use crate::arguments::JsonArgs;
use crate::output::{check_outputs, print};

#[derive(Args)]
#[command(subcommand_value_name = "FORMAT", subcommand_help_heading = "Formats")]
pub struct ExportArgs {
    #[command(subcommand)]
    format: Format,
    /// Calibration file of `mimu fit -o`, `mimu diagnose -o` or `mimu thermal fit -o`; px4 and ardupilot also take the biases of a unit at rest
    #[arg(long, value_name = "FILE", global = true)]
    calibration: Option<PathBuf>,
    /// Noise file of the unit (`mimu allan -o`)
    #[arg(long, value_name = "FILE", global = true)]
    noise: Option<PathBuf>,
    /// File to write
    // Required, but clap does not allow that for a global argument.
    #[arg(short = 'o', long = "out", value_name = "FILE", global = true)]
    out: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgs,
}

/// The written file and its contents.
#[derive(Serialize)]
struct ExportResult {
    #[serde(flatten)]
    export: Export,
    file: String,
    bytes: usize,
}

pub fn run(args: &ExportArgs) -> Result<()> {
    let path = args
        .out
        .as_deref()
        .ok_or_else(|| Error::new("-o", "it is missing", "name the file to write: -o FILE"))?;
    if args.noise.is_some() && !args.format.has_noise() {
        let problem = "this format cannot contain the noise of a unit";
        return Err(Error::new("export", problem, "leave it out").about(Argument::Noise));
    }
    let sources = [args.calibration.as_deref(), args.noise.as_deref()];
    let inputs: Vec<_> = sources.into_iter().flatten().collect();
    check_outputs(&[Some(path), args.json.file()], &inputs)?;
    let named = args.calibration.as_deref().map(|p| p.display().to_string());
    let (mut calibration, mut biases) = (None, None);
    if let (Some(path), Some(place)) = (&args.calibration, &named) {
        let text = read_text(path)?;
        match args.format.takes_biases() && thermal_biases::is_one(&text) {
            true => biases = Some(ThermalBiases::parse(&text, place)?),
            false => calibration = Some(Calibration::parse(&text, place)?),
        }
    }
    let noise = args.noise.as_deref().map(NoiseFile::read).transpose()?;
    let from = Sources {
        calibration: calibration.as_ref().zip(named.as_deref()),
        biases: biases.as_ref(),
        noise: noise.as_ref(),
    };
    let export = args.format.export(&from)?;
    let content = export.content.clone();
    let result = ExportResult {
        file: path.display().to_string(),
        bytes: content.len(),
        export,
    };
    let mut lines = heading::for_terminal(&result.export);
    lines.push(format!("{}: {}", result.export.to, result.file));
    let text = lines.join("\n") + "\n";
    print(&args.json, &text, &result, Some(stage(path, content)?))
}
