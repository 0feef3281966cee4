//! `mimu diagnose`: arguments and execution.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::opening;
use crate::report::{self, Made};
use clap::Args;
use mimu::diagnosed::{Diagnosed, diagnosed};
use mimu::plan::next_experiment;
use mimu::{
    DiagnosisResult, DwellSearch, Estimate, NoiseFile, OfRecording, Options as FitOptions,
    Prepared, Recordings, Sensor, fit,
};
use mimu_body::result::{BodyResult, EstimateResult, PlaceResult};
use mimu_body::{Body, Options, Pairs, Split, accel_delay_ms};
use mimu_recording::{Recording, Result};
use serde::Serialize;
use serde_json::{Value, json};

use crate::arguments::{
    JsonArgs, KeepArgs, NoiseArgs, StillArgs, StrictArgs, VerboseArgs, WholeTurnArgs, WritingArgs,
    with_noise,
};
use crate::hint::OF_A_LOG;
use crate::output::{Results, now, progress};
use crate::reading::{LogArgs, read_samples};
use crate::report::{Joined, refused};
use crate::status::Status;

/// Arguments of `mimu diagnose`.
#[derive(Args)]
pub struct DiagnoseArgs {
    /// Directory of the recording; several of one unit are diagnosed together, each with its own biases, and the calibration is that of the
    /// first
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    /// Another recording of the unit, for judging only: an effect that it contradicts is not accepted
    #[arg(long, value_name = "REC")]
    verify: Option<PathBuf>,
    /// Keep the matrices of this calibration and estimate the biases only, for a unit that is never turned (in a chamber)
    ///
    /// Its effects are removed first, and are written to the new file too.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Calibration file to write, with the effects that were found
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// HTML page to write: residuals, effects and figures
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Plan to write: the next experiment, for what this recording could not show or distinguish
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Print the experiments for what this recording could not show or distinguish
    #[arg(long)]
    next: bool,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    whole: WholeTurnArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    /// Size of the Earth's field at the place, µT, for a recording with a magnetometer; without it the field counts as 1
    #[arg(long, value_name = "UT")]
    field: Option<f64>,
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

impl DiagnoseArgs {
    /// The recording that `open` reads, with all that the arguments state.
    ///
    /// # Errors
    /// The recording is refused.
    pub fn opened(
        &self,
        open: &dyn Fn(DwellSearch) -> Result<Prepared>,
        noise: Option<&NoiseFile>,
    ) -> Result<Prepared> {
        let prepared = with_noise(open(self.still.search())?, noise)?;
        self.whole.apply(self.keep.apply(prepared))
    }
}

/// What to do about readings that no calibration describes.
const MISFIT: &str =
    "check range, columns and unit of the readings and record again, or write it all the same";

/// Writes the plan of the next experiment, if it is asked for.
fn write_plan(args: &DiagnoseArgs, done: &Diagnosed, out: &mut Results) -> Result<()> {
    let Diagnosed {
        diagnosis,
        next,
        result: found,
        ..
    } = done;
    if args.plan.is_none() {
        return Ok(());
    }
    const PLAN: &str = "plan of the next experiment";
    match next_experiment::together(diagnosis, next) {
        Some((setup, answer)) => {
            let manifest = &diagnosis.before.prepared.manifest;
            let left_out = report::not_in_plan_text(found);
            let about: String = left_out.lines().map(|l| format!("# {l}\n")).collect();
            let plan = answer.plan(&setup, Some(&manifest.device), manifest.sample_rate_hz);
            out.file(PLAN, args.plan.as_ref(), || Ok(about + &plan))?;
            out.say(&left_out);
        }
        None => out.say(&format!(
            "\n{PLAN}: none written, because no plan of this kind would show or distinguish more\n"
        )),
    }
    Ok(())
}

/// What a body and a delay add to a diagnosis.
pub struct Further {
    /// What all pairs err by, and each.
    split: Option<Split>,
    /// Of the accelerometer against the gyro, ms.
    delay_ms: Option<Estimate>,
    body: Option<Body>,
    /// Magnetometers whose hard iron moves with the temperature.
    iron: Vec<PlaceResult>,
}

impl Further {
    /// Of the samples that were diagnosed. Beside an effect of the sensors a delay would follow it.
    ///
    /// # Errors
    /// They cannot be read.
    pub fn of(
        samples: Option<&Recording>,
        done: &Diagnosed,
        split: Option<Split>,
        args: &DiagnoseArgs,
    ) -> Result<Self> {
        let before = &done.diagnosis.before;
        let options = Options {
            field_ut: args.field,
        };
        let body = samples.map(|of| Body::of(of, before, &options));
        let body = body.transpose()?.flatten();
        let places = body.as_ref().map(BodyResult::places).unwrap_or_default();
        let samples = samples.filter(|_| done.result.effects.is_empty());
        let delay_ms = samples.map(|samples| accel_delay_ms(samples, before));
        Ok(Self {
            iron: places.into_iter().filter(|of| of.iron.is_some()).collect(),
            body,
            split,
            delay_ms: delay_ms.transpose()?.flatten(),
        })
    }

    /// As text, after that of the diagnosis.
    pub fn text(&self) -> String {
        let delay = self.delay_ms.as_ref().map(report::delay_text);
        let split = self.split.as_ref().map(report::split_text);
        let iron = report::iron_text(&self.iron);
        delay.into_iter().chain(split).chain([iron]).collect()
    }

