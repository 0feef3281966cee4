//! `mimu fit`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use mimu::fit::{Fit, Options, fit_or_faces};
use mimu::in_use::Trajectory;
use mimu::result::fit::{DwellResult, FitResult};
use mimu::result::sessions::SessionsResult;
use mimu::sessions::class::PartClass;
use mimu::sessions::{Sessions, fit_determined};
use mimu::{
    Calibration, DataSheet, Dwell, DwellSearch, Judgement, NoiseFile, OfRecording, PerSensor,
    Prepared, Prior, Sensor,
};
use mimu_body::result::BodyResult;
use mimu_body::{Body, Options as BodyOptions};
use mimu_recording::{Error, MANIFEST_FILE, Recording, ReferenceError, Result};
use serde::Serialize;

use super::trajectory::{self, TrajectoryArgs};
use crate::arguments::{
    JsonArgs, KeepArgs, NoiseArgs, PartArgs, StillArgs, StrictArgs, VerboseArgs, WholeTurnArgs,
    WritingArgs, choice, sensor, with_noise,
};
use crate::hint::OF_A_LOG;
use crate::output::{Results, check_outputs, now};
use crate::reading::{LogArgs, open, read_with_samples};
use crate::report;
use crate::report::budget::budget_text;
use crate::report::data_sheet::{WithDataSheet, data_sheet_text};
use crate::report::{Joined, refused};
use crate::status::Status;

/// Arguments of `mimu fit`.
#[derive(Args)]
pub struct FitArgs {
    /// Recording, of samples or of means, or a log that `mimu import` reads. Several are sessions of one unit, in the order in which they took place
    ///
    /// One calibration is then made from all, with two intervals for each parameter: of the expected value, and of what the next power-on makes of it.
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// For one or two sessions: how much the parameters of this class of parts change from one power-on to the next [default for two: consumer]
    #[arg(long, value_parser = choice(&[
        ("consumer", "Digital units of phones and drones", PartClass::Consumer),
        ("tactical", "Units of a few degrees per hour", PartClass::Tactical),
    ]))]
    class: Option<PartClass>,
    /// Hold out N contiguous blocks in turn, refit without each, and report the error on it
    #[arg(long, value_name = "blocks=N", default_value = "blocks=4", value_parser = holdout)]
    holdout: usize,
    /// Calibrate one sensor only, if the experiment does not determine the other
    #[arg(long, value_parser = sensor(), value_name = "SENSOR")]
    only: Option<Sensor>,
    /// How well the true inputs are known, in place of what the recording states: tilt of a table, right angles, rate, gravity (docs/table.md)
    ///
    /// The errors enter the intervals, and a table shows their share of the variance of each parameter.
    #[arg(long, value_name = "FILE")]
    reference_error: Option<PathBuf>,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    whole: WholeTurnArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    /// Population of the unit's kind (`mimu fleet --prior`), which determines what the poses leave open
    ///
    /// With it six poses by hand suffice. If the data contradict it, a warning says so, and the prior is given up for the sensor.
    #[arg(long, value_name = "FILE", conflicts_with = "class")]
    prior: Option<PathBuf>,
    /// Size of the Earth's field at the place, µT, for a recording with a magnetometer; without it the field counts as 1
    #[arg(long, value_name = "UT")]
    field: Option<f64>,
    #[command(flatten)]
    trajectory: TrajectoryArgs,
    #[command(flatten)]
    part: PartArgs,
    /// List the dwells
    #[arg(long)]
    dwells: bool,
    /// Calibration file to write
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
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

fn holdout(text: &str) -> std::result::Result<usize, String> {
    let count = text.strip_prefix("blocks=").unwrap_or(text);
    match count.parse() {
        Ok(1) => Err(
            "with one block nothing remains to be fitted: write at least 2, or 0 for none".into(),
        ),
        Ok(n) if n <= 1000 => Ok(n),
        _ => Err("write blocks=N with N from 2 to 1000, or blocks=0 for none".into()),
    }
}

