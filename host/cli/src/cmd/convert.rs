//! `mimu convert`.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use mimu::calibration::Calibration;
use mimu_export::{FORMATS, Noise, Sources};
use mimu_recording::result_file::stage;
use mimu_recording::{Error, RawUnit, Result};
use serde_json::json;

use super::export::written;
use crate::arguments::JsonArgs;
use crate::opening::{Opened, open_all};
use crate::output::{check_outputs, print};
use crate::overwriting::check_overwritten;

/// Name of the format of mimu's own file.
const OWN: &str = "mimu";

#[derive(Args)]
pub struct ConvertArgs {
    /// Calibration file of mimu or of another program; or the two of a program that writes one of each triad
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Format to write: one of `mimu export`, or mimu for a calibration file
    #[arg(long, value_name = "FORMAT", value_parser = names())]
    to: String,
    /// File to write
    #[arg(short = 'o', long = "out", value_name = "FILE")]
    out: PathBuf,
    /// Unit of the readings that the file is for, if it does not say it: V, count or SI
    #[arg(long, default_value = "count")]
    raw_unit: RawUnit,
    /// Messages a second that the file's noise is of, if it does not say them
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    #[command(flatten)]
    json: JsonArgs,
    /// Options of the format, as of `mimu export FORMAT`
    #[arg(last = true, value_name = "OPTIONS")]
    options: Vec<String>,
}

fn names() -> PossibleValuesParser {
    let formats = FORMATS.iter().map(|format| format.name);
    PossibleValuesParser::new(formats.chain([OWN]))
}

pub fn run(args: &ConvertArgs) -> Result<()> {
    let inputs: Vec<&Path> = args.files.iter().map(PathBuf::as_path).collect();
    check_outputs(&[Some(&args.out), args.json.file()], &inputs)?;
    check_overwritten(&[Some(&args.out)])?;
    let format = FORMATS.iter().find(|format| format.name == args.to);
    let opened = open_all(&args.files)?;
    let takes_noise = format.is_some_and(|format| format.noise != Noise::No);
    let noise = match &opened {
        Opened::Foreign(other) if takes_noise => other.noise(args.rate_hz)?,
        _ => None,
    };
    let is_noise = matches!(&opened, Opened::Foreign(other) if other.is_noise_only());
    let calibration = match is_noise && noise.is_some() {
        true => None,
        false => Some(opened.of_readings(args.raw_unit)?),
    };
    let Some(format) = format else {
        return own(args, calibration.as_ref());
    };
    let choice = format.chosen(&args.options).map_err(|e| {
        let text = e.render().to_string();
        // The arguments that are missing follow on lines, and the usage after an empty one.
        let lines = text.lines().map(str::trim);
        let said: Vec<&str> = lines.take_while(|line| !line.is_empty()).collect();
        let problem = said.join(" ").replacen("error: ", "", 1);
        let remedy = format!("see mimu export {} --help", args.to);
        Error::new("options after --", problem, remedy)
    })?;
    let place = args.files[0].display().to_string();
    let from = Sources {
        calibration: calibration.as_ref().map(|of| (of, place.as_str())),
        biases: None,
        noise: noise.as_ref(),
    };
    written(&choice, &from, &args.out, &args.json)
}

/// Writes a calibration file of mimu.
fn own(args: &ConvertArgs, calibration: Option<&Calibration>) -> Result<()> {
    let file = args.out.display().to_string();
    let text = calibration.map(Calibration::to_toml).unwrap_or_default();
    let result = json!({"format": "mimu-export/1", "to": OWN, "file": file, "bytes": text.len()});
    let said = format!("It has no uncertainty that its source lacks.\ncalibration: {file}\n");
    print(&args.json, &said, &result, Some(stage(&args.out, text)?))
}
