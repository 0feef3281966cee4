//! `mimu thermal`.

mod plan;
#[cfg(not(target_family = "wasm"))]
mod record;

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use mimu::calibration::Calibration;
use mimu::signal::stillness::{DwellSearch, Steps};
use mimu_recording::error::Result;
use mimu_thermal::base;
use mimu_thermal::classic::Classic;
use mimu_thermal::compare::compare;
use mimu_thermal::fit::{Estimator, Options, fit};
use mimu_thermal::result::ThermalResult;
use mimu_thermal::session::Session;

use crate::arguments::{
    JsonArgs, NoiseArgs, StillArgs, StrictArgs, VerboseArgs, WritingArgs, number, range_c,
    with_noise,
};
use crate::hint::OF_A_LOG;
use crate::output::{Results, check_outputs, now, print};
use crate::reading::{LogArgs, read};
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
    /// Compare two calibrations over temperature, curve by curve
    Compare(CompareArgs),
    /// Plan a procedure; prints its duration and the expected uncertainty of the curves
    Plan(plan::PlanArgs),
    #[cfg(not(target_family = "wasm"))]
    /// Carry out a plan: set the chamber, move the table, and record the device
    Record(record::RecordArgs),
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
    /// Estimator; all but the first are for comparison
    #[arg(long, value_enum, default_value = "joint")]
    estimator: EstimatorArg,
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

    /// How the curves are estimated.
    pub fn options(&self) -> Options {
        Options {
            estimator: self.estimator.estimator(),
            lag_s: self.lag,
            range_c: self.range,
        }
    }
}

#[derive(Args)]
struct CompareArgs {
    /// Calibration file
    first: PathBuf,
    /// The second calibration file; differences are second minus first
    second: PathBuf,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum EstimatorArg {
    /// Smooth curves of all parameters, the lag and the noise, estimated together
    Joint,
    /// The same with one cubic for each parameter
    Cubic,
    /// An affine fit in each bin of 10 K, without a lag
    Nodes,
    /// Ramp of niu: a fit of each cycle of the scheme, and cubics through these
    RampNiu,
    /// Soak: a fit of all 24 parameters at each plateau
    Soak,
    /// Soak by fang (33), (34) as printed: one scalar a pose
    SoakFang,
    /// Soak by fang (31), (32): scale factors and biases at each plateau, misalignments of the plateau nearest 25 °C
    SoakConstantM,
}

impl EstimatorArg {
    fn estimator(self) -> Estimator {
        match self {
            Self::Joint => Estimator::Joint,
            Self::Cubic => Estimator::Cubic,
            Self::Nodes => Estimator::Classic(Classic::Nodes),
            Self::RampNiu => Estimator::Classic(Classic::RampNiu),
            Self::Soak => Estimator::Classic(Classic::Soak),
            Self::SoakFang => Estimator::Classic(Classic::SoakAsPrinted),
            Self::SoakConstantM => Estimator::Classic(Classic::SoakConstantM),
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
        ThermalCommand::Compare(args) => run_compare(args).map(done),
        ThermalCommand::Plan(args) => plan::run(args).map(done),
        #[cfg(not(target_family = "wasm"))]
        ThermalCommand::Record(args) => record::run(args).map(done),
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
        let prepared = read(directory, &args.log, search, &outputs, &beside)?;
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

fn run_compare(args: &CompareArgs) -> Result<()> {
    let inputs = [args.first.as_path(), args.second.as_path()];
    check_outputs(&[args.json.file()], &inputs)?;
    let [first, second] = [&args.first, &args.second].map(|path| Calibration::read(path));
    let result = compare(&first?, &second?)?;
    print(
        &args.json,
        &report::thermal_comparison_text(&result, args.verbose.verbose),
        &result,
        None,
    )
}
