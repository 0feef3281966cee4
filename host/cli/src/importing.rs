//! Imports: of `mimu import`, and of logs that other commands take in place of a recording.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::{Args, CommandFactory};
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::look::{Given, Look};
use mimu_recording::{
    Chosen, Column, ColumnList, Face, ImportOptions, ImportSummary, LogOptions, Preset, RawUnit,
    Reference, Role, SampleFormat, Scale, TriadKind, TriadName, import, is_log, log_formats,
};

use crate::Cli;
use crate::arguments::{JsonArgs, assumed_gravity, known_gravity};
use crate::output::{check_outputs, progress, quoted};

#[derive(Args)]
pub(crate) struct ImportArgs {
    #[arg(required_unless_present = "faces", help = files_help())]
    files: Vec<PathBuf>,
    #[command(flatten)]
    log: LogOptions,
    /// The files follow one another, like those of six faces: each is a dwell with the name of its file; one list of columns applies to all
    #[arg(long, conflicts_with_all = ["means", "step_gap_s"])]
    sequence: bool,
    /// One file for each face, named with the axis that was up: `--faces +x=a.csv -x=b.csv +y=c.csv -y=d.csv +z=e.csv -z=f.csv`; with
    /// --reference table the faces give the specific forces
    #[arg(long, conflicts_with_all = ["means", "sequence", "inputs", "step_gap_s"])]
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

fn files_help() -> String {
    format!(
        "Text files (any separator), Parquet, logs of {}, or the folder of a preset; later files are interpolated at the times of the first",
        log_formats()
    )
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

/// Looks at files whose columns or units nobody has named, and asks on a terminal about what they do not show.
///
/// # Errors
/// What is still open, all at once, with the command to complete.
fn look_at(args: &mut ImportArgs, files: &[PathBuf]) -> Result<Look> {
    loop {
        let look = look(args, files)?;
        let Some(refusal) = look.refusal(&files[0], &typed(files)) else {
            return Ok(look);
        };
        let person = std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
        if !person || !ask(args, &look)? {
            return Err(refusal);
        }
    }
}

/// Asks about everything that `look` leaves open, and puts the answers into `args`. False if the person gives none.
fn ask(args: &mut ImportArgs, look: &Look) -> Result<bool> {
    let io = |error: std::io::Error| Error::io(Path::new("terminal"), &error);
    for question in &look.questions {
        let (setting, choice) = (question.setting, &question.value);
        eprintln!("{}", question.about);
        eprint!("{} ({choice}): ", setting.flags());
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).map_err(io)?;
        let answer = answer.trim();
        if answer.is_empty() {
            return Ok(false);
        }
        match setting {
            Argument::Units => {
                args.log.units = Some(args.log.units.unwrap_or_default().and(answer)?);
            }
            Argument::SampleRate => {
                let number = answer.trim_end_matches("Hz").trim().parse();
                let problem = format!("{answer:?} is no number");
                let refused = |_| Error::new("--rate-hz", problem, "write samples a second");
                args.log.rate_hz = Some(number.map_err(refused)?);
            }
            Argument::Columns => {
                args.log.columns.push(answer.parse()?);
                let separator = look.files.iter().find_map(|file| file.separator);
                args.log.separator = args.log.separator.or(separator);
            }
            Argument::TimeUnit => args.log.time_unit = Some(answer.parse()?),
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
    let given = Given {
        units: args.log.units.unwrap_or_default(),
        // A factor may also come before the unit: twice the readings in deg/s.
        raw_unit: args.log.raw_unit.is_some() || converted || scaled && args.log.units.is_none(),
        rate: args.log.rate_hz.is_some(),
        time_unit: args.log.time_unit,
    };
    // Files of a sequence are alike; joined ones are looked at together.
    let together = match args.sequence || args.faces {
        true => &files[..files.len().min(1)],
        false => files,
    };
    Look::with_columns(together, &args.log.columns, args.log.separator, &given)
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
    let (unit, factors) = units.conversion()?;
    for (kind, factor) in [TriadKind::Gyro, TriadKind::Accel].into_iter().zip(factors) {
        let Some(factor) = factor.filter(|factor| *factor != 1.0) else {
            continue;
        };
        let first = TriadName::first(kind);
        let roles = args.log.columns.iter().flat_map(ColumnList::roles);
        let triads = roles.filter_map(|role| match role {
            Role::Column(Column::More(triad, 0)) if triad.kind == kind => Some(triad),
            _ => None,
        });
        let triads: Vec<TriadName> = [first].into_iter().chain(triads).collect();
        for triad in triads {
            args.log.scale.push(format!("{triad}={factor}").parse()?);
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
    let known = known_gravity(args.log.gravity_mps2, args.log.latitude_deg);
    known.unwrap_or_else(|| {
        let (gravity, said) = assumed_gravity();
        (gravity, said.filter(|_| reference != Reference::Table))
    })
}

/// Takes over what a look at the files has found, where the command leaves it open.
fn take_look(args: &mut ImportArgs, look: &Look, faces: bool) {
    if args.log.columns.is_empty() {
        args.log.columns = look.columns();
    }
    // One list holds for all files that follow one another.
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
    let unit_given = args.log.units.is_some() || args.log.raw_unit.is_some();
    let to_look_at = args.log.columns.is_empty() || !unit_given;
    let looked = match chosen.is_some() || logs || args.log.means || !to_look_at {
        false => Some(look_at(&mut args, &files)?),
        true => None,
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
        log: args.log,
        sequence: args.sequence,
        faces,
        format: args.format,
        replace: args.replace,
        ..ImportOptions::new(files, gravity, raw_unit, reference)
    };
    let options = match chosen {
        Some(chosen) => options.with_preset(chosen),
        None => options,
    };
    let inputs = options.files.iter().chain(&options.log.inputs);
    check_outputs(&[args.json.file()], inputs)?;
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
