//! `mimu accept`: arguments and execution.

mod units;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use mimu::data_sheet::Part;
use mimu::{Calibration, JudgementKind, Prior};
use mimu_recording::result_file::stage;
use mimu_recording::{Error, Result, are_two_units};
use mimu_station::decision::Rule;
use mimu_station::document::{AsFound, Document, Verdict, judged, verdict};
use mimu_station::faces::{Face, by_faces};
use mimu_station::gather::Samples;
use mimu_station::limits::Limits;
use mimu_station::population::Population;
use mimu_station::quantities::{Quantities, measure};
use mimu_station::scale::{Ranges, Scale};

use crate::arguments::{JsonArgs, VerboseArgs, choice, number};
use crate::cmd::device::{duration, side};
use crate::cmd::wizard::TextArgs;
use crate::opening;
use crate::output::{check_outputs, now, print, show};
use crate::reading::LogArgs;
use crate::report::{accept_line, accept_text};
use crate::status::Status;

#[derive(Args)]
pub(crate) struct AcceptArgs {
    /// Recordings of units at rest, or logs that `mimu import` reads; with --faces three of one unit
    #[arg(value_name = "REC|LOG")]
    recordings: Vec<PathBuf>,
    /// Serial port, or tcp://HOST:PORT of a board that writes lines; repeat the option for several boards, which are measured together
    #[arg(long = "port", value_name = "PATH", conflicts_with = "recordings")]
    ports: Vec<String>,
    #[command(flatten)]
    text: TextArgs,
    /// Serial number of the unit; repeated, those of several, in the order of their recordings or ports [default: by recording, board or port]
    #[arg(long = "unit", value_name = "NAME")]
    units: Vec<String>,
    /// Length of the measurement [default: 10s at a port, all of a recording]
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    length: Option<Duration>,
    /// File of the limits (mimu-limits/1) [default: limits of the data sheet of --part]
    #[arg(long, value_name = "FILE.toml")]
    limits: Option<PathBuf>,
    /// Data sheet that limits what the file does not: a name (icm42688p, mpu6050, lsm6dso, lsm6dsv16x, bmi088, bmi270), or a file NAME.toml
    #[arg(long, value_name = "NAME|FILE.toml")]
    part: Option<String>,
    /// Units of the same kind (`mimu fleet DIR --prior FILE`), which limit what the file does not: offsets and sensitivities that all but one in a thousand of
    /// them have
    #[arg(long, value_name = "FILE.toml", conflicts_with = "calibration")]
    prior: Option<PathBuf>,
    /// Ranges that the sensors are set to, g and deg/s: 16,2000; they say what a count is; `-` for a sensor that the unit lacks
    #[arg(long, value_name = "G,DEG/S", allow_hyphen_values = true, value_parser = ranges)]
    range: Option<Ranges>,
    /// Side that has to be up: +x, -x, +y, -y, +z, -z; the limits of `tilt` are about it
    #[arg(long, value_name = "SIDE", allow_hyphen_values = true, value_parser = |t: &str| side(t).map(|_| t.to_owned()))]
    up: Option<String>,
    /// Which values pass [default: that of the limits, or guarded]
    #[arg(long, value_parser = choice(&[
        ("guarded", "Values that are k standard uncertainties within their limits (k of the file, or 2)", Rule::Guarded),
        ("simple", "Values within their limits", Rule::Simple),
    ]))]
    decision: Option<Rule>,
    /// Three sides up, one after the other: offsets and sensitivities of the accelerometer's axes
    #[arg(long)]
    faces: bool,
    /// With --faces: how level a side is to the chip's axis, degrees, one standard deviation
    #[arg(long, value_name = "DEG", default_value_t = 0.5, requires = "faces", value_parser = |t: &str| number(t, 0.0, 10.0))]
    level: f64,
    /// Calibration of the unit, through which it is measured: as left
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Calibration that the unit came with: the measurements through it are reported beside the others, as found
    #[arg(long, value_name = "FILE", requires = "calibration")]
    as_found: Option<PathBuf>,
    /// Folder for one JSON file for each unit, UNIT-TIME.json
    #[arg(short, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
    #[command(
        flatten,
        next_help_heading = "Gravity, and a log in place of a recording"
    )]
    log: LogArgs,
}

