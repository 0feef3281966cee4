//! `mimu report`: arguments and execution.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use clap::Args;
use mimu::calibration::verify::{Verification, WholeTurnsOfAxis, verify};
use mimu::diagnosed::{Diagnosed, diagnosed};
use mimu::{Calibration, DataSheet, OfRecording, Prepared, Recordings};
use mimu_body::{Body, Options};
use mimu_recording::result_file::stage;
use mimu_recording::{Error, Recording, Result};

use crate::arguments::{KeepArgs, NoiseArgs, PartArgs, StillArgs, WholeTurnArgs, with_noise};
use crate::hint::OF_A_LOG;
use crate::opening;
use crate::output::{now, progress, show};
use crate::overwriting::check_overwritten;
use crate::reading::{LogArgs, read_samples};
use crate::report::refused;
use crate::report::{Made, Particulars, UnitReport, problems_text, unit_page};

#[derive(Args)]
pub struct ReportArgs {
    /// Folder of a wizard session, or recordings of one unit
    #[arg(value_name = "SESSION|REC", required_unless_present = "calibration")]
    folders: Vec<PathBuf>,
    /// Other recordings of the unit, for judging only
    #[arg(long, value_name = "REC")]
    verify: Vec<PathBuf>,
    /// Calibration to show [default: that of the session, or a new fit of the recordings]
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Page to write
    #[arg(short = 'o', long = "out", value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    part: PartArgs,
    #[command(flatten)]
    whole: WholeTurnArgs,
    /// Head the page as a calibration certificate: the file states laboratory, customer, item and dates (docs/report.md)
    #[arg(long, value_name = "FILE")]
    certificate: Option<PathBuf>,
    #[command(flatten, next_help_heading = OF_A_LOG)]
    log: LogArgs,
}

/// Sources of a page.
struct Inputs {
    recordings: Vec<PathBuf>,
    verify: Vec<PathBuf>,
    calibration: Option<PathBuf>,
}

impl Inputs {
    /// Inputs from the arguments. A session lists its inputs in its folder.
    fn of(args: &ReportArgs) -> Result<Self> {
        let mut inputs = Self {
            recordings: Vec::new(),
            verify: args.verify.clone(),
            calibration: args.calibration.clone(),
        };
        for folder in &args.folders {
            if !folder.join("session.json").is_file() {
                inputs.recordings.push(folder.clone());
                continue;
            }
            let there = |name: &str| Some(folder.join(name)).filter(|path| path.exists());
            let Some(calibration) = there("calibration") else {
                return Err(Error::new(
                    folder.display(),
                    "this session has no recording yet",
                    "continue it: mimu wizard -o FOLDER",
                ));
            };
            inputs.recordings.push(calibration);
            inputs.verify.extend(there("verification"));
            inputs.verify.extend(there("confirmation"));
            let made = there("with-effects.toml").or_else(|| there("calibration.toml"));
            inputs.calibration = inputs.calibration.or(made);
        }
        Ok(inputs)
    }
}

