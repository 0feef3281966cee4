//! Imports: of `mimu import`, and of logs that other commands take in place of a recording.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, CommandFactory};
use mimu::quantity::normal_gravity;
use mimu::warning::Warning;
use mimu_recording::error::{Error, Result};
use mimu_recording::look::{Given, Look};
use mimu_recording::signed_low_byte::SignedLowByte;
use mimu_recording::{
    BrokenLimit, Chosen, ColumnList, CommentSigns, Decimal, Face, ImportOptions, ImportSummary,
    Offset, Preset, RawUnit, Reference, RowFilter, RowRange, SampleFormat, Scale, Separator,
    Turntable, TurntableRate, TwosComplement, Zero, import, is_log, rate_error,
};

use crate::Cli;
use crate::arguments::JsonArgs;
use crate::output::{check_outputs, progress, quoted};

#[derive(Args)]
pub(crate) struct ImportArgs {
    /// Text files (any separator), Parquet, bags of ROS 1 (.bag) and ROS 2 (.db3, .mcap), logs of PX4 (.ulg), of ArduPilot (.bin) and for Gyroflow (.gcsv), or the
    /// folder of a preset; later files are interpolated at the times of the first
    #[arg(required_unless_present = "faces")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    log: LogOptions,
    /// The files follow one another, like those of six faces: each is a dwell with the name of its file; one list of columns applies to all
    #[arg(long, conflicts_with_all = ["means", "step_gap"])]
    sequence: bool,
    /// One file for each face, named with the axis that was up: `--faces +x=a.csv -x=b.csv +y=c.csv -y=d.csv +z=e.csv -z=f.csv`; with
    /// --reference table the faces give the specific forces
    #[arg(long, conflicts_with_all = ["means", "sequence", "inputs", "step_gap"])]
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
    pub(crate) json: JsonArgs,
}

