//! `mimu record`: arguments and what follows from them.

use std::io::{BufRead as _, IsTerminal as _};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use crate::report;
use clap::Args;
use indicatif::ProgressBar;
use mimu_device::Session;
use mimu_device::record::{RecordOptions, Standing, Steps, Wish, record};
use mimu_recording::SampleFormat;
use mimu_recording::error::{Error, Result};

use crate::arguments::JsonArgs;
use crate::cmd::device::{PortArgs, duration, interruption};
use crate::output::{check_outputs, print, progress};
use mimu::quantity::normal_gravity;

#[derive(Args)]
pub struct RecordArgs {
    #[command(flatten)]
    port: PortArgs,
    /// Directory of the new recording
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
    /// How long (`60s`, `10min`, `4h`), by the device's time; without it until Ctrl-C
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    duration: Option<Duration>,
    /// Mark the dwells: each line on standard input (Enter) begins one, or ends the one that runs
    #[arg(long, conflicts_with = "step_every")]
    steps: bool,
    /// Mark the dwells by time: so long a dwell, so long in transit, again and again (`10s,5s`)
    #[arg(long, value_name = "DWELL,TRANSIT", value_parser = every)]
    step_every: Option<(Duration, Duration)>,
    /// Name of the unit; without it, the number of its microcontroller
    #[arg(long)]
    device: Option<String>,
    /// Local gravity, m/s²; without it, normal gravity at sea level of --latitude, or 9.80665 and a warning
    #[arg(long)]
    gravity: Option<f64>,
    /// Latitude, degrees
    #[arg(long, allow_negative_numbers = true)]
    latitude: Option<f64>,
    /// Format of the samples in the end: csv or parquet. While it records it is CSV, which can be read at any time
    #[arg(long, default_value = "csv")]
    format: SampleFormat,
    #[command(flatten)]
    json: JsonArgs,
}

fn every(text: &str) -> std::result::Result<(Duration, Duration), String> {
    let (dwell, transit) = text.split_once(',').ok_or("write two times, like 10s,5s")?;
    Ok((duration(dwell)?, duration(transit)?))
}

pub fn run(args: &RecordArgs) -> Result<()> {
    check_outputs(&[args.json.file()], &[])?;
    let gravity_mps2 = match (args.gravity, args.latitude) {
        (Some(gravity), _) => gravity,
        (None, Some(latitude)) => normal_gravity(latitude),
        (None, None) => {
            eprintln!(
                "warning: gravity is taken to be 9.80665 m/s²; it ranges from 9.78 to 9.83, and every scale factor of the accelerometer with it: give --gravity or --latitude"
            );
            9.80665
        }
    };
    let options = RecordOptions {
        directory: args.output.clone(),
        duration: args.duration,
        steps: match (args.steps, args.step_every) {
            (true, _) => Steps::marks(),
            (_, Some((dwell, transit))) => Steps::Every(dwell, transit),
            _ => Steps::Detected,
        },
        device: args.device.clone(),
        gravity_mps2,
        latitude_deg: args.latitude,
        format: args.format,
    };
    let mut session = Session::open(args.port.path.as_deref())?;
    for warning in &session.who().warnings {
        eprintln!("warning: {warning}");
    }
    let stop = interruption()?;
    let marks = args.steps.then(keyboard).transpose()?;
    let spinner = ProgressBar::new_spinner();
    let look = |standing: &Standing| {
        spinner.set_message(told(standing, args.steps));
        spinner.tick();
        Wish {
            end: stop.load(Ordering::Relaxed),
            marks: marks.as_ref().map_or(0, |m| m.swap(0, Ordering::Relaxed)),
        }
    };
    let bar = progress("writing parquet");
    let summary = record(&mut session, &options, look, |share| {
        bar.set_position((share * 1000.0) as u64)
    })?;
    spinner.finish_and_clear();
    bar.finish_and_clear();
    print(&args.json, &report::record_text(&summary), &summary, None)?;
    summary.broken_off.map_or(Ok(()), Err)
}

/// The line that a terminal shows.
fn told(standing: &Standing, steps: bool) -> String {
    let length = standing.last_s.unwrap_or_default() - standing.first_s.unwrap_or_default();
    let dwell = match (steps, standing.step) {
        (false, _) => String::new(),
        (true, Some(step)) => format!(", dwell {step}: Enter ends it"),
        (true, None) => format!(", {} dwells: Enter begins one", standing.dwells),
    };
    format!(
        "{length:.1} s, {} samples, {} lost, {:.1} °C{dwell}; Ctrl-C ends the recording",
        standing.samples, standing.missing, standing.temp_c
    )
}

/// Counts lines on standard input, each a mark.
fn keyboard() -> Result<Arc<AtomicU32>> {
    let marks = Arc::new(AtomicU32::new(0));
    let counted = marks.clone();
    if std::io::stdin().is_terminal() {
        eprintln!("Enter begins a dwell, Enter again ends it");
    }
    let read = move || {
        for _ in std::io::stdin()
            .lock()
            .lines()
            .map_while(std::io::Result::ok)
        {
            counted.fetch_add(1, Ordering::Relaxed);
        }
    };
    std::thread::Builder::new()
        .name("keyboard".into())
        .spawn(read)
        .map_err(|error| Error::new("keyboard", error, "record with --step-every"))?;
    Ok(marks)
}
