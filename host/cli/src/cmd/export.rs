//! `mimu export`: arguments and what follows from them.

use std::path::{Path, PathBuf};

use crate::export::autopilot::{Autopilot, AutopilotOptions, Layout, autopilot, said};
use crate::export::{KalibrOptions, kalibr};
use clap::{ArgGroup, Args};
use mimu::calibration::Calibration;
use mimu::calibration::bias_cubic::KnownConversion;
use mimu::noise::noise_file::NoiseFile;
use mimu_device::Image;
use mimu_recording::error::Result;
use mimu_recording::result_file::stage;
use serde::Serialize;

use crate::arguments::JsonArgs;
use crate::cmd::design::number;
use crate::output::{check_outputs, print};

#[derive(Args)]
#[command(group(ArgGroup::new("to").required(true).args(["kalibr", "px4", "ardupilot", "core"])))]
pub struct ExportArgs {
    /// Kalibr's imu.yaml to write, from --noise
    #[arg(
        long,
        value_name = "FILE",
        requires = "noise",
        conflicts_with = "calibration"
    )]
    kalibr: Option<PathBuf>,
    /// PX4's parameters to write, TC_*: the biases over temperature of --calibration
    #[arg(
        long,
        value_name = "FILE",
        requires = "calibration",
        conflicts_with = "noise"
    )]
    px4: Option<PathBuf>,
    /// ArduPilot's parameters to write, INS_TCAL*: likewise
    #[arg(
        long,
        value_name = "FILE",
        requires = "calibration",
        conflicts_with = "noise"
    )]
    ardupilot: Option<PathBuf>,
    /// Bytes to write for programs with mimu-core: those of --calibration that a device stores
    #[arg(
        long,
        value_name = "FILE",
        requires = "calibration",
        conflicts_with = "noise"
    )]
    core: Option<PathBuf>,
    /// Noise file, by `mimu allan -o`
    #[arg(long, value_name = "FILE")]
    noise: Option<PathBuf>,
    /// Calibration; for PX4 and ArduPilot one over temperature, by `mimu thermal fit -o`
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Topic of Kalibr's messages
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
    parameters: ParameterArgs,
    #[command(flatten)]
    json: JsonArgs,
}

/// What PX4 and ArduPilot have.
#[derive(Args)]
#[command(next_help_heading = "Parameters of PX4 and ArduPilot")]
struct ParameterArgs {
    /// Number of the inertial unit in the autopilot, from 1
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3))]
    imu: u8,
    /// File for QGroundControl, five columns with tabs; without it NAME,VALUE for MAVProxy and Mission Planner
    #[arg(long)]
    qgc: bool,
    /// Device id of the gyro in PX4 (CAL_GYROn_ID)
    #[arg(long, value_name = "ID", requires = "px4")]
    gyro_id: Option<u32>,
    /// Device id of the accelerometer in PX4 (CAL_ACCn_ID)
    #[arg(long, value_name = "ID", requires = "px4")]
    accel_id: Option<u32>,
    /// rad/s per raw unit by which the driver converts; without it as the calibration does, and 1 for readings in SI
    #[arg(long, value_name = "SI", value_parser = |t: &str| number(t, 1e-12, 1e6))]
    gyro_si_per_raw: Option<f64>,
    /// m/s² per raw unit by which the driver converts; likewise
    #[arg(long, value_name = "SI", value_parser = |t: &str| number(t, 1e-12, 1e6))]
    accel_si_per_raw: Option<f64>,
    /// Raw reading that the driver takes for no rate; without it 0
    #[arg(long, value_name = "RAW", allow_negative_numbers = true, value_parser = |t: &str| number(t, -1e12, 1e12))]
    gyro_zero: Option<f64>,
    /// Raw reading that the driver takes for no force; without it 0
    #[arg(long, value_name = "RAW", allow_negative_numbers = true, value_parser = |t: &str| number(t, -1e12, 1e12))]
    accel_zero: Option<f64>,
}

impl ParameterArgs {
    fn options(&self, autopilot: Autopilot) -> AutopilotOptions {
        let known = |si_per_raw, zero_raw| KnownConversion {
            si_per_raw,
            zero_raw,
        };
        AutopilotOptions {
            autopilot,
            layout: match self.qgc {
                true => Layout::QGroundControl,
                false => Layout::Pairs,
            },
            imu: self.imu,
            device_ids: [self.gyro_id, self.accel_id],
            conversions: [
                known(self.gyro_si_per_raw, self.gyro_zero),
                known(self.accel_si_per_raw, self.accel_zero),
            ],
        }
    }
}

/// What was written, and where.
#[derive(Serialize)]
struct ExportResult {
    format: &'static str,
    kalibr: String,
    yaml: String,
}

pub fn run(args: &ExportArgs) -> Result<()> {
    match (&args.kalibr, &args.px4, &args.ardupilot, &args.core) {
        (Some(path), ..) => noise(args, path),
        (_, Some(path), ..) => parameters(args, Autopilot::Px4, path),
        (_, _, Some(path), _) => parameters(args, Autopilot::ArduPilot, path),
        (_, _, _, Some(path)) => stored(args, path),
        // One of them is required.
        _ => Ok(()),
    }
}

/// What was written for mimu-core.
#[derive(Serialize)]
struct StoredResult {
    format: &'static str,
    core: String,
    bytes: usize,
    hash: String,
    effects: Vec<String>,
    warnings: Vec<String>,
}

fn stored(args: &ExportArgs, path: &Path) -> Result<()> {
    let from = args.calibration.as_deref().unwrap_or(Path::new(""));
    check_outputs(&[Some(path), args.json.file()], &[from])?;
    let image = Image::new(&Calibration::read(from)?, &from.display().to_string())?;
    let result = StoredResult {
        format: "mimu-export/1",
        core: path.display().to_string(),
        bytes: image.bytes.len(),
        hash: image.hash.to_string(),
        effects: image.effects,
        warnings: image.warnings,
    };
    let mut text: String = result
        .warnings
        .iter()
        .map(|w| format!("warning: {w}\n"))
        .collect();
    text += &format!("{} bytes for mimu-core: {}\n", result.bytes, result.core);
    print(&args.json, &text, &result, Some(stage(path, image.bytes)?))
}

fn noise(args: &ExportArgs, path: &Path) -> Result<()> {
    let from = args.noise.as_deref().unwrap_or(Path::new(""));
    check_outputs(&[Some(path), args.json.file()], &[from])?;
    let options = KalibrOptions {
        rostopic: args.rostopic.clone(),
        update_rate_hz: args.update_rate,
        walk_fallback: [args.gyro_walk, args.accel_walk],
    };
    let noise = NoiseFile::read(from)?;
    let yaml = kalibr(&noise, &options)?;
    let text = format!("{yaml}\nkalibr: {}\n", path.display());
    let result = ExportResult {
        format: "mimu-export/1",
        kalibr: path.display().to_string(),
        yaml: yaml.clone(),
    };
    print(&args.json, &text, &result, Some(stage(path, yaml)?))
}

fn parameters(args: &ExportArgs, program: Autopilot, path: &Path) -> Result<()> {
    let from = args.calibration.as_deref().unwrap_or(Path::new(""));
    check_outputs(&[Some(path), args.json.file()], &[from])?;
    let calibration = Calibration::read(from)?;
    let options = args.parameters.options(program);
    let (export, file) = autopilot(&calibration, &options, path.display().to_string())?;
    let text = format!(
        "{}\n{}: {}\n",
        said(&export).join("\n"),
        export.program,
        export.file
    );
    print(&args.json, &text, &export, Some(stage(path, file)?))
}
