//! `mimu device trim`.

use std::time::Duration;

use clap::Args;
use jiff::Timestamp;
use mimu_device::{DeviceResult, Pose, SHORTEST_TRIM_S, trim};
use mimu_recording::error::{Error, Result};
use nalgebra::Vector3;

use super::{OnDevice, duration, side};
use crate::arguments::number;
use crate::output::{print, progress};
use crate::report;

#[derive(Args)]
pub struct TrimArgs {
    /// Body axis that points up while the unit lies level: the accelerometer is trimmed too [default: only the gyro, in any pose]
    #[arg(long, value_name = "±AXIS", requires = "gravity_mps2", allow_hyphen_values = true, value_parser = side)]
    up: Option<Vector3<f64>>,
    /// Local gravity, m/s²
    #[arg(long = "gravity", value_name = "M/S²", requires = "up", value_parser = |t: &str| number(t, 9.7, 9.9))]
    gravity_mps2: Option<f64>,
    /// Averaging time of the output, before and after
    #[arg(long = "for", value_name = "TIME", default_value = "20s", value_parser = duration)]
    duration: Duration,
    #[command(flatten)]
    on: OnDevice,
}

pub fn run_trim(args: &TrimArgs) -> Result<()> {
    if args.duration.as_secs_f64() < SHORTEST_TRIM_S {
        return Err(Error::new(
            "--for",
            format!(
                "{:.1} s is too short to know the offsets from the noise",
                args.duration.as_secs_f64()
            ),
            format!("average for {SHORTEST_TRIM_S} s or longer"),
        ));
    }
    let pose = Pose {
        force_mps2: args
            .up
            .zip(args.gravity_mps2)
            .map(|(up, gravity)| (up * gravity).into()),
    };
    let now_s = u64::try_from(Timestamp::now().as_second()).unwrap_or(0);
    let mut session = args.on.open(None)?;
    let bar = progress("trimming");
    let done = trim(&mut session, &pose, args.duration, now_s, |share| {
        bar.reach(share)
    });
    bar.finish();
    let result = DeviceResult::new("trim", session.port(), done?);
    print(&args.on.json, &report::trim_text(&result), &result, None)
}
