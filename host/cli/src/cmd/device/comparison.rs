//! `mimu device check`: compares the device's computation with the PC's.

use std::path::PathBuf;
use std::time::Duration;

use crate::report;
use clap::Args;
use mimu::calibration::Calibration;
use mimu_device::{DeviceResult, check};
use mimu_recording::error::{Error, Result};

use super::{PortArgs, duration, open};
use crate::arguments::JsonArgs;
use crate::output::{check_outputs, print, progress};

#[derive(Args)]
pub struct CheckArgs {
    /// Calibration file that was uploaded
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,
    /// How long
    #[arg(long = "for", value_name = "TIME", default_value = "5s", value_parser = duration)]
    duration: Duration,
    #[command(flatten)]
    port: PortArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub fn run_check(args: &CheckArgs) -> Result<()> {
    check_outputs(&[args.json.file()], &[&args.calibration])?;
    let place = args.calibration.display().to_string();
    let calibration = Calibration::read(&args.calibration)?;
    let mut session = open(&args.port)?;
    let bar = progress("comparing");
    let found = check(&mut session, &calibration, &place, args.duration, |share| {
        bar.reach(share)
    })?;
    bar.finish();
    let port = session.port();
    let result = DeviceResult::new("check", port, found);
    print(&args.json, &report::check_text(&result), &result, None)?;
    match result.found.holds || !result.found.not_judged_for.is_empty() {
        true => Ok(()),
        false => Err(Error::new(
            port,
            "the device's compensation differs from the PC's by more than rounding",
            "update device and program to the same version, and upload the calibration again",
        )),
    }
}
