//! `mimu device`: arguments and execution.

mod comparison;
mod transfer;
mod trim;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::report;
use clap::{Args, Subcommand};
use mimu_core::wire::Request;
use mimu_device::{
    Answer, Counted, DeviceResult, Session, Stream, Verdict, look, self_test, stream,
};
use mimu_recording::{Error, RAW_COLUMNS, Result};
use mimu_station::side::direction;
use nalgebra::Vector3;
use signal_hook::consts::TERM_SIGNALS;

use crate::arguments::{JsonArgs, choice};
use crate::output::{check_outputs, print};

#[derive(Args)]
pub struct DeviceArgs {
    #[command(subcommand)]
    command: DeviceCommand,
}

#[derive(Subcommand)]
enum DeviceCommand {
    /// Show unit number, last reset cause, abilities and stored calibration
    Info(OnDevice),
    /// Print the samples as they come, as CSV
    Stream(StreamArgs),
    /// Store a calibration on the device
    Upload(transfer::UploadArgs),
    /// Fetch the stored calibration
    Download(transfer::DownloadArgs),
    /// Correct the offsets of the stored calibration at today's temperature; the unit has to lie still
    Trim(trim::TrimArgs),
    /// Deflect the sensors electrically and measure the deflection; the unit has to stand still
    SelfTest(OnDevice),
    /// Show the counters: lost samples, garbled frames, flash errors
    Counters(CountersArgs),
    /// Compare its compensated stream with the PC's compensation of its raw stream
    Check(comparison::CheckArgs),
    /// Run its Kalman bank with known inputs and compare it with the PC's on the same samples
    Kalman(comparison::KalmanArgs),
}

#[derive(Args)]
pub struct PortArgs {
    /// Serial port [default: the only one at which a device greets]
    #[arg(id = "port", long = "port", value_name = "PATH")]
    pub path: Option<String>,
}

/// The device, and where the result goes.
#[derive(Args)]
struct OnDevice {
    #[command(flatten)]
    port: PortArgs,
    #[command(flatten)]
    json: JsonArgs,
}

impl OnDevice {
    /// Opens the device, after checking that the result can be written and is not the file `input`.
    fn open(&self, input: Option<&PathBuf>) -> Result<Session> {
        check_outputs(&[self.json.file()], input)?;
        open(&self.port)
    }
}

#[derive(Args)]
struct StreamArgs {
    /// Samples to print
    #[arg(default_value = "raw", value_parser = choice(&[
        ("raw", "Readings, V at the sensors", Stream::Raw),
        ("compensated", "Readings compensated on the device, rad/s and m/s²", Stream::Compensated),
    ]))]
    which: Stream,
    /// Duration by the device's clock (`10s`, `500ms`, `2min`) [default: until Ctrl-C]
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    duration: Option<Duration>,
    #[command(flatten)]
    on: OnDevice,
}

#[derive(Args)]
struct CountersArgs {
    /// Reset the counters afterwards
    #[arg(long)]
    reset: bool,
    #[command(flatten)]
    on: OnDevice,
}

/// Direction of the axis that points up, in the body frame.
pub fn side(text: &str) -> std::result::Result<Vector3<f64>, String> {
    direction(text).ok_or_else(|| "write the axis that points up: +x, -x, +y, -y, +z or -z".into())
}

/// `500ms`, `10s`, `2min`, `1h`; a number alone is in seconds.
pub fn duration(text: &str) -> std::result::Result<Duration, String> {
    let unit = text.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    let factor = match unit {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    let number: f64 = text[..text.len() - unit.len()].parse().unwrap_or(f64::NAN);
    match number * factor {
        // At most a year; more is a mistake.
        seconds if (1e-3..=3.2e7).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("write a time like 500ms, 10s, 2min or 1h".into()),
    }
}

/// Set by Ctrl-C or a request to terminate. The second one ends the program at once.
pub fn interruption() -> Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in TERM_SIGNALS {
        signal_hook::flag::register_conditional_default(*signal, flag.clone())
            .and_then(|_| signal_hook::flag::register(*signal, flag.clone()))
            .map_err(|error| Error::new("Ctrl-C", error, "run it with --for"))?;
    }
    Ok(flag)
}

/// Opens a device, and prints the warnings of its greeting.
pub fn open(port: &PortArgs) -> Result<Session> {
    let session = Session::open(port.path.as_deref())?;
    for warning in &session.who().warnings {
        eprintln!("warning: {warning}");
    }
    Ok(session)
}

