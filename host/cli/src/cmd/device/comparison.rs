//! `mimu device check` and `mimu device kalman`: compare the device's computation with the PC's.

use std::io::{BufRead as _, IsTerminal as _};
use std::path::PathBuf;
use std::time::Duration;

use crate::report;
use clap::Args;
use mimu::{Calibration, Sensor};
use mimu_device::{DeviceResult, KalmanPlan, SHORTEST, check, kalman};
use mimu_recording::error::{Error, Result};

use super::{OnDevice, duration};
use crate::output::{print, progress};

#[derive(Args)]
pub struct CheckArgs {
    /// Calibration file that was uploaded
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,
    /// How long
    #[arg(long = "for", value_name = "TIME", default_value = "5s", value_parser = duration)]
    duration: Duration,
    #[command(flatten)]
    on: OnDevice,
}

#[derive(Args)]
#[command(group(clap::ArgGroup::new("input").required(true).args(["rate_dps", "force_mps2"])))]
pub struct KalmanArgs {
    /// Rate applied to the gyro, deg/s, body frame: X,Y,Z; repeat the option for successive inputs
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple)]
    rate_dps: Vec<[f32; 3]>,
    /// Specific force applied to the accelerometer, m/s², body frame; at rest it points up
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = triple)]
    force_mps2: Vec<[f32; 3]>,
    /// Duration of each input; on a terminal each begins with Enter
    #[arg(long = "for", value_name = "TIME", default_value = "5s", value_parser = duration)]
    each: Duration,
    /// Variances of single readings of the sensors x, y, z, raw units squared [default: from a second before the first input]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple)]
    noise_variance: Option<[f32; 3]>,
    #[command(flatten)]
    on: OnDevice,
}

fn triple(text: &str) -> std::result::Result<[f32; 3], String> {
    let numbers: Vec<f32> = text
        .split(',')
        .filter_map(|part| part.trim().parse().ok())
        .filter(|number: &f32| number.is_finite())
        .collect();
    match (<[f32; 3]>::try_from(numbers), text.split(',').count()) {
        (Ok(three), 3) => Ok(three),
        _ => Err("write three numbers, X,Y,Z".into()),
    }
}

pub fn run_check(args: &CheckArgs) -> Result<()> {
    let place = args.calibration.display().to_string();
    let calibration = Calibration::read(&args.calibration)?;
    let mut session = args.on.open(Some(&args.calibration))?;
    let bar = progress("comparing");
    let found = check(&mut session, &calibration, &place, args.duration, |share| {
        bar.reach(share)
    })?;
    bar.finish();
    let port = session.port();
    let result = DeviceResult::new("check", port, found);
    print(&args.on.json, &report::check_text(&result), &result, None)?;
    match result.found.holds || !result.found.not_judged_for.is_empty() {
        true => Ok(()),
        false => Err(Error::new(
            port,
            "the device's compensation differs from the PC's by more than rounding",
            "update device and program to the same version, and upload the calibration again",
        )),
    }
}

pub fn run_kalman(args: &KalmanArgs) -> Result<()> {
    let (sensor, inputs) = match args.rate_dps.is_empty() {
        true => (Sensor::Accel, args.force_mps2.clone()),
        false => {
            let si = |dps: &[f32; 3]| dps.map(|d| f64::from(d).to_radians() as f32);
            (Sensor::Gyro, args.rate_dps.iter().map(si).collect())
        }
    };
    if args.each < SHORTEST {
        return Err(Error::new(
            "--for",
            format!("{:?} is too short for the bank to report", args.each),
            format!("give at least {SHORTEST:?}"),
        ));
    }
    let plan = KalmanPlan {
        sensor,
        inputs,
        each: args.each,
        noise: args.noise_variance,
    };
    let mut session = args.on.open(None)?;
    let asks = std::io::stdin().is_terminal();
    let apply = |input: &[f32; 3]| {
        if asks {
            let unit = sensor.pick("rad/s", "m/s²");
            eprint!(
                "apply {}, {}, {} {unit}, then press Enter: ",
                input[0], input[1], input[2]
            );
            // At the end of standard input there is nobody to wait for.
            let _ = std::io::stdin().lock().read_line(&mut String::new());
        }
        Ok(())
    };
    let bar = progress("estimating");
    let run = kalman(&mut session, &plan, apply, |share| bar.reach(share))?;
    bar.finish();
    let result = DeviceResult::new("kalman", session.port(), run);
    print(&args.on.json, &report::kalman_text(&result), &result, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_has_three_numbers() {
        assert_eq!(triple("0, -1,9.8"), Ok([0.0, -1.0, 9.8]));
        for bad in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf", "1,2,3,x"] {
            assert!(triple(bad).is_err(), "{bad}");
        }
    }
}