fn ranges(text: &str) -> std::result::Result<Ranges, String> {
    let wrong = || {
        "write two ranges, of the accelerometer in g and of the gyro in deg/s: 16,2000".to_string()
    };
    let (g, dps) = text.split_once(',').ok_or_else(wrong)?;
    let positive = |text: &str| match text.trim().parse::<f64>() {
        _ if text.trim() == "-" => Ok(None),
        Ok(range) if range > 0.0 && range.is_finite() => Ok(Some(range)),
        _ => Err(wrong()),
    };
    Ok(Ranges {
        accel_g: positive(g)?,
        gyro_dps: positive(dps)?,
    })
}

/// No unit passes through a calibration that is judged a misfit; with one whose errors are unexplained or suspect, a warning says so.
///
/// # Errors
/// A misfit.
fn check_judgement(calibration: &Calibration, path: &Path) -> Result<()> {
    let Some(judgement) = &calibration.judgement else {
        return Ok(());
    };
    if let Some(why) = judgement.needs_consent() {
        return Err(Error::new(
            path.display(),
            format!("no unit is accepted through it, because {why}"),
            "calibrate the unit again",
        ));
    }
    if judgement.kind > JudgementKind::Untested {
        eprintln!("warning: the calibration is judged {judgement}");
    }
    Ok(())
}

/// What all units are judged by.
struct Station<'a> {
    args: &'a AcceptArgs,
    limits: Limits,
    part: Option<Part>,
    calibration: Option<Calibration>,
    as_found: Option<Calibration>,
    time: String,
}

/// A unit before its measurement: its serial number if it is given, and where its samples are from.
struct Source {
    name: Option<String>,
    places: Vec<String>,
}

impl<'a> Station<'a> {
    fn of(args: &'a AcceptArgs) -> Result<Self> {
        let mut limits = match &args.limits {
            Some(path) => Limits::read(path)?,
            None => Limits::default(),
        };
        limits.up = args.up.clone().or(limits.up);
        limits.ranges = args.range.or(limits.ranges);
        limits.decision = args.decision.unwrap_or(limits.decision);
        let part = args.part.as_deref().or(limits.part.as_deref());
        let part = part.map(Part::find).transpose()?;
        if let Some(path) = &args.prior {
            limits.population = Some(Population {
                prior: Prior::read(path)?,
                place: path.display().to_string(),
            });
        }
        if args.limits.is_none() && part.is_none() && limits.population.is_none() {
            let problem = "nothing says which values pass";
            let remedy = "give --limits FILE, the data sheet, --part icm42688p, or the units of the same kind, --prior FILE";
            return Err(Error::new("accept", problem, remedy));
        }
        let read = |path: &Option<PathBuf>| path.as_deref().map(opening::calibration).transpose();
        let calibration = read(&args.calibration)?;
        if let (Some(of), Some(path)) = (&calibration, &args.calibration) {
            check_judgement(of, path)?;
        }
        Ok(Self {
            args,
            limits,
            part,
            calibration,
            as_found: read(&args.as_found)?,
            time: now(),
        })
    }

    /// The result for a unit, and why it could not be measured.
    fn judge(&self, source: &Source, samples: Result<Vec<Samples>>) -> (Document, Option<Error>) {
        let unit = match &samples {
            Ok(samples) => &samples[0].unit,
            Err(_) => source.name.as_ref().unwrap_or(&source.places[0]),
        };
        let places = source.places.clone();
        let part = self.part.as_ref();
        let document = Document::new(unit, places, &self.time, &self.limits, part);
        match samples.and_then(|samples| self.measured(document.clone(), &samples)) {
            Ok(document) => (document, None),
            Err(error) => (document.refused(&error), Some(error)),
        }
    }

    fn measured(&self, document: Document, samples: &[Samples]) -> Result<Document> {
        let (limits, part) = (&self.limits, self.part.as_ref());
        for of in [&self.calibration, &self.as_found].into_iter().flatten() {
            let (name, unit) = (&of.device, &samples[0].unit);
            if are_two_units(name, unit) {
                eprintln!("warning: {unit} is measured through a calibration of {name}");
            }
        }
        let (found, scale) = self.quantities(samples, self.calibration.as_ref())?;
        let mut document = document.judge(&found, &samples[0], limits, part, &scale)?;
        if let (Some(calibration), Some(path)) = (&self.as_found, &self.args.as_found) {
            let (found, scale) = self.quantities(samples, Some(calibration))?;
            let measurements = judged(&found, &samples[0], limits, part, &scale)?;
            document.as_found = Some(AsFound {
                calibration: path.display().to_string(),
                verdict: verdict(&measurements),
                measurements,
            });
        }
        Ok(document)
    }