/// What the person knows of a log: options of every command that takes one.
#[derive(Args, Default, Clone)]
pub(crate) struct LogOptions {
    /// Columns of a file from the left (`t_s,accel_x,-`; `-` skips one), or by the names in its header (`gyro_x=wx,t_s=time`); one list for
    /// each file, or several for a file with a sensor in other columns or rows (--where)
    ///
    /// Names of columns: t_s, step (numbers or labels), temp_c, gyro_x.., accel_x.., ref_rate_x_dps.., ref_force_x_mps2.., and sample, an
    /// index that gives the time with --rate-hz.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    columns: Vec<ColumnList>,
    /// Maker or program whose columns, units and signs the files have [default: recognised by the header]
    #[arg(long, value_name = "NAME", value_parser = presets())]
    preset: Option<Preset>,
    /// Each row is the mean over a pose or a rate, not a sample. Optional columns: standard deviation of a sample (`accel_x_sd`), number of
    /// samples (`averaged`, `accel_x_averaged`), inputs (ref_ columns) and names (`step`)
    #[arg(long)]
    means: bool,
    /// A pause of more than this number of seconds begins a new dwell, for files without rows between the poses
    #[arg(
        long,
        value_name = "SECONDS",
        allow_negative_numbers = true,
        conflicts_with = "means"
    )]
    step_gap: Option<f64>,
    /// Import only the rows in which a column has this value, for one of several sensors in a file: `channel=3`; if repeated, a row must
    /// satisfy all, unless they are values of one column: then each belongs to a list of --columns
    #[arg(long = "where", value_name = "COLUMN=VALUE", conflicts_with = "means")]
    filters: Vec<RowFilter>,
    /// Import only these data rows, the first and the last included, counted from 1: `..8799` for those before a fault in row 8800, `8800..`
    #[arg(long, value_name = "FIRST..LAST", conflicts_with = "means")]
    rows: Option<RowRange>,
    /// Sample rate, Hz. Files without a time column need it; in others it checks the rate of the stamps, and decides if stamps in bursts
    /// are ambiguous
    #[arg(long, allow_negative_numbers = true)]
    rate_hz: Option<f64>,
    /// Unit of the time stamps: s, ms, us or ns [default: recognised; required if two are possible]
    #[arg(long, value_name = "UNIT")]
    time_unit: Option<Decimal>,
    /// Local gravity, m/s² [default: normal gravity at sea level at --latitude, or 9.80665 with a warning]
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) gravity: Option<f64>,
    /// Unit of the raw columns, after --scale: V, count or SI (rad/s and m/s²) [default of bags, logs and most presets: SI]
    #[arg(long, value_name = "UNIT")]
    raw_unit: Option<RawUnit>,
    /// Units of the readings in the file, which are converted to SI: one of g, mg, m/s2 and one of deg/s, mdeg/s, rad/s; or count, or V
    /// [default: by the names, by gravity at rest and by its turns]
    #[arg(long, value_name = "G,DEG/S", conflicts_with_all = ["raw_unit", "means"])]
    units: Option<String>,
    /// Topic of a bag (sensor_msgs/Imu; give two if gyro and accelerometer have one each) or of a PX4 log (sensor_gyro, sensor_combined,
    /// vehicle_imu), or message of an ArduPilot log (IMU, GYR, IMT) [default: the only or the best one]
    #[arg(long)]
    topic: Vec<String>,
    /// Sensor of a PX4 or ArduPilot log, counted from 0 [default: the only one]
    #[arg(long, value_name = "N")]
    instance: Option<u32>,
    /// What is known of the input: table (ref_ columns or --inputs), gravity (its magnitude at rest), or turntable-rate (the magnitude of
    /// the rate, as on a record player; needs --rate-dps and --rate-error) [default: gravity, unless there are ref_ columns, --inputs or
    /// --rate-dps]
    #[arg(long)]
    reference: Option<Reference>,
    /// Magnitudes of the turntable's rates, deg/s: 200 for 33 1/3 rpm, 270 for 45 rpm. The readings show which dwell has which rate, unless
    /// it is given by number, label or file name (`edge=270`, `rest=0`)
    #[arg(
        long,
        value_name = "RATE",
        value_delimiter = ',',
        requires = "rate_error",
        allow_negative_numbers = true
    )]
    rate_dps: Vec<TurntableRate>,
    /// Error of these rates: half of a 95 % interval, like `0.1%`; no number of dwells reduces it
    #[arg(long, value_name = "PERCENT", requires = "rate_dps", value_parser = rate_error)]
    rate_error: Option<f64>,
    /// Factor for a column, or for gyro or accel: `gyro=0.0174533`
    #[arg(long, value_name = "COLUMN=FACTOR")]
    scale: Vec<Scale>,
    /// Number added to a column after its factor: `temp_c=36.53`
    #[arg(long, value_name = "COLUMN=VALUE", allow_hyphen_values = true)]
    offset: Vec<Offset>,
    /// Columns whose low byte the firmware read as a signed number: gyro, accel or a column; corrected exactly, before --scale
    ///
    /// `(high << 8) + (int8_t)low` is 256 counts too low if the low byte is 128 or more. The readings have to be whole counts.
    #[arg(long, value_name = "COLUMN", conflicts_with = "means")]
    signed_low_byte: Vec<SignedLowByte>,
    /// Raw columns of unsigned codes in two's complement, with their bits: `accel=12`
    #[arg(long, value_name = "COLUMN=BITS", conflicts_with = "means")]
    twos_complement: Vec<TwosComplement>,
    /// Code of raw columns at zero input, subtracted before --scale: `gyro=2048`
    #[arg(long, value_name = "COLUMN=CODE", conflicts_with = "means")]
    zero: Vec<Zero>,
    /// Name of the unit; recordings and calibrations of units with different names are not used together [default: unnamed]
    #[arg(long)]
    device: Option<String>,
    /// Latitude, degrees
    #[arg(long, allow_negative_numbers = true)]
    pub(crate) latitude: Option<f64>,
    /// CSV file with the known input of each dwell or turn: step, ref_rate_x_dps.., ref_force_x_mps2.., turn_x_deg..
    ///
    /// One row for each number or label of the column step; leave unknown inputs empty: `step,turn_x_deg,ref_force_x_mps2`, then
    /// `face_up,,9.81` and `about_x,360,`.
    #[arg(long, value_name = "FILE")]
    inputs: Option<PathBuf>,
    /// Separator of text files: comma, semicolon, tab, whitespace, or all characters that separate cells: `,;*` [default: recognised]
    #[arg(long)]
    separator: Option<Separator>,
    /// Characters that begin a comment line in text files, or none
    #[arg(long, value_name = "SIGNS", default_value_t)]
    comment: CommentSigns,
    /// Leave out rows that cannot be read: at most this number (`=20`), or this share of each file (`=2%`) [without a value: 1%]
    #[arg(long, value_name = "LIMIT", num_args = 0..=1, require_equals = true, default_missing_value = "1%", conflicts_with = "means")]
    skip_broken: Option<BrokenLimit>,
    /// Use the readings although they look like those of two devices in turn, wrongly coded, or of another range from some row on
    #[arg(long, conflicts_with = "means")]
    trust_readings: bool,
}

