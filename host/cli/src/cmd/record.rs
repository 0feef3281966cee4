//! `mimu record`: arguments and execution.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::report;
use clap::Args;
use indicatif::ProgressBar;
use mimu::plan::Plan;
use mimu_device::record::{Known, RecordOptions, RecordingState, Steps, UserRequest, record};
use mimu_recording::{Error, Inputs, Result, SampleFormat};

use crate::arguments::{JsonArgs, assumed_gravity, known_gravity, warned};
use crate::cmd::device::{PortArgs, duration, interruption, open};
use crate::output::{check_outputs, print, progress};
use crate::views::answers::lines;

/// Options common to all recordings of a device, whoever moves the unit.
#[derive(Args)]
pub(crate) struct RecordingArgs {
    /// Longest wait for a port that has vanished (a pulled cable); 0: the recording ends at once
    #[arg(long, value_name = "TIME", default_value = "30s", value_parser = patience)]
    pub(crate) reconnect: Duration,
    /// Name of the unit [default: that of the plan, or the number of its microcontroller]
    #[arg(long)]
    device: Option<String>,
    /// Local gravity, m/s² [default: that of the plan; normal gravity at sea level at --latitude; or 9.80665 with a warning]
    #[arg(long, allow_negative_numbers = true)]
    gravity: Option<f64>,
    /// Latitude, degrees
    #[arg(long, allow_negative_numbers = true)]
    latitude: Option<f64>,
    /// Final format of the samples: csv or parquet; during the recording it is CSV, which can be read at any time
    #[arg(long, default_value = "csv")]
    pub(crate) format: SampleFormat,
}

impl RecordingArgs {
    /// Name of the unit.
    pub(crate) fn device(&self, plan: Option<&Plan>) -> Option<String> {
        let of_plan = plan.and_then(|plan| plan.device.clone());
        self.device.clone().or(of_plan)
    }

    /// Latitude, degrees.
    pub(crate) fn latitude_deg(&self, plan: Option<&Plan>) -> Option<f64> {
        self.latitude.or(plan.and_then(|plan| plan.latitude_deg))
    }

    /// Local gravity, m/s²: as given; from the latitude if that is given; otherwise from the plan.
    pub(crate) fn gravity_mps2(&self, plan: Option<&Plan>) -> f64 {
        let of_plan = match self.latitude {
            None => plan.and_then(|plan| plan.gravity_mps2),
            Some(_) => None,
        };
        let known = known_gravity(self.gravity.or(of_plan), self.latitude_deg(plan));
        warned(known.unwrap_or_else(assumed_gravity))
    }
}

#[derive(Args)]
pub struct RecordArgs {
    #[command(flatten)]
    port: PortArgs,
    /// Directory of the new recording
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
    /// Duration by the device's clock (`60s`, `10min`, `4h`) [default: until Ctrl-C]
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    duration: Option<Duration>,
    /// Mark the dwells by hand: each Enter (a line on standard input) begins a dwell or ends the current one
    #[arg(long, conflicts_with_all = ["step_every", "transit"])]
    steps: bool,
    /// Mark the dwells by time: duration of a dwell and of the transit after it, repeated (`10s,5s`)
    #[arg(long, value_name = "DWELL,TRANSIT", value_parser = every)]
    step_every: Option<(Duration, Duration)>,
    /// Plan of the experiment (`mimu design -o`): gives the dwells with their inputs; mark them by hand (--steps) or by time (--transit);
    /// the recording ends with the last dwell
    #[arg(long, value_name = "PLAN", conflicts_with_all = ["step_every", "inputs"])]
    plan: Option<PathBuf>,
    /// With --plan: duration of the transit between two dwells
    #[arg(long, value_name = "TIME", value_parser = duration, requires = "plan")]
    transit: Option<Duration>,
    /// CSV file with the known input of each dwell, as for `mimu import`: step, ref_rate_x_dps.., ref_force_x_mps2.., turn_x_deg..
    ///
    /// One row for each dwell, by its number from 0. If the rows have labels instead of numbers, their order counts.
    #[arg(long, value_name = "FILE")]
    inputs: Option<PathBuf>,
    #[command(flatten)]
    of: RecordingArgs,
    #[command(flatten)]
    json: JsonArgs,
}

fn patience(text: &str) -> std::result::Result<Duration, String> {
    match text {
        "0" => Ok(Duration::ZERO),
        text => duration(text),
    }
}

fn every(text: &str) -> std::result::Result<(Duration, Duration), String> {
    let (dwell, transit) = text.split_once(',').ok_or("write two times, like 10s,5s")?;
    Ok((duration(dwell)?, duration(transit)?))
}

