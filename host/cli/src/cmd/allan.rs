//! `mimu allan`: arguments and what follows from them.

use std::path::{Path, PathBuf};

use crate::report;
use crate::report::allan_plot as plot;
use clap::{Args, ValueEnum};
use mimu::allan::Kind;
use mimu::calibration::Calibration;
use mimu::result::allan::AllanResult;
use mimu::survey::{Options, Part, Survey, survey};
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::stage;
use mimu_recording::{MANIFEST_FILE, Recording};

use crate::arguments::{JsonArgs, VerboseArgs};
use crate::output::{check_outputs, print, progress};

#[derive(Args)]
pub struct AllanArgs {
    /// Directory of the recording, of a unit at rest; several of one unit are at a temperature each
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// First time stamp, s
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = time)]
    from: Option<f64>,
    /// Last time stamp, s
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = time)]
    to: Option<f64>,
    /// One dwell of the step column
    #[arg(long, value_name = "N", conflicts_with_all = ["from", "to"], allow_negative_numbers = true, value_parser = clap::value_parser!(i32).range(0..))]
    step: Option<i32>,
    /// Deviation to report; the model is always fitted to the overlapping Allan deviation
    #[arg(long, value_enum, default_value = "allan")]
    kind: KindArg,
    /// Averaging times in a decade
    #[arg(long, value_name = "K", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=100))]
    per_decade: u16,
    /// Probability of the intervals
    #[arg(long, value_name = "P", default_value_t = 0.95, value_parser = confidence)]
    confidence: f64,
    /// Calibration of the unit: readings in V or counts are divided by its scale factors, which go into the noise file
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Plot to write
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Noise file to write, for `mimu fit`, `verify`, `diagnose`, `design` and `export`
    ///
    /// Of readings in V or counts `design` and `export` take it only with --calibration; the others take it either way.
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum KindArg {
    /// Overlapping Allan
    Allan,
    /// Modified Allan
    Modified,
    /// Overlapping Hadamard, blind to drift
    Hadamard,
}

fn time(text: &str) -> std::result::Result<f64, String> {
    match text.parse::<f64>() {
        Ok(t) if t.is_finite() => Ok(t),
        _ => Err("write a time in seconds".into()),
    }
}

fn confidence(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(p) if (0.5..=0.999).contains(&p) => Ok(p),
        _ => Err("write a probability from 0.5 to 0.999".into()),
    }
}

pub fn run(args: &AllanArgs) -> Result<()> {
    if args.plot.is_some() && args.recordings.len() > 1 {
        return Err(Error::new(
            "--plot",
            format!(
                "it shows one recording, and there are {}",
                args.recordings.len()
            ),
            "plot one recording at a time",
        ));
    }
    if let (Some(from), Some(to)) = (args.from, args.to)
        && from >= to
    {
        return Err(Error::new(
            "--from, --to",
            format!("{from} s is not before {to} s"),
            "exchange them",
        ));
    }
    let recordings: Vec<Recording> = args
        .recordings
        .iter()
        .map(|r| Recording::open(r))
        .collect::<Result<_>>()?;
    for (i, recording) in recordings.iter().enumerate().skip(1) {
        refuse_another_unit(&recordings[0], recording)?;
        let same = |r: &Recording| r.samples.canonicalize().ok();
        if recordings[..i].iter().any(|r| same(r) == same(recording)) {
            return Err(Error::new(
                recording.directory.display(),
                "the recording is given twice",
                "leave one out",
            ));
        }
    }
    let manifests: Vec<PathBuf> = args
        .recordings
        .iter()
        .map(|r| r.join(MANIFEST_FILE))
        .collect();
    let mut inputs: Vec<&Path> = manifests.iter().map(PathBuf::as_path).collect();
    inputs.extend(recordings.iter().map(|r| r.samples.as_path()));
    inputs.extend(args.calibration.as_deref());
    let outputs = [
        args.plot.as_deref(),
        args.output.as_deref(),
        args.json.file(),
    ];
    check_outputs(&outputs, &inputs)?;
    let calibration = args
        .calibration
        .as_deref()
        .map(Calibration::read)
        .transpose()?;
    let options = Options {
        part: match (args.step, args.from, args.to) {
            (Some(step), ..) => Part::Step(step),
            (None, None, None) => Part::Whole,
            (None, from_s, to_s) => Part::Span { from_s, to_s },
        },
        kind: match args.kind {
            KindArg::Allan => Kind::Allan,
            KindArg::Modified => Kind::Modified,
            KindArg::Hadamard => Kind::Hadamard,
        },
        per_decade: usize::from(args.per_decade),
        confidence: args.confidence,
    };
    let bar = progress("reading and averaging");
    let all = recordings.len() as f64;
    let surveys: Result<Vec<Survey>> = (0..)
        .zip(&recordings)
        .map(|(done, recording)| {
            survey(recording, calibration.as_ref(), options, |share| {
                bar.set_position(((f64::from(done) + share) / all * 1000.0) as u64);
            })
        })
        .collect();
    bar.finish_and_clear();
    let surveys = surveys?;
    if let (Some(unknown), 2..) = (surveys.iter().find(|s| s.temp_c.is_none()), surveys.len()) {
        return Err(Error::new(
            &unknown.recording,
            "it has no temp_c, which tells the noise of several recordings apart",
            "record the temperature, or give one recording at a time",
        ));
    }
    let result = AllanResult::of(&surveys);
    let mut text = report::allan_text(&result, args.verbose.verbose);
    let mut staged = Vec::new();
    if let (Some(path), Some(mut noise)) = (&args.output, result.noise_file()) {
        let now = jiff::Timestamp::now().round(jiff::Unit::Second);
        noise.created = now.ok().map(|now| now.to_string());
        staged.push(stage(path, noise.to_toml())?);
        text.push_str(&format!("\nnoise: {}\n", path.display()));
    }
    if let Some(path) = &args.plot {
        staged.push(stage(path, plot::svg(&result))?);
        text.push_str(&format!("\nplot: {}\n", path.display()));
    }
    print(&args.json, &text, &result, staged)
}

/// Refuses a recording whose channels cannot stand in one file with those of the first.
fn refuse_another_unit(first: &Recording, other: &Recording) -> Result<()> {
    let (one, two) = (&first.manifest, &other.manifest);
    let place = |recording: &Recording| recording.samples.display().to_string();
    let (what, here, there) = if one.device != two.device {
        (
            "device",
            format!("{:?}", two.device),
            format!("{:?}", one.device),
        )
    } else if one.raw_unit != two.raw_unit {
        (
            "raw_unit",
            two.raw_unit.to_string(),
            one.raw_unit.to_string(),
        )
    } else if one.sample_rate_hz != two.sample_rate_hz {
        (
            "sample_rate_hz",
            two.sample_rate_hz.to_string(),
            one.sample_rate_hz.to_string(),
        )
    } else {
        return Ok(());
    };
    Err(Error::new(
        place(other),
        format!(
            "its {what} is {here}, and that of {} is {there}",
            place(first)
        ),
        "give recordings of one unit, made alike",
    ))
}