    /// The diagnosis with it, as JSON.
    pub fn json<'a>(&self, found: &'a DiagnosisResult) -> impl Serialize + use<'a> {
        let mut more = serde_json::Map::new();
        more.extend(self.split.as_ref().map(|of| ("body".to_owned(), json!(of))));
        let delay = self.delay_ms.map(EstimateResult::from);
        more.extend(delay.map(|of| ("accel_delay_ms".to_owned(), json!(of))));
        let iron = self.iron.iter().map(|of| (of.triad.to_string(), &of.iron));
        let iron: BTreeMap<_, _> = iron.collect();
        more.extend((!iron.is_empty()).then(|| ("iron".to_owned(), json!(iron))));
        let more = (!more.is_empty()).then_some(Value::Object(more));
        Joined::of(found, more.as_ref())
    }
}

impl DiagnoseArgs {
    /// Takes what all pairs of a body err by in common out of the turns of `recordings`, whose `samples` are in the order of the command line, the one that judges last.
    /// Gives the split of that part for those in which effects are sought. With a given calibration no pair is fitted.
    ///
    /// # Errors
    /// The samples cannot be read.
    pub fn split(
        &self,
        samples: &[&Recording],
        recordings: &mut Recordings,
    ) -> Result<Option<Split>> {
        let pairs = |samples: &[&Recording], all: &mut [&mut Prepared]| {
            let several = |of: &&Recording| of.triads().len() > Sensor::BOTH.len();
            if recordings.given.is_some() || !samples.iter().all(several) {
                return Ok(None);
            }
            // A first pair that is not determined is refused by the diagnosis.
            let fits = all
                .iter()
                .map(|of| fit((**of).clone(), FitOptions::IN_SAMPLE));
            let Ok(fits) = fits.collect::<Result<Vec<_>>>() else {
                return Ok(None);
            };
            let each: Vec<_> = samples.iter().copied().zip(&fits).collect();
            let Some(pairs) = Pairs::of(&each, self.still.search())? else {
                return Ok(None);
            };
            for (of, own) in all.iter_mut().zip(pairs.first) {
                if let Some(own) = own {
                    **of = own;
                }
            }
            Ok(Some(pairs.split))
        };
        let (first, more) = (&mut recordings.first, &mut recordings.more);
        let mut all: Vec<&mut Prepared> = std::iter::once(first).chain(more).collect();
        let (sought, judging) = samples.split_at(all.len().min(samples.len()));
        let split = pairs(sought, &mut all)?;
        if let Some(second) = &mut recordings.second {
            pairs(judging, &mut [second])?;
        }
        Ok(split)
    }
}

pub fn run(args: &DiagnoseArgs, command_line: &str) -> Result<Status> {
    let outputs = [
        args.output.as_deref(),
        args.page.as_deref(),
        args.plan.as_deref(),
        args.json.file(),
    ];
    let inputs = [args.noise.file.as_deref(), args.calibration.as_deref()];
    let noise = args.noise.read()?;
    let samples = RefCell::new(Vec::new());
    let open = |path: &PathBuf| {
        let read = |search| {
            let read = read_samples(path, &args.log, search, &outputs, &inputs)?;
            samples.borrow_mut().push(read.1);
            Ok(read.0)
        };
        args.opened(&read, noise.as_ref())
    };
    let given = args.calibration.as_deref().map(opening::calibration);
    let given = given.transpose()?;
    let all: Result<Vec<Prepared>> = args.recordings.iter().map(open).collect();
    let mut all = all?;
    args.writing.check(args.output.as_deref())?;
    let mut recordings = Recordings {
        first: all.remove(0),
        more: all,
        second: args.verify.as_ref().map(open).transpose()?,
        given: given.as_ref(),
    };
    let samples = samples.take();
    let split = args.split(&samples.iter().collect::<Vec<_>>(), &mut recordings)?;
    let samples = samples.first();
    let shown = |path: &Option<PathBuf>| path.as_ref().map(|p| p.display().to_string());
    let names = [shown(&args.verify), shown(&args.calibration)];
    let now = now();
    let by = names.each_ref().map(Option::as_deref);
    let all = std::iter::once(&recordings.first).chain(&recordings.more);
    let all = all.chain(&recordings.second);
    let problems: Vec<_> = all.flat_map(OfRecording::prepared).collect();
    let several = args.recordings.len() > 1 || args.verify.is_some();
    let bar = progress("diagnosing");
    let done = diagnosed(recordings, by, &now, &|share| bar.reach(share));
    bar.finish();
    let done = done.inspect_err(|_| refused(&problems, several))?;
    let Diagnosed {
        diagnosis,
        result: found,
        ..
    } = &done;
    let detail = report::Detail {
        all: args.verbose.verbose,
        next: args.next,
    };
    let before = &diagnosis.before;
    let further = Further::of(samples, &done, split, args)?;
    let mut out = Results::new(report::diagnosis_text(found, detail) + &further.text());
    let place = diagnosis.before.prepared.place.clone();
    let refusal = args.writing.refusal(&found.judgement, &place, MISFIT);
    let output = args.output.as_ref().filter(|_| refusal.is_none());
    write_plan(args, &done, &mut out)?;
    out.file("calibration", output, || {
        let mut made = done.calibration(&now)?;
        let raw = before.prepared.manifest.raw_unit;
        let body = further.body.iter();
        made.body = body.flat_map(|body| body.tables(raw)).collect();
        Ok(made.to_toml())
    })?;
    out.file("page", args.page.as_ref(), || {
        let made = Made::of(&args.recordings, command_line);
        Ok(report::diagnosis_page(found, &made))
    })?;
    out.print(&args.json, &further.json(found))?;
    match refusal {
        Some(error) => Err(error),
        None => Ok(args.strict.status(&found.judgement)),
    }
}
