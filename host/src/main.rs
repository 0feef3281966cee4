//! The command `mimu`: argument parsing and output around the library of the same name.

mod allan_args;
mod design_args;
mod device_args;
mod diagnose_args;
mod export_args;
mod record_args;

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use mimu::calibration::{Calibration, Staged, stage, to_toml};
use mimu::dwell::Sensor;
use mimu::error::{Error, Result};
use mimu::fit::{Method, Options, fit};
use mimu::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::recording::{
    ColumnList, ImportOptions, MANIFEST_FILE, RawUnit, Recording, Reference, SampleFormat, Scale,
    Separator, import,
};
use mimu::report;
use mimu::stillness::STILL_FACTOR;
use mimu::verify::verify;

/// Calibration of inertial units made of analog MEMS sensors.
///
/// Exit status 0: done; 1: the data were refused, with one line that says what is wrong, where, and
/// what to do; 2: wrong usage.
#[derive(Parser)]
#[command(name = "mimu", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Make a recording of foreign files
    Import(ImportArgs),
    /// Calibrate the gyro and the accelerometer of a recording
    Fit(FitArgs),
    /// Judge a calibration by another recording
    Verify(VerifyArgs),
    /// Find the effect behind the residual of a calibrated unit
    Diagnose(diagnose_args::DiagnoseArgs),
    /// Design the experiment: which attitudes and rates, how many, for how long
    Design(design_args::DesignArgs),
    /// Noise of a unit at rest: Allan deviation, N, B, K, Q and R
    Allan(allan_args::AllanArgs),
    /// Write noise coefficients in the format of another program
    Export(export_args::ExportArgs),
    /// Record the raw stream of a device
    Record(record_args::RecordArgs),
    /// Talk with a device: info, stream, upload, download, self-test, counters, check, kalman
    Device(device_args::DeviceArgs),
}

#[derive(Args)]
struct ImportArgs {
    /// Text files (any separator) or Parquet; the later ones are joined onto the times of the first
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Columns of a file from the left (`t_s,accel_x,-`; `-` skips one), or by the names in its header
    /// (`gyro_x=wx,t_s=time`); once for each file
    ///
    /// Known are t_s, step (numbers or labels), temp_c, gyro_x.., accel_x.., ref_rate_x_dps..,
    /// ref_force_x_mps2.., and sample, an index from which the time follows with --rate-hz.
    #[arg(long, value_name = "LIST")]
    columns: Vec<ColumnList>,
    /// Sample rate, Hz; without it, the inverse of the median time step
    #[arg(long)]
    rate_hz: Option<f64>,
    /// Local gravity, m/s²; without it, normal gravity at sea level of --latitude, or 9.80665 and a warning
    #[arg(long)]
    gravity: Option<f64>,
    /// Unit of the raw columns, after --scale: V, count or SI (rad/s and m/s²)
    #[arg(long, value_name = "UNIT")]
    raw_unit: RawUnit,
    /// What is known of the input: table (ref_ columns or --inputs) or gravity (its size, at rest)
    #[arg(long)]
    reference: Reference,
    /// Factor for a column, or for gyro or accel: `gyro=0.0174533`
    #[arg(long, value_name = "COLUMN=FACTOR")]
    scale: Vec<Scale>,
    /// Name of the unit; without it, the name of the recording
    #[arg(long)]
    device: Option<String>,
    /// Latitude, degrees
    #[arg(long, allow_negative_numbers = true)]
    latitude: Option<f64>,
    /// CSV with the known input of each step: step, ref_rate_x_dps.., ref_force_x_mps2.., turn_x_deg..
    #[arg(long, value_name = "FILE")]
    inputs: Option<PathBuf>,
    /// Separator of text files: comma, semicolon, tab or space; found out without it
    #[arg(long)]
    separator: Option<Separator>,
    /// Format of the samples: parquet or csv
    #[arg(long, default_value = "parquet")]
    format: SampleFormat,
    /// Replace an existing recording
    #[arg(long)]
    replace: bool,
    /// Directory of the new recording
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Args)]
struct FitArgs {
    /// Directory of the recording
    recording: PathBuf,
    /// Refit without each of N contiguous blocks of time and report the error on it
    #[arg(long, value_name = "blocks=N", default_value = "blocks=4", value_parser = holdout)]
    holdout: usize,
    /// Estimator where the input is known (reference = "table"); least-squares without it
    #[arg(long, value_enum)]
    method: Option<MethodArg>,
    /// Calibrate one of the two only: when the experiment does not determine the other
    #[arg(long, value_enum, value_name = "SENSOR")]
    only: Option<SensorArg>,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    /// List the dwells
    #[arg(long)]
    dwells: bool,
    /// Calibration file to write
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Args)]
struct VerifyArgs {
    /// Directory of the recording
    recording: PathBuf,
    /// Calibration file
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Args)]
struct StillArgs {
    /// Without a step column: largest variance of a still window, times that of the quietest
    #[arg(long = "still", value_name = "FACTOR", default_value_t = STILL_FACTOR, value_parser = still)]
    factor: f64,
}