pub fn run(args: &RecordArgs) -> Result<()> {
    let inputs = args.plan.iter().chain(&args.inputs);
    check_outputs(&[args.json.file()], inputs)?;
    let plan = args.plan.as_deref().map(Plan::read).transpose()?;
    let gravity_mps2 = args.of.gravity_mps2(plan.as_ref());
    let (known, table) = match (&plan, &args.plan, &args.inputs) {
        (Some(plan), Some(path), _) => {
            if args.transit.is_some() && plan.is_procedure() {
                let problem = "its turns or rounds take as long as the table needs, so no fixed transit time fits";
                let remedy = "mark the dwells with --steps";
                return Err(Error::new(path.display(), problem, remedy));
            }
            let dwells = plan.dwells(gravity_mps2, &path.display().to_string())?;
            (Some(Known::of_plan(dwells)), plan.is_of_table())
        }
        (_, _, Some(path)) => (Some(Known::of_table(Inputs::read(path)?)), true),
        _ => (None, false),
    };
    let steps = match (args.steps, args.step_every, args.transit, &plan) {
        (true, ..) => match known.as_ref().and_then(Known::planned) {
            Some(dwells) => Steps::marks_for(dwells),
            None => Steps::marks(),
        },
        (_, Some((dwell, transit)), ..) => Steps::Every(dwell, transit),
        (_, _, Some(transit), Some(plan)) => {
            let lengths = known.as_ref().map(Known::lengths).unwrap_or_default();
            Steps::planned(plan.lead_in(), &lengths, transit)
        }
        _ if known.is_some() => {
            let (place, remedy) = match &args.plan {
                Some(_) => (
                    "--plan",
                    "give --steps and press Enter at each dwell, or give the time in between: --transit 5s",
                ),
                None => (
                    "--inputs",
                    "give --steps and press Enter at each dwell, or give --step-every",
                ),
            };
            let problem = "the beginnings and ends of the dwells are not given";
            return Err(Error::new(place, problem, remedy));
        }
        _ => Steps::Detected,
    };
    let options = RecordOptions {
        directory: args.output.clone(),
        duration: args.duration,
        steps,
        reconnect: args.of.reconnect,
        table,
        device: args.of.device(plan.as_ref()),
        gravity_mps2,
        latitude_deg: args.of.latitude_deg(plan.as_ref()),
        format: args.of.format,
    };
    let titles = known.as_ref().map(titles).unwrap_or_default();
    let mut session = open(&args.port)?;
    let stop = interruption()?;
    if args.steps && std::io::stdin().is_terminal() {
        eprintln!("Enter begins a dwell, Enter again ends it");
    }
    // Each line is a mark.
    let marks = args.steps.then(lines).transpose()?;
    let spinner = ProgressBar::new_spinner();
    let look = |state: &RecordingState| {
        spinner.set_message(told(state, args.steps, &titles));
        spinner.tick();
        UserRequest {
            end: stop.load(Ordering::Relaxed),
            marks: marks.as_ref().map_or(0, |m| m.try_iter().count() as u32),
        }
    };
    let bar = progress("writing parquet");
    let summary = record(&mut session, &options, known, look, |share| {
        bar.reach(share)
    })?;
    spinner.finish_and_clear();
    bar.finish();
    print(&args.json, &report::record_text(&summary), &summary, None)?;
    summary.broken_off.map_or(Ok(()), Err)
}

/// Instruction for each dwell, as far as known.
fn titles(known: &Known) -> Vec<String> {
    let all = (0..).map_while(|step| known.title(step));
    all.map(str::to_owned).collect()
}

/// Progress line for a terminal.
fn told(state: &RecordingState, steps: bool, titles: &[String]) -> String {
    if state.waiting {
        return "the port has vanished: waiting for it; Ctrl-C ends the recording".into();
    }
    let title = |dwell: usize| {
        let title = titles.get(dwell).map(|title| format!(" ({title})"));
        title.unwrap_or_default()
    };
    let next = state.dwells as usize;
    let length = state.last_s.unwrap_or_default() - state.first_s.unwrap_or_default();
    let dwell = match (steps, state.step) {
        (false, Some(step)) => format!(", dwell {step}{}", title(step as usize)),
        (false, None) if titles.is_empty() => String::new(),
        (false, None) => format!(", next is dwell {next}{}", title(next)),
        (true, Some(step)) => format!(", dwell {step}{}: Enter ends it", title(step as usize)),
        (true, None) => format!(", {next} dwells: Enter begins one{}", title(next)),
    };
    format!(
        "{length:.1} s, {} samples, {} lost, {:.1} °C{dwell}; Ctrl-C ends the recording",
        state.samples, state.missing, state.temp_c
    )
}