fn presets() -> impl TypedValueParser<Value = Preset> {
    let names = Preset::all()
        .iter()
        .map(|preset| PossibleValue::new(preset.name).help(preset.title));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Preset>())
}

/// Sample rates below this more likely mean a wrong unit of time.
const SLOW_HZ: f64 = 5.0;

/// The files of `args` with their faces, if it names them: `+x=a.csv` among the files, `-x=b.csv` as an option.
fn faces(args: &ImportArgs) -> Result<(Vec<PathBuf>, Vec<Face>)> {
    if !args.faces {
        return Ok((args.files.clone(), Vec::new()));
    }
    let mut both = Vec::new();
    for file in &args.files {
        let text = file.to_string_lossy();
        let (face, path) = text.split_once('=').ok_or_else(|| {
            let problem = "the axis that was up is missing";
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
        // A file given for two faces is a typing error. A fit cannot distinguish it from an axis without sensitivity.
        if let Some((other, _)) = both[..k].iter().find(|(f, p)| p == path && f != face) {
            let problem = format!("it is given for the faces {other} and {face}");
            let remedy = "give the recording of each face";
            return Err(Error::new(path.display(), problem, remedy));
        }
    }
    Ok(both.into_iter().map(|(face, path)| (path, face)).unzip())
}

/// Looks at files whose columns nobody has named, and asks on a terminal about what they do not show.
///
/// # Errors
/// What is still open, all at once, with the command to complete.
fn look_at(args: &mut ImportArgs, files: &[PathBuf]) -> Result<Option<Look>> {
    loop {
        let look = look(args, files)?;
        let Some(refusal) = look.refusal(&files[0], &typed(files)) else {
            return Ok(Some(look));
        };
        let person = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
        if !person || !ask(args, &look)? {
            return Err(refusal);
        }
        // The person has named the columns, so there is nothing to look for.
        if !args.log.columns.is_empty() {
            return Ok(None);
        }
    }
}

/// Asks about everything that `look` leaves open, and puts the answers into `args`. False if the person gives none.
fn ask(args: &mut ImportArgs, look: &Look) -> Result<bool> {
    let io = |error: std::io::Error| Error::io(Path::new("terminal"), &error);
    for question in &look.questions {
        let (option, choice) = question
            .answer
            .split_once(' ')
            .unwrap_or((&question.answer, ""));
        eprintln!("{}", question.about);
        eprint!("{option} ({choice}): ");
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).map_err(io)?;
        let answer = answer.trim();
        if answer.is_empty() {
            return Ok(false);
        }
        match option {
            "--units" => {
                let before = args
                    .log
                    .units
                    .take()
                    .map_or(String::new(), |units| units + ",");
                args.log.units = Some(before + answer);
            }
            "--rate-hz" => {
                let number = answer.trim_end_matches("Hz").trim().parse();
                let problem = format!("{answer:?} is no number");
                let refused = |_| Error::new("--rate-hz", problem, "write samples a second");
                args.log.rate_hz = Some(number.map_err(refused)?);
            }
            "--columns" => {
                args.log.columns.push(answer.parse()?);
                let separator = look.files.iter().find_map(|file| file.separator);
                args.log.separator = args.log.separator.or(separator);
            }
            "--time-unit" => args.log.time_unit = Some(answer.parse()?),
            _ => return Ok(false),
        }
    }
    Ok(true)
}

/// The command to complete: as it was typed, or the import of these files if another program called.
fn typed(files: &[PathBuf]) -> String {
    let typed: Vec<String> = std::env::args().skip(1).map(|a| quoted(&a)).collect();
    let command = Cli::command();
    match typed
        .first()
        .is_some_and(|first| command.find_subcommand(first).is_some())
    {
        true => format!("mimu {}", typed.join(" ")),
        false => format!(
            "mimu import {} -o DIR",
            quoted(&files[0].display().to_string())
        ),
    }
}

fn look(args: &ImportArgs, files: &[PathBuf]) -> Result<Look> {
    let converted = !args.log.twos_complement.is_empty()
        || !args.log.zero.is_empty()
        || !args.log.signed_low_byte.is_empty();
    let scaled = args.log.scale.iter().any(Scale::is_of_readings);
    let mut given = Given {
        // A factor may also come before the unit: twice the readings in deg/s.
        raw_unit: args.log.raw_unit.is_some() || converted || scaled && args.log.units.is_none(),
        rate: args.log.rate_hz.is_some(),
        time_unit: args.log.time_unit,
        ..Given::default()
    };
    if let Some(units) = &args.log.units {
        given = given.with_units(units)?;
    }
    // Files of a sequence are alike; joined ones are looked at together.
    let together = match args.sequence || args.faces {
        true => &files[..files.len().min(1)],
        false => files,
    };
    Look::at(together, args.log.separator, &given)
}

/// Unit of readings whose columns are given, by `--units`; their conversion is added to the factors.
fn by_units(args: &mut ImportArgs, preset: Option<&Chosen>) -> Result<Option<RawUnit>> {
    let Some(units) = &args.log.units else {
        return Ok(None);
    };
    if let Some(preset) = preset.filter(|preset| preset.raw_unit.is_some()) {
        let problem = format!(
            "the readings of the preset {} have a unit",
            preset.used.name
        );
        let remedy = "leave it out, or name the columns: --columns";
        return Err(Error::new("--units", problem, remedy));
    }
    let (unit, factors) = Given::default().with_units(units)?.conversion()?;
    for (sensor, factor) in ["gyro", "accel"].into_iter().zip(factors) {
        if let Some(factor) = factor.filter(|factor| *factor != 1.0) {
            args.log.scale.push(format!("{sensor}={factor}").parse()?);
        }
    }
    Ok(Some(unit))
}

/// Imports a log that was given in place of a recording, with these `options` of the import.
pub(crate) fn imported_log(
    file: &Path,
    out: &Path,
    options: &LogOptions,
) -> Result<(ImportSummary, ImportOptions)> {
    imported(ImportArgs {
        files: vec![file.to_owned()],
        log: options.clone(),
        sequence: false,
        faces: false,
        x_down: Vec::new(),
        y_down: Vec::new(),
        z_down: Vec::new(),
        format: SampleFormat::Parquet,
        replace: false,
        output: out.to_owned(),
        json: JsonArgs { path: None },
    })
}

/// Size of gravity, m/s², and what is said where it is assumed.
fn gravity_of(args: &ImportArgs, reference: Reference) -> (f64, Option<String>) {
    match (args.log.gravity, args.log.latitude) {
        (Some(gravity), latitude) => {
            let off = latitude.and_then(|at| Warning::of_gravity(gravity, at));
            (gravity, off.map(|w| w.to_string()))
        }
        (None, Some(latitude)) => (normal_gravity(latitude), None),
        (None, None) if reference == Reference::Table => (9.80665, None),
        (None, None) => (9.80665, Some("gravity is assumed to be 9.80665 m/s². It ranges from 9.78 at the equator to 9.83 at the poles, and every scale factor of the accelerometer errs by the same ratio: give --gravity or --latitude".to_string())),
    }
}

/// Takes over what a look at the files has found, where the command leaves it open.
fn take_look(args: &mut ImportArgs, look: &Look, faces: bool) {
    // One list holds for all files that follow one another.
    args.log.columns = look.columns();
    if args.sequence || faces {
        args.log.columns.truncate(1);
    }
    args.log.scale.extend(look.scales.iter().cloned());
    args.log.time_unit = args.log.time_unit.or(look.time_unit());
    args.log.separator = args
        .log
        .separator
        .or(look.files.iter().find_map(|f| f.separator));
}

/// What is said of a rate that is low for an inertial unit, if the unit of the times was guessed.
fn low_rate(summary: &ImportSummary) -> Option<String> {
    let recognised = summary.time.first().filter(|time| time.recognised);
    let unit = recognised.and_then(|time| time.unit)?;
    let rate_hz = summary.sample_rate_hz;
    (rate_hz < SLOW_HZ).then(|| {
        format!("{rate_hz} Hz is a low rate for an inertial unit: if the times are not in {unit}, give their unit (--time-unit)")
    })
}

fn unknown_unit(files: &[PathBuf]) -> Error {
    let remedy = format!(
        "say it: {} --units UNITS, which is count, V, or as g,deg/s",
        typed(files)
    );
    Error::new(
        files[0].display(),
        "the unit of the readings is unknown",
        remedy,
    )
}

/// Makes the recording, and prints nothing. Returns the options that say everything as well.
pub(crate) fn imported(mut args: ImportArgs) -> Result<(ImportSummary, ImportOptions)> {
    let (files, faces) = faces(&args)?;
    let chosen = match (&args.log.preset, args.log.columns.is_empty()) {
        (None, false) => None,
        (named, _) => Preset::choose(*named, &files, args.log.separator)?,
    };
    let logs = files.iter().all(|file| is_log(file));
    let looked = match (
        chosen.is_some() || logs || args.log.means,
        args.log.columns.is_empty(),
    ) {
        (false, true) => look_at(&mut args, &files)?,
        _ => None,
    };
    let by_units = match &looked {
        Some(_) => None,
        None => by_units(&mut args, chosen.as_ref())?,
    };
    let known = args.log.inputs.is_some() || looked.as_ref().is_some_and(Look::has_reference);
    let reference = args
        .log
        .reference
        .unwrap_or(match (args.log.rate_error, known) {
            (Some(_), _) => Reference::TurntableRate,
            (None, true) => Reference::Table,
            (None, false) => Reference::Gravity,
        });
    let (gravity, assumed) = gravity_of(&args, reference);
    let raw_unit = args
        .log
        .raw_unit
        .or(by_units)
        .or(chosen.as_ref().and_then(|chosen| chosen.raw_unit))
        .or(logs.then_some(RawUnit::Si))
        .or(looked.as_ref().and_then(|look| look.raw_unit))
        .ok_or_else(|| unknown_unit(&files))?;
    if let Some(look) = &looked {
        take_look(&mut args, look, !faces.is_empty());
    }
    let options = ImportOptions {
        topics: args.log.topic,
        instance: args.log.instance,
        twos_complements: args.log.twos_complement,
        zeros: args.log.zero,
        step_gap_s: args.log.step_gap,
        turntable: args
            .log
            .rate_error
            .map(|error| Turntable::new(&args.log.rate_dps, error)),
        columns: args.log.columns,
        separator: args.log.separator,
        comments: args.log.comment,
        rate_hz: args.log.rate_hz,
        scales: args.log.scale,
        offsets: args.log.offset,
        signed_low_bytes: args.log.signed_low_byte,
        time_unit: args.log.time_unit,
        device: args.log.device,
        latitude_deg: args.log.latitude,
        inputs: args.log.inputs,
        means: args.log.means,
        sequence: args.sequence,
        faces,
        filters: args.log.filters,
        rows: args.log.rows,
        skip_broken: args.log.skip_broken.unwrap_or_default(),
        trust_readings: args.log.trust_readings,
        format: args.format,
        replace: args.replace,
        ..ImportOptions::new(files, gravity, raw_unit, reference)
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
    let arguments = options.arguments();
    let bar = progress("importing");
    let mut summary = import(&options, &args.output, |share| bar.reach(share))?;
    bar.finish();
    summary.taken = looked.map_or(Vec::new(), |look| look.words());
    summary.arguments = arguments;
    // A gyro alone measures nothing of it.
    summary
        .warnings
        .extend(assumed.filter(|_| !summary.without_accel));
    summary.warnings.extend(low_rate(&summary));
    Ok((summary, options))
}