/// What to do about readings that no calibration describes.
const CHECK: &str =
    "check range, columns and unit of the readings and record again, or write it all the same";

pub(crate) fn run(args: &FitArgs) -> Result<Status> {
    // Before anything is computed: a part that is not known, and a file that would be replaced.
    args.part.part()?;
    let new = args.output.as_deref();
    // One that is an input is refused as such.
    let new = new.filter(|new| !args.recordings.iter().any(|r| new.starts_with(r)));
    args.writing.check(new)?;
    if let (Some(prior), [_, second, ..]) = (&args.prior, &args.recordings[..]) {
        return Err(Error::new(
            prior.display(),
            format!(
                "a prior is used for one session, and {} is another",
                second.display()
            ),
            "leave --prior out: several sessions determine a unit without it",
        ));
    }
    let by = args.trajectory.read_all(args.recordings.len())?;
    if !by.is_empty() {
        return beside(args, by);
    }
    match (&args.recordings[..], args.class) {
        ([recording], None) => one(args, recording),
        _ => several(args),
    }
}

impl FitArgs {
    fn options(&self) -> Options {
        Options {
            holdout_blocks: self.holdout,
            only: self.only,
        }
    }

    fn body(&self) -> BodyOptions {
        BodyOptions {
            field_ut: self.field,
        }
    }

    /// The further triads of a recording whose gyro and accelerometer have this fit.
    fn further(&self, samples: Option<&Recording>, fit: &Fit) -> Result<Option<Body>> {
        let Some(samples) = samples else {
            return Ok(None);
        };
        let judgement = FitResult::of(fit).judgement;
        // Beside a first triad that its calibration makes worse, the readings themselves are the better reference.
        match judgement.needs_consent().is_some() && fit.prepared.is_in_si() {
            true => Body::of_readings(samples, &fit.prepared.dwells.list, &self.body()),
            false => Body::of(samples, fit, &self.body()),
        }
    }

    fn class(&self) -> PartClass {
        self.class.unwrap_or(PartClass::Consumer)
    }

    /// `prepared`, with all that the arguments state.
    fn complete(&self, prepared: Prepared, noise: Option<&NoiseFile>) -> Result<Prepared> {
        let prepared = self.keep.apply(with_noise(prepared, noise)?);
        let prepared = self.whole.apply(prepared)?;
        let prepared = match &self.reference_error {
            Some(file) => prepared.with_reference_error(ReferenceError::read(file)?),
            None => prepared,
        };
        let prior = self.prior.as_deref().map(Prior::read).transpose()?;
        match prior {
            Some(prior) => prepared.with_prior(Arc::new(prior)),
            None => Ok(prepared),
        }
    }

    /// The fit of the recording of these `samples` that `open` reads, without the list of dwells after a refusal.
    ///
    /// # Errors
    /// The recording, or a file of the arguments, is refused; the recording does not determine the calibration.
    pub fn fitted(
        &self,
        (open, samples): (&Open, Option<&Recording>),
        noise: Option<&NoiseFile>,
    ) -> Result<FitMade> {
        self.part.part()?;
        let prepared = self.complete(open(self.still.search())?, noise)?;
        let fit = fit_or_faces(prepared, self.options())?;
        let body = self.further(samples, &fit)?;
        let raw = fit.prepared.manifest.raw_unit;
        let mut calibration = Calibration::of(&fit, &[], &now())?;
        calibration.body = body.iter().flat_map(|body| body.tables(raw)).collect();
        let sheet = self
            .part
            .part()?
            .map(|part| DataSheet::of(&calibration, noise, &part));
        Ok(FitMade {
            result: FitResult::of(&fit),
            fit,
            body: body.map(|body| BodyResult::of(&body, raw)),
            calibration,
            sheet,
        })
    }