#[derive(Args)]
struct NoiseArgs {
    /// Noise of the unit at rest, by `mimu allan -o`; without it, the noise within the dwells
    ///
    /// It also says how the bias wanders from dwell to dwell, which no dwell can tell.
    #[arg(long = "noise", value_name = "FILE")]
    file: Option<PathBuf>,
}

#[derive(Args)]
struct JsonArgs {
    /// Write the result as JSON (`-`: to standard output, in place of the text)
    #[arg(long = "json", value_name = "PATH")]
    path: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum MethodArg {
    /// Forward form, all dwells at once (fang)
    LeastSquares,
    /// Forward form, bank of Kalman filters (fang)
    Kalman,
    /// Inverse form, differences of opposite rates (xu)
    Xu,
    /// Scale factors and biases only, from six positions
    SixPositions,
}

#[derive(Clone, Copy, ValueEnum)]
enum SensorArg {
    Gyro,
    Accel,
}

fn holdout(text: &str) -> std::result::Result<usize, String> {
    let count = text.strip_prefix("blocks=").unwrap_or(text);
    match count.parse() {
        Ok(1) => Err("one block leaves nothing to fit to: at least 2, or 0 for none".into()),
        Ok(n) if n <= 1000 => Ok(n),
        _ => Err("write blocks=N with N from 2 to 1000, or blocks=0 for none".into()),
    }
}

fn still(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(f) if (1.0..=1e9).contains(&f) => Ok(f),
        _ => Err("write a number of at least 1".into()),
    }
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Import(args) => run_import(args),
        Command::Fit(args) => run_fit(&args),
        Command::Verify(args) => run_verify(&args),
        Command::Diagnose(args) => diagnose_args::run(&args),
        Command::Design(args) => design_args::run(&args),
        Command::Allan(args) => allan_args::run(&args),
        Command::Export(args) => export_args::run(&args),
        Command::Record(args) => record_args::run(&args),
        Command::Device(args) => device_args::run(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("mimu: {error}");
            ExitCode::from(1)
        }
    }
}

/// Sample rates below this are more likely a wrong unit of time.
const SLOW_HZ: f64 = 5.0;

