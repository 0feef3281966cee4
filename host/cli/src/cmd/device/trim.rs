//! `mimu device trim`.

use std::time::Duration;

use clap::Args;
use jiff::Timestamp;
use mimu_device::{DeviceResult, Pose, SHORTEST_TRIM_S, trim};
use mimu_recording::error::{Error, Result};

use super::{PortArgs, duration, open};
use crate::arguments::JsonArgs;
use crate::output::{check_outputs, print, progress};
use crate::report;

#[derive(Args)]
pub struct TrimArgs {
    /// Body axis that points up while the unit lies level: the accelerometer is trimmed too [default: only the gyro, in any pose]
    #[arg(long, value_name = "±AXIS", requires = "gravity_mps2", allow_hyphen_values = true, value_parser = up)]
    up: Option<[f64; 3]>,
    /// Local gravity, m/s²
    #[arg(long = "gravity", value_name = "M/S²", requires = "up", value_parser = gravity)]
    gravity_mps2: Option<f64>,
    /// Averaging time of the output, before and after
    #[arg(long = "for", value_name = "TIME", default_value = "20s", value_parser = duration)]
    duration: Duration,
    #[command(flatten)]
    port: PortArgs,
    #[command(flatten)]
    json: JsonArgs,
}

/// Parses `+z`, `-x` and similar.
fn up(text: &str) -> std::result::Result<[f64; 3], String> {
    let (sign, axis) = match text.as_bytes() {
        [b'+', axis] | [axis] => (1.0, *axis),
        [b'-', axis] => (-1.0, *axis),
        _ => (0.0, 0),
    };
    match axis {
        b'x' => Ok([sign, 0.0, 0.0]),
        b'y' => Ok([0.0, sign, 0.0]),
        b'z' => Ok([0.0, 0.0, sign]),
        _ => Err("write the axis that points up: +x, -x, +y, -y, +z or -z".into()),
    }
}

fn gravity(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(gravity) if (9.7..=9.9).contains(&gravity) => Ok(gravity),
        _ => Err("on Earth it is 9.7 to 9.9 m/s²".into()),
    }
}

pub fn run_trim(args: &TrimArgs) -> Result<()> {
    check_outputs(&[args.json.file()], &[])?;
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
            .map(|(up, gravity)| up.map(|axis| axis * gravity)),
    };
    let now_s = u64::try_from(Timestamp::now().as_second()).unwrap_or(0);
    let mut session = open(&args.port)?;
    let bar = progress("trimming");
    let done = trim(&mut session, &pose, args.duration, now_s, |share| {
        bar.reach(share)
    });
    bar.finish();
    let result = DeviceResult::new("trim", session.port(), done?);
    print(&args.json, &report::trim_text(&result), &result, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_that_points_up_has_a_sign_or_none() {
        assert_eq!(up("+z"), Ok([0.0, 0.0, 1.0]));
        assert_eq!(up("z"), Ok([0.0, 0.0, 1.0]));
        assert_eq!(up("-x"), Ok([-1.0, 0.0, 0.0]));
        for bad in ["", "+", "w", "+zz", "up", "é"] {
            assert!(up(bad).is_err(), "{bad}");
        }
    }
}