    /// One calibration of the sessions that these read.
    ///
    /// # Errors
    /// As of [`Self::fitted`], or the sessions are not of one unit.
    pub fn combined(
        &self,
        open: &[(Box<Open>, Option<&Recording>)],
        noise: Option<&NoiseFile>,
    ) -> Result<SessionsMade> {
        let mut made = Vec::new();
        for (open, samples) in open {
            let prepared = self.complete(open(self.still.search())?, noise)?;
            let fit = fit_determined(prepared, self.options())?;
            made.push((self.further(*samples, &fit)?, fit));
        }
        SessionsMade::of(made, self.class())
    }
}

/// Reads a recording, with its dwells found as an argument says.
pub type Open = dyn Fn(DwellSearch) -> Result<Prepared> + Send;

/// A fit, and what the command prints of it.
pub struct FitMade {
    /// The fit.
    pub fit: Fit,
    /// Its result.
    pub result: FitResult,
    /// The calibration that it gives.
    pub calibration: Calibration,
    body: Option<BodyResult>,
    sheet: Option<DataSheet>,
}

/// One calibration of several sessions.
pub struct SessionsMade {
    sessions: Sessions,
    /// Its result.
    pub result: SessionsResult,
    /// The calibration that it gives.
    pub calibration: Calibration,
    judgement: Judgement,
    /// The further triads of all.
    pub body: Option<BodyResult>,
}

impl SessionsMade {
    /// Of the fits of the sessions, with the further triads of those that have any.
    fn of(made: Vec<(Option<Body>, Fit)>, class: PartClass) -> Result<Self> {
        let (bodies, fits): (Vec<Option<Body>>, Vec<Fit>) = made.into_iter().unzip();
        let sessions = Sessions::combine(fits, class)?;
        let combined = Calibration::of_sessions(&sessions, &now())?;
        let result = SessionsResult::of(&sessions, &combined);
        // A session that contradicts the others has no say in the further triads either.
        let used = bodies.into_iter().zip(&sessions.used);
        let used: Vec<Body> = used.filter(|of| *of.1).filter_map(|of| of.0).collect();
        let body = (!used.is_empty()).then(|| Body::combined(&used));
        let raw = sessions.fits[0].prepared.manifest.raw_unit;
        let mut calibration = combined.calibration;
        calibration.body = body.iter().flat_map(|body| body.tables(raw)).collect();
        Ok(Self {
            body: body.map(|body| BodyResult::of(&body, raw)),
            judgement: combined.judgement,
            sessions,
            result,
            calibration,
        })
    }

    /// Its result as JSON.
    pub fn json(&self) -> impl Serialize {
        Joined::of(&self.result, self.body.as_ref())
    }

    /// What the command prints.
    pub fn text(&self, verbose: bool) -> String {
        let mut text = report::sessions_text(&self.result, verbose);
        text.extend(self.body.as_ref().map(report::body_text));
        text
    }
}

impl FitMade {
    /// Its result as JSON.
    pub fn json(&self) -> impl Serialize {
        WithDataSheet {
            result: Joined::of(&self.result, self.body.as_ref()),
            data_sheet: self.sheet.as_ref(),
        }
    }

    /// What the command prints.
    pub fn text(&self) -> String {
        let mut text = report::fit_text(&self.result, false) + &budget_text(&self.result);
        text.extend(self.body.as_ref().map(report::body_text));
        text.extend(self.sheet.as_ref().map(data_sheet_text));
        text
    }
}

/// Reads and prepares a recording as the arguments say.
fn prepared(args: &FitArgs, recording: &Path) -> Result<(Prepared, Option<Recording>)> {
    let outputs = [args.output.as_deref(), args.json.file()];
    let inputs = [args.noise.file.as_deref(), args.prior.as_deref()];
    let search = args.still.search();
    let (prepared, samples) = read_with_samples(recording, &args.log, search, &outputs, &inputs)?;
    args.writing.check(args.output.as_deref())?;
    let prepared = args.complete(prepared, args.noise.read()?.as_ref())?;
    Ok((prepared, samples))
}