fn run_import(args: ImportArgs) -> Result<()> {
    let (gravity, assumed) = match (args.gravity, args.latitude) {
        (Some(gravity), _) => (gravity, None),
        (None, Some(latitude)) => (normal_gravity(latitude), None),
        (None, None) if args.reference == Reference::Table => (9.80665, None),
        (None, None) => (9.80665, Some("gravity is taken to be 9.80665 m/s²; it ranges from 9.78 at the equator to 9.83 at the poles, and every scale factor of the accelerometer with it: give --gravity or --latitude".to_string())),
    };
    let options = ImportOptions {
        columns: args.columns,
        separator: args.separator,
        rate_hz: args.rate_hz,
        scales: args.scale,
        device: args.device,
        latitude_deg: args.latitude,
        inputs: args.inputs,
        format: args.format,
        replace: args.replace,
        ..ImportOptions::new(args.files, gravity, args.raw_unit, args.reference)
    };
    let inputs: Vec<&Path> = options
        .files
        .iter()
        .chain(&options.inputs)
        .map(|p| p.as_path())
        .collect();
    check_outputs(&[args.json.file()], &inputs)?;
    let bar = progress("importing");
    let mut summary = import(&options, &args.output, |share| {
        bar.set_position((share * 1000.0) as u64)
    })?;
    bar.finish_and_clear();
    summary.warnings.extend(assumed);
    if summary.sample_rate_hz < SLOW_HZ {
        summary.warnings.push(format!(
            "{} Hz is slow for an inertial unit: if the times are in milliseconds, import with --scale t_s=0.001",
            summary.sample_rate_hz
        ));
    }
    print(
        &args.json,
        &report::import_text(&summary),
        &report::import_json(&summary),
        None,
    )
}

/// Normal gravity at sea level, m/s² (WGS 84, Somigliana), at a latitude in degrees. Local gravity differs by some
/// 3e-4 m/s², and by 3.1e-6 m/s² for each metre of height.
fn normal_gravity(latitude_deg: f64) -> f64 {
    let sin2 = latitude_deg.to_radians().sin().powi(2);
    9.780_325_335_9 * (1.0 + 0.001_931_852_652_41 * sin2)
        / (1.0 - 0.006_694_379_990_14 * sin2).sqrt()
}

fn run_fit(args: &FitArgs) -> Result<()> {
    let options = Options {
        method: match args.method {
            None | Some(MethodArg::LeastSquares) => Method::LeastSquares,
            Some(MethodArg::Kalman) => Method::Kalman,
            Some(MethodArg::Xu) => Method::Xu,
            Some(MethodArg::SixPositions) => Method::SixPositions,
        },
        holdout_blocks: args.holdout,
        still_factor: args.still.factor,
        only: args.only.map(|only| match only {
            SensorArg::Gyro => Sensor::Gyro,
            SensorArg::Accel => Sensor::Accel,
        }),
    };
    let outputs = [args.output.as_deref(), args.json.file()];
    let inputs = [args.noise.file.as_deref()];
    let prepared = read(&args.recording, options.still_factor, &outputs, &inputs)?;
    let prepared = args.noise.state(prepared)?;
    if args.method.is_some() && prepared.manifest.reference == Reference::Gravity {
        return Err(Error::new(
            args.recording.display(),
            "--method chooses between estimators for known inputs, and reference is \"gravity\"",
            "leave --method out, or give the steps their inputs (reference = \"table\")",
        ));
    }
    let fitted = fit(prepared, options)?;
    let mut text = report::fit_text(&fitted);
    if args.dwells {
        text.push('\n');
        text.push_str(&report::dwell_table(
            &fitted.prepared.dwells.list,
            &fitted.prepared.manifest,
        ));
    }
    let mut calibration = None;
    if let Some(path) = &args.output {
        let now = jiff::Timestamp::now()
            .round(jiff::Unit::Second)
            .unwrap_or_default();
        calibration = Some(stage(path, to_toml(&fitted, &[], &now.to_string()))?);
        text.push_str(&format!("\ncalibration: {}\n", path.display()));
    }
    print(&args.json, &text, &report::fit_json(&fitted), calibration)
}

fn run_verify(args: &VerifyArgs) -> Result<()> {
    let calibration = Calibration::read(&args.calibration)?;
    let outputs = [args.json.file()];
    let prepared = read(
        &args.recording,
        args.still.factor,
        &outputs,
        &[Some(&args.calibration), args.noise.file.as_deref()],
    )?;
    let prepared = args.noise.state(prepared)?;
    let verified = verify(&prepared, &calibration)?;
    print(
        &args.json,
        &report::verify_text(&verified),
        &report::verify_json(&verified),
        None,
    )
}