    /// What the rests of a unit show through a calibration or by its nominal scale. Of three, the one with the expected side up is judged, or else the first;
    /// together they give offsets and sensitivities.
    fn quantities(
        &self,
        samples: &[Samples],
        calibration: Option<&Calibration>,
    ) -> Result<(Quantities, Scale)> {
        let (limits, part) = (&self.limits, self.part.as_ref());
        let scale = Scale::of(&samples[0], calibration, limits.ranges.as_ref(), part)?;
        let up = limits.up.as_deref();
        let first = &samples[0];
        if samples.len() == 1 {
            return Ok((measure(first, &scale, up)?, scale));
        }
        let sides = samples.iter().map(|s| measure(s, &scale, None));
        let mut sides: Vec<Quantities> = sides.collect::<Result<_>>()?;
        let faces = sides.iter().map(|of| {
            let [force, variance] = of.force.ok_or_else(|| {
                let problem = "the unit has no accelerometer, whose offsets three sides would show";
                Error::new(&first.place, problem, "leave --faces out")
            })?;
            Ok(Face { force, variance })
        });
        let faces: Vec<Face> = faces.collect::<Result<_>>()?;
        let [x, y, z] = faces.as_slice() else {
            let problem = format!("{} sides were measured", faces.len());
            return Err(Error::new(&first.place, problem, "measure three"));
        };
        let by_faces = by_faces(&[*x, *y, *z], first.gravity, self.args.level, &first.place)?;
        let judged = sides.iter().position(|side| side.up.as_deref() == up);
        let mut found = sides.swap_remove(judged.unwrap_or(0));
        found.measured.extend(by_faces);
        Ok((found, scale))
    }

    /// Prints and stores the result of one of `several` units.
    fn report(&self, document: &Document, several: bool) -> Result<()> {
        let file = self.args.output.as_ref().map(|folder| {
            let plain = |c: char| {
                if c.is_alphanumeric() || "-_.".contains(c) {
                    c
                } else {
                    '-'
                }
            };
            let unit: String = document.unit.chars().map(plain).collect();
            let time = self.time.replace(':', "");
            // The same unit may be measured twice by one command.
            let numbered = (2..).map(|k| format!("{unit}-{time}-{k}.json"));
            let names = std::iter::once(format!("{unit}-{time}.json")).chain(numbered);
            let mut paths = names.map(|name| folder.join(name));
            let path = paths.find(|path| !path.exists()).unwrap_or_default();
            let text = serde_json::to_string_pretty(document)
                .map_err(|e| Error::new(path.display(), e, "report this error"))?;
            stage(&path, text + "\n")
        });
        let file = file.transpose()?;
        if several {
            if let Some(file) = file {
                file.publish()?;
            }
            let mut text = accept_line(document);
            if self.args.verbose.verbose {
                text += &accept_text(document, true);
            }
            return show(&text);
        }
        let text = accept_text(document, self.args.verbose.verbose);
        print(&self.args.json, &text, document, file)
    }
}

pub(crate) fn run(args: &AcceptArgs) -> Result<Status> {
    check_outputs(&[args.json.file()], None::<&Path>)?;
    let station = Station::of(args)?;
    let (mut failed, mut refused) = (false, Vec::new());
    let several = args.several();
    if several && args.json.is_given() {
        let problem = "a file of measurements is about one unit, and there are several";
        return Err(Error::new(
            "--json",
            problem,
            "give a folder for one file each: -o DIR",
        ));
    }
    let mut count = 0;
    args.for_each(|source, samples| {
        let (document, error) = station.judge(source, samples);
        count += 1;
        failed |= document.verdict == Verdict::Failed;
        refused.extend(error);
        station.report(&document, several)
    })?;
    match (refused.len(), several) {
        (0, _) if failed => Ok(Status::Rejected),
        (0, _) => Ok(Status::Done),
        (_, false) => Err(refused.remove(0)),
        (n, true) => Err(Error::undetermined(
            "station",
            format!("{n} of {count} units could not be measured"),
            "see their lines, and measure them again",
        )),
    }
}