/// Fits a recording. After a refusal the user first needs the list of dwells; the error line comes last.
fn fitted(
    args: &FitArgs,
    prepared: Prepared,
    by: fn(Prepared, Options) -> Result<Fit>,
) -> Result<Fit> {
    let shown = Refused::of(&prepared);
    by(prepared, args.options()).inspect_err(|_| shown.print())
}

/// What is shown of a recording that is refused.
struct Refused(Vec<DwellResult>, Vec<OfRecording>);

impl Refused {
    fn of(prepared: &Prepared) -> Self {
        Self(DwellResult::list(prepared), OfRecording::prepared(prepared))
    }

    fn print(&self) {
        refused(&self.1, false);
        eprint!("{}", report::dwell_table(&self.0));
    }
}

/// The further triads of a recording whose gyro and accelerometer are not determined, for the reason `why`, and are taken as they read.
///
/// # Errors
/// `why`, if there are none, or the readings are not in SI.
fn body_alone(
    args: &FitArgs,
    samples: Option<&Recording>,
    dwells: &[Dwell],
    why: Error,
) -> Result<Status> {
    let body = samples.map(|samples| Body::of_readings(samples, dwells, &args.body()));
    let body = body.transpose()?.flatten();
    for (triad, judgement) in body.iter().flat_map(|body| &body.refused) {
        eprintln!(
            "{triad} beside readings in SI is not calibrated: {}",
            judgement.reason
        );
    }
    let body = body.filter(|body| !body.triads.is_empty());
    let Some((samples, body)) = samples.zip(body) else {
        return Err(why);
    };
    let manifest = &samples.manifest;
    let raw = manifest.raw_unit;
    let (more, judgement) = (BodyResult::of(&body, raw), body.judgement());
    let text = format!(
        "{}: gyro and accelerometer are taken as they read: {why}\n{}",
        samples.place,
        report::body_text(&more)
    );
    let head = serde_json::json!({
        "format": "mimu-fit/1",
        "device": manifest.device,
        "judgement": judgement,
        "not_calibrated": why.to_string(),
        "raw_unit": raw,
    });
    let all = Joined::of(&head, Some(&more));
    let made = || {
        let as_read = PerSensor::from_fn(|_| None);
        Calibration::of_body(
            manifest,
            as_read,
            body.tables(raw),
            judgement.clone(),
            &now(),
        )
    };
    write(args, text, &all, &judgement, &samples.place, made)
}

fn one(args: &FitArgs, recording: &Path) -> Result<Status> {
    let (prepared, samples) = match prepared(args, recording) {
        // It is nowhere still: a compass that is turned without a rest.
        Err(why @ Error::Undetermined(_)) => {
            return body_alone(args, Some(&open(recording, &args.log)?), &[], why);
        }
        read => read?,
    };
    let place = prepared.place.clone();
    let fitted = match fit_or_faces(prepared.clone(), args.options()) {
        Ok(fitted) => fitted,
        Err(why @ Error::Undetermined(_)) => {
            let done = body_alone(args, samples.as_ref(), &prepared.dwells.list, why);
            return done.inspect_err(|_| Refused::of(&prepared).print());
        }
        Err(why) => {
            Refused::of(&prepared).print();
            return Err(why);
        }
    };
    let result = FitResult::of(&fitted);
    let body = args.further(samples.as_ref(), &fitted)?;
    let mut text = report::fit_text(&result, args.verbose.verbose);
    text += &budget_text(&result);
    if let Some((path, prior)) = args.prior.as_ref().zip(fitted.prepared.prior.as_ref()) {
        let used = prior.words();
        if !used.is_empty() {
            text += &format!("prior: {}, {used}\n", path.display());
        }
    }
    let raw = result.raw_unit;
    let more = body.as_ref().map(|body| BodyResult::of(body, raw));
    text.extend(more.as_ref().map(report::body_text));
    if args.dwells {
        text.push('\n');
        text.push_str(&report::dwell_table(&result.dwells));
    }
    let made = || {
        let mut made = Calibration::of(&fitted, &[], &now())?;
        made.body = body.iter().flat_map(|body| body.tables(raw)).collect();
        Ok(made)
    };
    let all = Joined::of(&result, more.as_ref());
    write(args, text, &all, &result.judgement, &place, made)
}