pub fn run(args: &ReportArgs, command_line: &str) -> Result<()> {
    let part = args.part.part()?;
    let particulars = args.certificate.as_deref().map(Particulars::read);
    let particulars = particulars.transpose()?;
    let inputs = Inputs::of(args)?;
    let outputs = [Some(args.out.as_path())];
    check_overwritten(&outputs)?;
    let others = [&args.noise.file, &inputs.calibration, &args.certificate];
    let others = others.map(Option::as_deref);
    let noise = args.noise.read()?;
    // Of the first recording, whose body the page shows.
    let samples = RefCell::new(None);
    let open = |path: &PathBuf| -> Result<(String, Prepared)> {
        let read = read_samples(path, &args.log, args.still.search(), &outputs, &others)?;
        let prepared = read.0;
        samples.borrow_mut().get_or_insert(read.1);
        let prepared = args.whole.apply(with_noise(prepared, noise.as_ref())?)?;
        let prepared = args.keep.apply(prepared);
        Ok((path.display().to_string(), prepared))
    };
    let recordings: Vec<_> = inputs.recordings.iter().map(open).collect::<Result<_>>()?;
    let others: Vec<_> = inputs.verify.iter().map(open).collect::<Result<_>>()?;
    let now = now();
    let found = match recordings.is_empty() {
        true => None,
        false => {
            let all = || recordings.iter().chain(&others);
            let done = found(&recordings, &others, &now);
            let refused = |_: &Error| {
                let problems: Vec<_> = all().flat_map(|r| OfRecording::prepared(&r.1)).collect();
                refused(&problems, all().count() > 1);
            };
            Some(done.inspect_err(refused)?)
        }
    };
    let calibration = match (&inputs.calibration, &found) {
        (Some(path), _) => opening::calibration(path)?,
        (None, Some(found)) => with_body(found, samples.take(), &now)?,
        // The arguments require one of the two.
        (None, None) => return Ok(()),
    };
    let mut verified = Vec::new();
    let mut not_judged = Vec::new();
    for (name, prepared) in &others {
        match verify(prepared, &calibration) {
            Ok(result) => verified.push((name.clone(), result)),
            Err(why) => not_judged.push(format!("{name}: {why}")),
        }
    }
    let whole_turns = whole_turns(&recordings, args, &calibration, &verified);
    let file = inputs.calibration.as_deref().map(Path::display);
    let file = file.map(|path| path.to_string());
    let sheet = part.map(|part| DataSheet::of(&calibration, noise.as_ref(), &part));
    let unit = UnitReport {
        diagnosis: found.as_ref().map(|found| &found.result),
        recordings: &recordings,
        calibration: &calibration,
        calibration_file: file.as_deref(),
        verified: &verified,
        whole_turns: &whole_turns,
        not_judged: &not_judged,
        noise: noise.as_ref(),
        data_sheet: sheet.as_ref(),
        particulars: particulars.as_ref(),
    };
    let made = Made::of(&inputs.recordings, command_line);
    stage(&args.out, unit_page(&unit, &made))?.publish()?;
    let verdict = verdict(&unit);
    show(&format!("{verdict}page: {}\n", args.out.display()))
}

/// The calibration that was found, with the further triads of its first recording.
fn with_body(found: &Diagnosed, first: Option<Recording>, created: &str) -> Result<Calibration> {
    let mut made = found.calibration(created)?;
    let before = &found.diagnosis.before;
    let body = first.map(|first| Body::of(&first, before, &Options::default()));
    let raw = before.prepared.manifest.raw_unit;
    let body = body.transpose()?.flatten();
    made.body = body.iter().flat_map(|body| body.tables(raw)).collect();
    Ok(made)
}

/// The whole turns in recordings: name, whether the calibration was made from it, and degrees for each turn about each axis.
type WholeTurns = Vec<(String, bool, Vec<WholeTurnsOfAxis>)>;

fn whole_turns(
    recordings: &[(String, Prepared)],
    args: &ReportArgs,
    calibration: &Calibration,
    verified: &[(String, Verification)],
) -> WholeTurns {
    let mut all = Vec::new();
    for (name, prepared) in recordings {
        // Only for its whole turns: a recording does not judge what was made from it.
        let turned = prepared
            .manifest
            .whole_turns
            .map(|_| verify(prepared, calibration));
        let turned = turned.and_then(Result::ok).map(|v| v.whole_turns);
        all.extend(turned.map(|turned| (name.clone(), args.calibration.is_none(), turned)));
    }
    let others = verified.iter();
    all.extend(others.map(|(name, v)| (name.clone(), false, v.whole_turns.clone())));
    all.retain(|(.., turned)| !turned.is_empty());
    all
}

/// What is printed of a unit.
fn verdict(unit: &UnitReport) -> String {
    match unit.diagnosis {
        Some(d) => {
            problems_text(&d.recording_problems, d.has_several(), false)
                + &format!(
                    "{}: {}\njudgement: {}\n",
                    d.device,
                    d.verdict.name(),
                    d.judgement
                )
        }
        None => match &unit.calibration.judgement {
            Some(judgement) => format!("{}\njudgement: {judgement}\n", unit.calibration.device),
            None => format!("{}\n", unit.calibration.device),
        },
    }
}

/// The diagnosis of the recordings. An effect that the first verification recording contradicts is not accepted.
fn found(
    recordings: &[(String, Prepared)],
    others: &[(String, Prepared)],
    created: &str,
) -> Result<Diagnosed> {
    let mut all = recordings.iter().map(|r| r.1.clone());
    let first = all.next().ok_or_else(|| {
        Error::new(
            "recordings",
            "there are none",
            "name the recording of the unit",
        )
    })?;
    let recordings = Recordings {
        first,
        more: all.collect(),
        second: others.first().map(|r| r.1.clone()),
        given: None,
    };
    let bar = progress("diagnosing");
    let done = diagnosed(recordings, [None, None], created, &|share| bar.reach(share));
    bar.finish();
    done
}
