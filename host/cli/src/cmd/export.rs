//! `mimu export`: arguments and what follows from them.

use std::path::PathBuf;

use crate::export::{KalibrOptions, kalibr};
use clap::Args;
use mimu::noise_file::NoiseFile;
use mimu_recording::error::Result;
use mimu_recording::result_file::stage;
use serde::Serialize;

use crate::arguments::JsonArgs;
use crate::cmd::design::number;
use crate::output::{check_outputs, print};

#[derive(Args)]
pub struct ExportArgs {
    /// Kalibr's imu.yaml to write
    #[arg(long, value_name = "FILE")]
    kalibr: PathBuf,
    /// Noise file, by `mimu allan -o`
    #[arg(long, value_name = "FILE")]
    noise: PathBuf,
    /// Topic of the messages
    #[arg(long, value_name = "TOPIC", default_value = "/imu0")]
    rostopic: String,
    /// Messages a second; without it the rate of the recording
    #[arg(long, value_name = "HZ", value_parser = |t: &str| number(t, 1e-12, 1e6))]
    update_rate: Option<f64>,
    /// Random walk to state where the record shows none on some axis, rad/s²/√Hz
    #[arg(long, value_name = "SI", value_parser = |t: &str| number(t, 1e-12, 1e6))]
    gyro_walk: Option<f64>,
    /// The same for the accelerometer, m/s³/√Hz
    #[arg(long, value_name = "SI", value_parser = |t: &str| number(t, 1e-12, 1e6))]
    accel_walk: Option<f64>,
    #[command(flatten)]
    json: JsonArgs,
}

/// What was written, and where.
#[derive(Serialize)]
struct ExportResult {
    format: &'static str,
    kalibr: String,
    yaml: String,
}

pub fn run(args: &ExportArgs) -> Result<()> {
    check_outputs(&[Some(&args.kalibr), args.json.file()], &[&args.noise])?;
    let options = KalibrOptions {
        rostopic: args.rostopic.clone(),
        update_rate_hz: args.update_rate,
        walk_fallback: [args.gyro_walk, args.accel_walk],
    };
    let noise = NoiseFile::read(&args.noise)?;
    let yaml = kalibr(&noise, &options)?;
    let text = format!("{yaml}\nkalibr: {}\n", args.kalibr.display());
    let result = ExportResult {
        format: "mimu-export/1",
        kalibr: args.kalibr.display().to_string(),
        yaml: yaml.clone(),
    };
    print(&args.json, &text, &result, Some(stage(&args.kalibr, yaml)?))
}