/// Opens and reads a recording, after checking that the results can be written and take the place of no input.
fn read(
    directory: &Path,
    still_factor: f64,
    outputs: &[Option<&Path>],
    others: &[Option<&Path>],
) -> Result<Prepared> {
    let recording = Recording::open(directory)?;
    let manifest = directory.join(MANIFEST_FILE);
    let mut inputs: Vec<&Path> = vec![&manifest, &recording.samples];
    inputs.extend(others.iter().flatten());
    check_outputs(outputs, &inputs)?;
    let bar = progress("reading");
    let prepared = Prepared::read(&recording, still_factor, |share| {
        bar.set_position((share * 1000.0) as u64)
    });
    bar.finish_and_clear();
    prepared
}

/// Refuses outputs that cannot be written, before the work, and those that would overwrite an input or each other.
fn check_outputs(outputs: &[Option<&Path>], inputs: &[&Path]) -> Result<()> {
    let mut taken: Vec<PathBuf> = inputs
        .iter()
        .filter_map(|p| p.canonicalize().ok())
        .collect();
    for path in outputs.iter().flatten() {
        // Only a try: dropped, it leaves nothing.
        let folder = stage(path, String::new())?.folder();
        let name = path.file_name().unwrap_or_default();
        let full = path.canonicalize().unwrap_or_else(|_| folder.join(name));
        if !full.exists() || full.is_file() {
            if taken.contains(&full) {
                let problem = "this is an input, or another result goes there";
                return Err(Error::new(path.display(), problem, "choose another name"));
            }
            taken.push(full);
        }
    }
    Ok(())
}

/// Progress in thousandths, on a terminal only.
fn progress(what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(1000).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {percent:>3} % {eta}") {
        bar.set_style(style);
    }
    bar
}

impl NoiseArgs {
    /// `prepared` with the noise of the file, if there is one.
    fn state(&self, prepared: Prepared) -> Result<Prepared> {
        match &self.file {
            Some(path) => prepared.with_noise(&NoiseFile::read(path)?),
            None => Ok(prepared),
        }
    }
}

impl JsonArgs {
    /// The file to write, if it is one.
    fn file(&self) -> Option<&Path> {
        self.path.as_deref().filter(|path| *path != Path::new("-"))
    }

    /// Whether it takes the place of the text.
    fn is_standard_output(&self) -> bool {
        self.path.is_some() && self.file().is_none()
    }
}

/// Prints the text, or writes the JSON and prints the text unless both would go to standard output. All files appear
/// when all of them are written.
fn print(
    json: &JsonArgs,
    text: &str,
    value: &serde_json::Value,
    files: impl IntoIterator<Item = Staged>,
) -> Result<()> {
    let pretty = format!("{value:#}\n");
    let file = json.file().map(|path| stage(path, pretty.clone()));
    for staged in files.into_iter().chain(file.transpose()?) {
        staged.publish()?;
    }
    let shown = match (&json.path, json.file()) {
        (Some(_), None) => &pretty,
        _ => text,
    };
    let mut out = std::io::stdout().lock();
    match out.write_all(shown.as_bytes()).and_then(|()| out.flush()) {
        // `mimu fit ... | head` is no error.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Error::io(Path::new("standard output"), &e)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_gravity_is_that_of_the_ellipsoid_at_the_equator_and_the_poles() {
        // NIMA TR8350.2, table 3.4.
        assert!((normal_gravity(0.0) - 9.780_325_335_9).abs() < 1e-9);
        assert!((normal_gravity(-90.0) - 9.832_184_937_8).abs() < 1e-8);
    }

    #[test]
    fn arguments_are_consistent() {
        <Cli as clap::CommandFactory>::command().debug_assert();
    }
}
