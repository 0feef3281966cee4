//! `mimu thermal`.

mod plan;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use mimu::calibration::Calibration;
use mimu::signal::stillness::{DwellSearch, Steps};
use mimu_recording::error::Result;
use mimu_thermal::base;
use mimu_thermal::fit::{Options, fit};
use mimu_thermal::result::ThermalResult;
use mimu_thermal::session::Session;

use crate::arguments::{
    JsonArgs, NoiseArgs, StillArgs, StrictArgs, VerboseArgs, WritingArgs, number, range_c,
    with_noise,
};
use crate::hint::OF_A_LOG;
use crate::output::{Results, now};
use crate::reading::{LogArgs, read_samples};
use crate::report::{self, Made, thermal_plot};
use crate::status::Status;

#[derive(Args)]
pub(crate) struct ThermalArgs {
    #[command(subcommand)]
    command: ThermalCommand,
}

#[derive(Subcommand)]
enum ThermalCommand {
    /// Estimate all parameters over temperature, and the lag of the dies behind the thermometer
    Fit(Box<FitArgs>),
    /// Plan a procedure; prints its duration and the expected uncertainty of the curves
    Plan(plan::PlanArgs),
}

/// Arguments of `mimu thermal fit`.
#[derive(Args)]
pub struct FitArgs {
    /// Directories of the recordings of one unit, one for each power-on
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// Recording for judging only: a sweep at another rate, or a soak
    #[arg(long, value_name = "REC")]
    verify: Vec<PathBuf>,
    /// Lag of the dies if it is known; 0: no lag, below 0: the dies lead
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = |t: &str| number(t, -120.0, 600.0))]
    lag: Option<f64>,
    /// Temperatures of the dies that the curves have to cover; otherwise nothing is written
    #[arg(long, value_name = "FROM..TO", allow_hyphen_values = true, value_parser = range_c)]
    range: Option<[f64; 2]>,
    /// Calibration of the unit at one temperature; recordings at rest add the biases over temperature to it. Without it they give a file of biases
    /// for `mimu export px4` and `ardupilot`
    #[arg(long, value_name = "FILE")]
    base: Option<PathBuf>,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    still: StillArgs,
    /// Declare that the unit lay still throughout: mimu does not search for turns, and leaves out no sample because of them
    #[arg(long, conflicts_with_all = ["steps", "factor"])]
    at_rest: bool,
    /// Calibration file to write; of recordings at rest without --base, a file of biases over temperature
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// SVG file to write: all curves with their bands, and the errors during heating and cooling
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// HTML page to write: the same, with all figures
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    #[command(flatten)]
    writing: WritingArgs,
    #[command(flatten)]
    strict: StrictArgs,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
    #[command(flatten, next_help_heading = OF_A_LOG)]
    log: LogArgs,
}

impl FitArgs {
    /// How the dwells are found.
    pub fn search(&self) -> DwellSearch {
        let mut search = self.still.search();
        if self.at_rest {
            search.steps = Steps::AtRest;
        }
        search
    }

    /// What is known, and has to be covered.
    pub fn options(&self) -> Options {
        Options {
            lag_s: self.lag,
            range_c: self.range,
        }
    }
}

/// Description of the file that `-o` writes for recordings at rest without a base.
const BIASES: &str =
    "biases over temperature, no calibration (for mimu export px4 and ardupilot; --base makes one)";

/// What to do about readings that curves over temperature do not describe.
const MISFIT: &str =
    "look for jumps and moves in the plot and leave those parts out, or write it all the same";

pub(crate) fn run(args: &ThermalArgs, command_line: &str) -> Result<Status> {
    let done = |()| Status::Done;
    match &args.command {
        ThermalCommand::Fit(args) => run_fit(args, command_line),
        ThermalCommand::Plan(args) => plan::run(args).map(done),
    }
}

fn run_fit(args: &FitArgs, command_line: &str) -> Result<Status> {
    let outputs = [
        args.output.as_deref(),
        args.plot.as_deref(),
        args.page.as_deref(),
        args.json.file(),
    ];
    let beside = [args.base.as_deref(), args.noise.file.as_deref()];
    let base = args.base.as_deref().map(Calibration::read).transpose()?;
    let noise = args.noise.read()?;
    let session = |directory: &PathBuf, search: DwellSearch| {
        let (prepared, _) = read_samples(directory, &args.log, search, &outputs, &beside)?;
        Session::of(&with_noise(prepared, noise.as_ref())?)
    };
    let all = |list: &[PathBuf]| -> Result<Vec<Session>> {
        list.iter().map(|d| session(d, args.search())).collect()
    };
    let (sessions, verify) = (all(&args.recordings)?, all(&args.verify)?);
    args.writing.check(args.output.as_deref())?;
    let fitted = fit(sessions, &verify, args.options())?;
    let result = ThermalResult::of(&fitted);
    let mut out = Results::new(report::thermal_text(&result, args.verbose.verbose));
    let now = now();
    let place = fitted.sessions[0].place.clone();
    let refusal = args.writing.refusal(&result.judgement, &place, MISFIT);
    let path = args.output.as_ref().filter(|_| refusal.is_none());
    match &base {
        None if fitted.is_biases_only() => {
            out.file(BIASES, path, || Ok(fitted.biases(&now)?.to_toml()))?;
        }
        None => out.file("calibration", path, || {
            Ok(fitted.calibration(&now)?.to_toml())
        })?,
        Some(base) => out.file("calibration", path, || {
            Ok(base::calibration(&fitted, base, &now)?.to_toml())
        })?,
    }
    out.file("plot", args.plot.as_ref(), || {
        Ok(thermal_plot::svg(&result))
    })?;
    out.file("page", args.page.as_ref(), || {
        let made = Made::of(&args.recordings, command_line);
        Ok(report::thermal_page(&result, &made))
    })?;
    out.print(&args.json, &result)?;
    match refusal {
        Some(error) => Err(error),
        None => Ok(args.strict.status(&result.judgement)),
    }
}