pub fn run(args: &DeviceArgs) -> Result<()> {
    match &args.command {
        DeviceCommand::Info(args) => info(args),
        DeviceCommand::Stream(args) => run_stream(args),
        DeviceCommand::Upload(args) => transfer::run_upload(args),
        DeviceCommand::Download(args) => transfer::run_download(args),
        DeviceCommand::Trim(args) => trim::run_trim(args),
        DeviceCommand::SelfTest(args) => run_self_test(args),
        DeviceCommand::Counters(args) => counters(args),
        DeviceCommand::Check(args) => comparison::run_check(args),
        DeviceCommand::Kalman(args) => comparison::run_kalman(args),
    }
}

/// Length of the samples that `info` reads.
const FLAGS_SHOWN: Duration = Duration::from_millis(200);

fn info(args: &OnDevice) -> Result<()> {
    check_outputs(&[args.json.file()], None::<&Path>)?;
    // The result contains the warning about versions.
    let mut session = Session::open(args.port.path.as_deref())?;
    let mut who = session.who().clone();
    // What the samples are flagged with is in no greeting: a lost front end, a missing reference.
    let flagged = look(&mut session, FLAGS_SHOWN);
    who.warnings
        .extend(flagged.map_or(Vec::new(), |found| found.flagged.warnings()));
    let result = DeviceResult::new("info", session.port(), &who);
    print(&args.json, &report::info_text(&result), &result, None)
}

fn run_stream(args: &StreamArgs) -> Result<()> {
    let mut session = args.on.open(None)?;
    let stop = interruption()?;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    // If JSON goes to standard output, it contains only the summary and no samples.
    let rows = !args.on.json.is_standard_output();
    let mut closed = false;
    if rows {
        closed |= writeln!(out, "n,t_s,temp_c,flags,{}", RAW_COLUMNS.join(",")).is_err();
    }
    let ended = || stop.load(Ordering::Relaxed);
    let mut last = 0;
    let found = stream(
        &mut session,
        args.which,
        args.duration,
        ended,
        |head, number, sample| {
            if rows && !closed {
                let t_s = head.time_s(number);
                let (g, a) = (&sample.gyro, &sample.accel);
                let row = writeln!(
                    out,
                    "{number},{t_s},{},{},{},{},{},{},{},{}",
                    head.temp_c, head.flags, g.x, g.y, g.z, a.x, a.y, a.z
                );
                // Flushed after every batch, so that the reader is up to date.
                let new = head.first != last;
                last = head.first;
                closed = row
                    .and_then(|()| if new { out.flush() } else { Ok(()) })
                    .is_err();
                // `mimu device stream | head` is not an error.
                if closed {
                    stop.store(true, Ordering::Relaxed);
                }
            }
            Ok(())
        },
    )?;
    let _ = out.flush();
    drop(out);
    let result = DeviceResult::new("stream", session.port(), found);
    if rows && !closed {
        eprint!("{}", report::stream_text(&result));
    }
    print(&args.on.json, "", &result, None)
}

fn run_self_test(args: &OnDevice) -> Result<()> {
    let mut session = args.open(None)?;
    let found = self_test(&mut session)?;
    let port = session.port();
    let result = DeviceResult::new("self-test", port, found);
    print(&args.json, &report::self_test_text(&result), &result, None)?;
    let failed = result.found.named(Verdict::Failed).join("; ");
    match &result.found.moved {
        _ if failed.is_empty() => Ok(()),
        Some(moved) => Err(Error::new(
            port,
            format!("the self-test failed ({failed}); the unit moved during it: {moved}"),
            "keep the unit still and test again",
        )),
        None => Err(Error::new(
            port,
            format!("the self-test failed: {failed}"),
            "check the wiring of these sensors and of the self-test pins",
        )),
    }
}

fn counters(args: &CountersArgs) -> Result<()> {
    let mut session = args.on.open(None)?;
    let purpose = "for its counters";
    let patience = Duration::from_secs(2);
    let counters = match session.call(Request::Counters, purpose, patience)? {
        Answer::Counters(counters) => counters,
        _ => return Err(session.unexpected(purpose)),
    };
    if args.reset {
        session.done(Request::ResetCounters, "to reset its counters")?;
    }
    let counted = Counted {
        counters,
        reset: args.reset,
    };
    let result = DeviceResult::new("counters", session.port(), counted);
    print(
        &args.on.json,
        &report::counters_text(&result),
        &result,
        None,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_units() {
        assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("2min"), Ok(Duration::from_secs(120)));
        assert_eq!(duration("1.5"), Ok(Duration::from_millis(1500)));
        for bad in ["", "s", "-1s", "1 s", "1d", "1e400s", "0s", "nan", "é"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
    }
}
