//! `mimu import`.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mimu::quantity::normal_gravity;
use mimu::warning::Warning;
use mimu_recording::error::{Error, Result};
use mimu_recording::signed_low_byte::SignedLowByte;
use mimu_recording::{
    BrokenLimit, ColumnList, Decimal, Face, ImportOptions, ImportSummary, Offset, Preset, RawUnit,
    Reference, RowFilter, SampleFormat, Scale, Separator, Turntable, TurntableRate, TwosComplement,
    Zero, import, is_log, rate_error,
};

use crate::arguments::JsonArgs;
use crate::output::{check_outputs, print, progress};
use crate::report;

#[derive(Args)]
pub(crate) struct ImportArgs {
    /// Text files (any separator), Parquet, bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap), logs of PX4 (.ulg) and ArduPilot (.bin), or
    /// the folder of a preset; the later ones are joined onto the times of the first
    #[arg(required_unless_present = "faces")]
    files: Vec<PathBuf>,
    /// Columns of a file from the left (`t_s,accel_x,-`; `-` skips one), or by the names in its header
    /// (`gyro_x=wx,t_s=time`); once for each file
    ///
    /// Known are t_s, step (numbers or labels), temp_c, gyro_x.., accel_x.., ref_rate_x_dps..,
    /// ref_force_x_mps2.., and sample, an index from which the time follows with --rate-hz.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    columns: Vec<ColumnList>,
    /// Maker or program whose layout the files have: columns, units and signs; found by the header without it
    #[arg(long, value_name = "NAME", value_parser = presets())]
    preset: Option<Preset>,
    /// The rows are means over a pose or a rate each, and no samples: mean readings, and as far as known standard deviations of a
    /// sample (`accel_x_sd`), numbers of samples (`averaged`, `accel_x_averaged`), inputs (ref_ columns) and names (`step`)
    #[arg(long)]
    means: bool,
    /// The files follow one another, as those of six faces: each is a step with the name of its file, and one list of columns serves all
    #[arg(long, conflicts_with = "means")]
    sequence: bool,
    /// One file for each face, with the axis that was up: `--faces +x=a.csv -x=b.csv +y=c.csv -y=d.csv +z=e.csv -z=f.csv`; with
    /// --reference table the specific forces follow
    #[arg(long, conflicts_with_all = ["means", "sequence", "inputs"])]
    faces: bool,
    /// With --faces: the file with x down
    #[arg(short = 'x', value_name = "FILE", requires = "faces")]
    x_down: Vec<PathBuf>,
    /// With --faces: the file with y down
    #[arg(short = 'y', value_name = "FILE", requires = "faces")]
    y_down: Vec<PathBuf>,
    /// With --faces: the file with z down
    #[arg(short = 'z', value_name = "FILE", requires = "faces")]
    z_down: Vec<PathBuf>,
    /// Rows after a pause of more than so many seconds are a new step, as where nothing was recorded between the poses
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, conflicts_with_all = ["means", "sequence", "faces"])]
    step_gap: Option<f64>,
    /// Only the rows in which a column has this value, as one of several sensors in a file: `channel=3`; repeated, all must hold
    #[arg(long = "where", value_name = "COLUMN=VALUE", conflicts_with = "means")]
    filters: Vec<RowFilter>,
    /// Sample rate, Hz, of files without a time column. Of others it is the rate of their time stamps, which this one checks;
    /// it decides where stamps in bursts can be read in two ways
    #[arg(long, allow_negative_numbers = true)]
    rate_hz: Option<f64>,
    /// Unit of the time stamps: s, ms, us or ns; found out without it, and asked for where two are possible
    #[arg(long, value_name = "UNIT")]
    time_unit: Option<Decimal>,
    /// Local gravity, m/s²; without it, normal gravity at sea level of --latitude, or 9.80665 and a warning
    #[arg(long, allow_negative_numbers = true)]
    gravity: Option<f64>,
    /// Unit of the raw columns, after --scale: V, count or SI (rad/s and m/s²); bags, logs and most presets have SI without it
    #[arg(long, value_name = "UNIT")]
    raw_unit: Option<RawUnit>,
    /// Topic of a bag with sensor_msgs/Imu, of a PX4 log (sensor_gyro, sensor_combined) or message of an ArduPilot log (IMU, GYR, IMT);
    /// without it, the only or the best one
    #[arg(long)]
    topic: Option<String>,
    /// Which sensor of a log of PX4 or ArduPilot, from 0; without it, the only one
    #[arg(long, value_name = "N")]
    instance: Option<u32>,
    /// What is known of the input: table (ref_ columns or --inputs), gravity (its magnitude, at rest), or turntable-rate (the magnitude of
    /// the rate, as on a record player, with --rate-dps and --rate-error)
    #[arg(long)]
    reference: Reference,
    /// Magnitudes of the turntable's rates, deg/s: 200 for 33 1/3 rpm, 270 for 45 rpm; of a step by its number, label or file name
    /// (`edge=270`, `rest=0`), else the readings show which dwell has which
    #[arg(
        long,
        value_name = "RATE",
        value_delimiter = ',',
        requires = "rate_error",
        allow_negative_numbers = true
    )]
    rate_dps: Vec<TurntableRate>,
    /// How well these rates are known: half of a 95 % interval, as `0.1%`; no number of dwells reduces it
    #[arg(long, value_name = "PERCENT", requires = "rate_dps", value_parser = rate_error)]
    rate_error: Option<f64>,
    /// Factor for a column, or for gyro or accel: `gyro=0.0174533`
    #[arg(long, value_name = "COLUMN=FACTOR")]
    scale: Vec<Scale>,
    /// What is added to a column after its factor: `temp_c=36.53`
    #[arg(long, value_name = "COLUMN=VALUE", allow_hyphen_values = true)]
    offset: Vec<Offset>,
    /// Columns of which the firmware took the low byte for a signed number: gyro, accel or a column; mended exactly, before --scale
    ///
    /// `(high << 8) + (int8_t)low` reads 256 counts low where the low byte is 128 or more. The readings have to be whole counts.
    #[arg(long, value_name = "COLUMN", conflicts_with = "means")]
    signed_low_byte: Vec<SignedLowByte>,
    /// Raw columns of unsigned codes in two's complement, with their bits: `accel=12`
    #[arg(long, value_name = "COLUMN=BITS", conflicts_with = "means")]
    twos_complement: Vec<TwosComplement>,
    /// Code that raw columns have at an input of 0, subtracted before --scale: `gyro=2048`
    #[arg(long, value_name = "COLUMN=CODE", conflicts_with = "means")]
    zero: Vec<Zero>,
    /// Name of the unit; without it, the name of the recording
    #[arg(long)]
    device: Option<String>,
    /// Latitude, degrees
    #[arg(long, allow_negative_numbers = true)]
    latitude: Option<f64>,
    /// CSV with the known input of each step: step, ref_rate_x_dps.., ref_force_x_mps2.., turn_x_deg..
    ///
    /// One row for each step of the column step, by its number or label; what is not known stays empty:
    /// `step,turn_x_deg,ref_force_x_mps2`, then `face_up,,9.81` and `about_x,360,`.
    #[arg(long, value_name = "FILE")]
    inputs: Option<PathBuf>,
    /// Separator of text files: comma, semicolon, tab or space; found out without it
    #[arg(long)]
    separator: Option<Separator>,
    /// Leave out rows that cannot be read: so many (`=20`), or a share of each file (`=2%`); 1 % of it where neither is given
    #[arg(long, value_name = "LIMIT", num_args = 0..=1, require_equals = true, default_missing_value = "1%", conflicts_with = "means")]
    skip_broken: Option<BrokenLimit>,
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

