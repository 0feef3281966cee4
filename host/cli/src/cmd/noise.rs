//! `mimu noise`: arguments and execution.

use std::path::{Path, PathBuf};

use clap::Args;
use mimu::in_use::{Against, NoiseInUse, noise_in_use};
use mimu::{Calibration, NoiseFile, Prepared};
use mimu_export::kalibr::{self, Kalibr};
use mimu_export::worst_axis::{NoiseOptions, WalkOptions};
use mimu_export::{Sources, Target, driver};
use mimu_recording::{MANIFEST_FILE, Recording, Result};

use super::trajectory::TrajectoryArgs;
use crate::arguments::{JsonArgs, StillArgs, StrictArgs};
use crate::hint::OF_A_LOG;
use crate::opening;
use crate::output::{Results, check_outputs, progress};
use crate::overwriting::check_overwritten;
use crate::reading::{LogArgs, open};
use crate::report;
use crate::status::Status;

/// Arguments of `mimu noise`.
#[derive(Args)]
pub struct NoiseInUseArgs {
    /// Recording in motion, with rests before and after each motion, or with a trajectory; or a log that `mimu import` reads
    recording: PathBuf,
    /// Calibration of the unit, not made from this recording; readings in rad/s and m/s² need none
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Noise file of the unit at rest (`mimu allan -o`)
    #[arg(long, value_name = "FILE")]
    noise: PathBuf,
    #[command(flatten)]
    trajectory: TrajectoryArgs,
    /// File to write: FILE.yaml for Kalibr and what reads its files; FILE.toml is a noise file, for `mimu export`
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    strict: StrictArgs,
    #[command(flatten)]
    json: JsonArgs,
    #[command(flatten, next_help_heading = OF_A_LOG)]
    log: LogArgs,
}

pub(crate) fn run(args: &NoiseInUseArgs) -> Result<Status> {
    let calibration = args.calibration.as_deref().map(opening::calibration);
    let calibration = calibration.transpose()?;
    let noise = NoiseFile::read(&args.noise)?;
    let known = calibration.as_ref().and_then(|c| c.recording.gravity_mps2);
    let recording = open(&args.recording, &args.log.or_gravity(known))?;
    let calibration = match calibration {
        Some(given) => given,
        None => Calibration::of_si(&recording.manifest)?,
    };
    let manifest = recording.directory.join(MANIFEST_FILE);
    let mut inputs: Vec<&Path> = vec![&manifest, &recording.samples, &args.recording, &args.noise];
    inputs.extend(args.calibration.as_deref());
    inputs.extend(args.trajectory.trajectory.iter().map(PathBuf::as_path));
    check_outputs(&[args.output.as_deref(), args.json.file()], &inputs)?;
    check_overwritten(&[args.output.as_deref()])?;
    let bar = progress("dead reckoning");
    let result = args.found(&recording, &calibration, &noise, &|share| bar.reach(share));
    bar.finish();
    let result = result?;
    let mut out = Results::new(report::noise_in_use_text(&result));
    let is_toml = |path: &PathBuf| path.extension().is_some_and(|e| e == "toml");
    out.file("noise", args.output.as_ref(), || {
        match args.output.as_ref().is_some_and(is_toml) {
            true => Ok(result.noise_file.to_toml().into_bytes()),
            false => kalibr_file(&result.noise_file),
        }
    })?;
    out.print(&args.json, &result)?;
    Ok(args.strict.status(&result.judgement))
}

impl NoiseInUseArgs {
    /// The noise that the recording shows.
    ///
    /// # Errors
    /// The recording or the trajectory is refused.
    pub fn found(
        &self,
        recording: &Recording,
        calibration: &Calibration,
        noise: &NoiseFile,
        reach: &dyn Fn(f64),
    ) -> Result<NoiseInUse> {
        match self.trajectory.read()? {
            Some(trajectory) => {
                let against = Against::Trajectory(&trajectory);
                noise_in_use(recording, calibration, noise, against, reach)
            }
            None => {
                let prepared = Prepared::read(recording, self.still.search(), |s| reach(0.3 * s))?;
                let against = Against::Rests(&prepared);
                noise_in_use(recording, calibration, noise, against, |s| {
                    reach(0.3 + 0.7 * s)
                })
            }
        }
    }
}

/// Kalibr's file, as `mimu export kalibr` writes it.
fn kalibr_file(noise: &NoiseFile) -> Result<Vec<u8>> {
    let options = kalibr::Options {
        rostopic: "/imu0".into(),
        result: false,
        noise: NoiseOptions {
            update_rate: None,
            walks: WalkOptions::default(),
        },
        driver: driver::Options::default(),
    };
    let from = Sources {
        calibration: None,
        biases: None,
        noise: Some(noise),
    };
    Ok(Kalibr::export(&from, &options)?.content)
}