/// Recordings beside their trajectories.
fn beside(args: &FitArgs, by: Vec<Trajectory>) -> Result<Status> {
    let each = args.recordings.iter().zip(by);
    let each = each.map(|(recording, by)| Ok((open(recording, &args.log)?, by)));
    let all: Vec<(Recording, Trajectory)> = each.collect::<Result<_>>()?;
    let manifests = all.iter().map(|(of, _)| of.directory.join(MANIFEST_FILE));
    let manifests: Vec<PathBuf> = manifests.collect();
    let samples = all.iter().map(|(recording, _)| &recording.samples);
    let inputs = manifests.iter().chain(samples);
    let inputs = inputs.chain(&args.trajectory.trajectory);
    let inputs: Vec<&Path> = inputs.map(PathBuf::as_path).collect();
    check_outputs(&[args.output.as_deref(), args.json.file()], &inputs)?;
    let made = trajectory::fitted(&all, args.verbose.verbose)?;
    let first = &all[0].0;
    write(
        args,
        made.text.clone(),
        &made.json,
        &made.judgement,
        &first.place,
        || made.calibration(first),
    )
}

/// One calibration of several sessions.
fn several(args: &FitArgs) -> Result<Status> {
    let one = |recording: &PathBuf| {
        let (prepared, samples) = prepared(args, recording)?;
        let fit = fitted(args, prepared, fit_determined)?;
        Ok((args.further(samples.as_ref(), &fit)?, fit))
    };
    let made: Result<Vec<_>> = args.recordings.iter().map(one).collect();
    let all = SessionsMade::of(made?, args.class())?;
    let mut text = all.text(args.verbose.verbose);
    if args.dwells {
        for fit in &all.sessions.fits {
            let dwells = DwellResult::list(&fit.prepared);
            text += &format!("\n{}\n{}", fit.prepared.place, report::dwell_table(&dwells));
        }
    }
    let place = all.sessions.fits[0].prepared.place.clone();
    let made = || Ok(all.calibration.clone());
    write(args, text, &all.json(), &all.judgement, &place, made)
}

/// The calibration that `made` gives against the data sheet of the `--part`.
fn data_sheet(args: &FitArgs, made: impl Fn() -> Result<Calibration>) -> Result<Option<DataSheet>> {
    let Some(part) = args.part.part()? else {
        return Ok(None);
    };
    let noise = args.noise.read()?;
    Ok(Some(DataSheet::of(&made()?, noise.as_ref(), &part)))
}

/// Prints the result and writes the calibration, unless it is a misfit.
fn write(
    args: &FitArgs,
    mut text: String,
    result: &impl Serialize,
    judgement: &Judgement,
    place: &str,
    made: impl Fn() -> Result<Calibration>,
) -> Result<Status> {
    let sheet = data_sheet(args, &made)?;
    text.extend(sheet.as_ref().map(data_sheet_text));
    let refusal = args.writing.refusal(judgement, place, CHECK);
    let mut out = Results::new(text);
    let path = args.output.as_ref().filter(|_| refusal.is_none());
    out.file("calibration", path, || Ok(made()?.to_toml()))?;
    let both = WithDataSheet {
        result,
        data_sheet: sheet.as_ref(),
    };
    out.print(&args.json, &both)?;
    match refusal {
        Some(error) => Err(error),
        None => Ok(args.strict.status(judgement)),
    }
}