fn presets() -> impl TypedValueParser<Value = Preset> {
    let names = Preset::all()
        .iter()
        .map(|preset| PossibleValue::new(preset.name).help(preset.title));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Preset>())
}

/// Sample rates below this are more likely a wrong unit of time.
const SLOW_HZ: f64 = 5.0;

/// The files of `args` with their faces, where it names them: `+x=a.csv` among the files, `-x=b.csv` as an option.
fn faces(args: &ImportArgs) -> Result<(Vec<PathBuf>, Vec<Face>)> {
    if !args.faces {
        return Ok((args.files.clone(), Vec::new()));
    }
    let mut both = Vec::new();
    for file in &args.files {
        let text = file.to_string_lossy();
        let (face, path) = text.split_once('=').ok_or_else(|| {
            let problem = "no axis is given that was up while it was recorded";
            Error::new(file.display(), problem, format!("write it like +x={text}"))
        })?;
        both.push((face.parse::<Face>()?, PathBuf::from(path)));
    }
    for (face, files) in [
        ("-x", &args.x_down),
        ("-y", &args.y_down),
        ("-z", &args.z_down),
    ] {
        for file in files {
            both.push((face.parse()?, file.clone()));
        }
    }
    both.sort_by_key(|(face, _)| *face);
    for (k, (face, path)) in both.iter().enumerate() {
        if path.as_os_str().is_empty() {
            let remedy = format!("write it like {face}=FILE");
            return Err(Error::new(face, "no file is given for this face", remedy));
        }
        // One recording for two faces is a slip of the keyboard, which a fit cannot tell from an axis without sensitivity.
        if let Some((other, _)) = both[..k].iter().find(|(f, p)| p == path && f != face) {
            let problem = format!("it is given for the faces {other} and {face}");
            let remedy = "give the recording of each face";
            return Err(Error::new(path.display(), problem, remedy));
        }
    }
    Ok(both.into_iter().map(|(face, path)| (path, face)).unzip())
}

