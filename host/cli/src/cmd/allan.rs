//! `mimu allan`: arguments and execution.

use std::path::{Path, PathBuf};

use crate::opening;
use crate::report;
use crate::report::allan_plot as plot;
use clap::Args;
use mimu::result::allan::AllanResult;
use mimu::survey::{Options, Part, survey_all};
use mimu_allan::Deviation;
use mimu_recording::{Error, MANIFEST_FILE, Recording, Result};

use crate::arguments::{JsonArgs, StrictArgs, VerboseArgs, choice, number};
use crate::hint::OF_A_LOG;
use crate::output::{Results, check_outputs, now, progress};
use crate::overwriting::check_overwritten;
use crate::reading::{LogArgs, open};
use crate::status::Status;

/// Arguments of `mimu allan`.
#[derive(Args)]
pub struct AllanArgs {
    /// Directory of a recording of the unit at rest; several of one unit, each at another temperature
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// First time stamp, s
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = |t: &str| number(t, -1e12, 1e12))]
    from: Option<f64>,
    /// Last time stamp, s
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = |t: &str| number(t, -1e12, 1e12))]
    to: Option<f64>,
    /// Number of a dwell in the column step
    #[arg(long, value_name = "N", conflicts_with_all = ["from", "to"], allow_negative_numbers = true, value_parser = clap::value_parser!(i32).range(0..))]
    step: Option<i32>,
    /// Deviation to report; the model is always fitted to the overlapping Allan deviation
    #[arg(long, default_value = "allan", value_parser = choice(&[
        ("allan", "Overlapping Allan", Deviation::Allan),
        ("modified", "Modified Allan", Deviation::Modified),
        ("hadamard", "Overlapping Hadamard, insensitive to drift", Deviation::Hadamard),
    ]))]
    kind: Deviation,
    /// Averaging times per decade
    #[arg(long, value_name = "K", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=100))]
    per_decade: u16,
    /// Probability of the intervals
    #[arg(long, value_name = "P", default_value_t = 0.95, value_parser = |t: &str| number(t, 0.5, 0.999))]
    confidence: f64,
    /// Calibration of the unit: readings in V or counts are divided by its scale factors, which are stored in the noise file
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Plot to write
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Noise file to write, for `mimu fit`, `verify`, `diagnose`, `design` and `export`
    ///
    /// For readings in V or counts `design` and `export` need it to be made with --calibration; the others do not.
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    strict: StrictArgs,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
    #[command(flatten, next_help_heading = OF_A_LOG)]
    log: LogArgs,
}

impl AllanArgs {
    /// What is surveyed, and how.
    ///
    /// # Errors
    /// The segment ends before it begins.
    pub fn options(&self) -> Result<Options> {
        Ok(Options {
            part: match (self.step, self.from, self.to) {
                (Some(step), ..) => Part::Step(step),
                (None, None, None) => Part::Whole,
                (None, Some(from), Some(to)) if from >= to => {
                    let problem = format!("{from} s is not before {to} s");
                    return Err(Error::new("--from, --to", problem, "exchange them"));
                }
                (None, from_s, to_s) => Part::Span { from_s, to_s },
            },
            kind: self.kind,
            per_decade: usize::from(self.per_decade),
            confidence: self.confidence,
        })
    }
}

/// The next step: the file, or what it is for.
fn next(args: &AllanArgs) -> String {
    let step = match (&args.output, &args.calibration) {
        (None, None) => "mimu allan ... --calibration cal.toml -o noise.toml writes the file for fit, design and export".into(),
        (None, Some(_)) => "-o noise.toml writes the file for fit, design and export".into(),
        (Some(file), None) => format!("mimu fit REC --noise {}", file.display()),
        (Some(file), Some(calibration)) => format!(
            "mimu export kalibr {} --noise {} -o imu.yaml",
            calibration.display(),
            file.display()
        ),
    };
    format!("next: {step}; --verbose prints curve and reasons\n")
}

pub fn run(args: &AllanArgs) -> Result<Status> {
    if args.plot.is_some() && args.recordings.len() > 1 {
        return Err(Error::new(
            "--plot",
            format!(
                "the plot shows one recording, but {} were given",
                args.recordings.len()
            ),
            "plot one recording at a time",
        ));
    }
    let options = args.options()?;
    let recordings: Vec<Recording> = args
        .recordings
        .iter()
        .map(|r| open(r, &args.log))
        .collect::<Result<_>>()?;
    let manifests: Vec<PathBuf> = args
        .recordings
        .iter()
        .map(|r| r.join(MANIFEST_FILE))
        .collect();
    let mut inputs: Vec<&Path> = manifests.iter().map(PathBuf::as_path).collect();
    inputs.extend(recordings.iter().map(|r| r.samples.as_path()));
    inputs.extend(args.recordings.iter().map(PathBuf::as_path));
    inputs.extend(args.calibration.as_deref());
    let outputs = [
        args.plot.as_deref(),
        args.output.as_deref(),
        args.json.file(),
    ];
    check_outputs(&outputs, &inputs)?;
    check_overwritten(&[args.output.as_deref()])?;
    let calibration = args
        .calibration
        .as_deref()
        .map(opening::calibration)
        .transpose()?;
    let bar = progress("reading and averaging");
    let surveys = survey_all(&recordings, calibration.as_ref(), options, |share| {
        bar.reach(share);
    });
    bar.finish();
    let surveys = surveys?;
    let result = AllanResult::of(&surveys);
    let mut out = Results::new(report::allan_text(&result, args.verbose.verbose));
    if !args.verbose.verbose {
        out.say(&next(args));
    }
    if let Some(noise) = result.noise_file(&now()) {
        out.file("noise", args.output.as_ref(), || Ok(noise.to_toml()))?;
    }
    out.file("plot", args.plot.as_ref(), || Ok(plot::svg(&result)))?;
    out.print(&args.json, &result)?;
    let judgement = result.judgement.as_ref();
    Ok(judgement.map_or(Status::Done, |judgement| args.strict.status(judgement)))
}