pub(crate) fn run(args: ImportArgs) -> Result<()> {
    let json = JsonArgs {
        path: args.json.path.clone(),
    };
    let summary = imported(args)?;
    print(&json, &report::import_text(&summary), &summary, None)
}

/// Makes the recording.
pub(crate) fn imported(args: ImportArgs) -> Result<ImportSummary> {
    let (files, faces) = faces(&args)?;
    let (gravity, assumed) = match (args.gravity, args.latitude) {
        (Some(gravity), latitude) => (
            gravity,
            latitude
                .and_then(|at| Warning::of_gravity(gravity, at))
                .map(|w| w.to_string()),
        ),
        (None, Some(latitude)) => (normal_gravity(latitude), None),
        (None, None) if args.reference == Reference::Table => (9.80665, None),
        (None, None) => (9.80665, Some("gravity is taken to be 9.80665 m/s²; it ranges from 9.78 at the equator to 9.83 at the poles, and every scale factor of the accelerometer with it: give --gravity or --latitude".to_string())),
    };
    let chosen = match (&args.preset, args.columns.is_empty()) {
        (None, false) => None,
        (named, _) => Preset::choose(*named, &files, args.separator)?,
    };
    let logs = files.iter().all(|file| is_log(file));
    let raw_unit = args
        .raw_unit
        .or(chosen.as_ref().and_then(|chosen| chosen.raw_unit))
        .or(logs.then_some(RawUnit::Si))
        .ok_or_else(|| {
            let remedy = "give --raw-unit: V, count or SI (rad/s and m/s²)";
            Error::new("import", "the unit of the readings is not known", remedy)
        })?;
    let options = ImportOptions {
        topic: args.topic,
        instance: args.instance,
        twos_complements: args.twos_complement,
        zeros: args.zero,
        step_gap_s: args.step_gap,
        turntable: args
            .rate_error
            .map(|error| Turntable::new(&args.rate_dps, error)),
        columns: args.columns,
        separator: args.separator,
        rate_hz: args.rate_hz,
        scales: args.scale,
        offsets: args.offset,
        signed_low_bytes: args.signed_low_byte,
        time_unit: args.time_unit,
        device: args.device,
        latitude_deg: args.latitude,
        inputs: args.inputs,
        means: args.means,
        sequence: args.sequence,
        faces,
        filters: args.filters,
        skip_broken: args.skip_broken.unwrap_or_default(),
        format: args.format,
        replace: args.replace,
        ..ImportOptions::new(files, gravity, raw_unit, args.reference)
    };
    let options = match chosen {
        Some(chosen) => options.with_preset(chosen),
        None => options,
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
    let recognised = summary.time.first().filter(|time| time.recognised);
    if let Some(unit) = recognised.and_then(|time| time.unit)
        && summary.sample_rate_hz < SLOW_HZ
    {
        summary.warnings.push(format!(
            "{} Hz is slow for an inertial unit: if the times are not in {unit}, give their unit (--time-unit)",
            summary.sample_rate_hz
        ));
    }
    Ok(summary)
}
