//! `mimu diagnose`: arguments and what follows from them.

use std::path::PathBuf;

use crate::report::{self, Made};
use clap::Args;
use mimu::calibration::Calibration;
use mimu::calibration::verify::verify;
use mimu::diagnose::{Diagnosis, Recordings, diagnose};
use mimu::effects::fitted::FittedEffect;
use mimu::fit::{Method, Options};
use mimu::plan::next_experiment;
use mimu::result::diagnosis::DiagnosisResult;
use mimu::warning::Warning;
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::stage;

use crate::arguments::{JsonArgs, KeepArgs, NoiseArgs, StillArgs, VerboseArgs};
use crate::output::print;
use crate::reading::read;

#[derive(Args)]
pub struct DiagnoseArgs {
    /// Directory of the recording, and of more of the same unit: effects are found in all of them, each with its own biases;
    /// the calibration is that of the first
    #[arg(required = true, value_name = "REC")]
    recordings: Vec<PathBuf>,
    /// Another recording of the unit, which nothing is found in: an effect that it contradicts is not accepted
    #[arg(long, value_name = "REC")]
    verify: Option<PathBuf>,
    /// Keep the matrices of this calibration, and find the biases only: for a unit that is never turned, like in a chamber
    ///
    /// Its effects are taken out first, and go into the new file.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Take this term, though nothing but this recording speaks for it: `term:...`, as the report says
    #[arg(long, value_name = "ID")]
    accept: Vec<String>,
    /// Calibration file to write, with the effects
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Page to write: residuals, effects and figures as one HTML file
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Plan of the next experiment to write: what this recording could not show, and what it could not tell apart
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Print the experiments that would show what this recording could not show, and distinguish what it could not
    #[arg(long)]
    next: bool,
    #[command(flatten)]
    still: StillArgs,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub fn run(args: &DiagnoseArgs) -> Result<()> {
    let options = Options {
        method: Method::LeastSquares,
        holdout_blocks: 0,
        still_factor: args.still.factor,
        only: None,
    };
    let outputs = [
        args.output.as_deref(),
        args.page.as_deref(),
        args.plan.as_deref(),
        args.json.file(),
    ];
    let inputs = [args.noise.file.as_deref(), args.calibration.as_deref()];
    let open = |path: &PathBuf| {
        let prepared = read(path, args.still.finding(), &outputs, &inputs)?;
        Ok(args.keep.apply(args.noise.state(prepared)?))
    };
    let given = match &args.calibration {
        Some(path) => Some(Calibration::read(path)?),
        None => None,
    };
    if let (Some(path), true) = (
        &args.calibration,
        given.as_ref().is_some_and(|c| c.temperature.is_some()),
    ) {
        return Err(Error::new(
            format!("{}, [temperature]", path.display()),
            "a diagnosis goes by one model for all temperatures, and the curves would be left out",
            "compensate the recording first (`mimu apply`), and diagnose that",
        ));
    }
    let mut all = Vec::new();
    for path in &args.recordings {
        all.push(open(path)?);
    }
    let second = match &args.verify {
        Some(path) => Some(open(path)?),
        None => None,
    };
    let first = all.remove(0);
    let mut diagnosis = diagnose(
        Recordings {
            first,
            more: all,
            second: second.clone(),
            given: given.as_ref(),
            accept: args.accept.clone(),
        },
        options,
    )?;
    let now = jiff::Timestamp::now()
        .round(jiff::Unit::Second)
        .unwrap_or_default()
        .to_string();
    let known = known(given.as_ref(), &mut diagnosis);
    let found = diagnosis
        .sensors
        .iter()
        .flat_map(|s| &s.decision.accepted)
        .filter(|a| a.of_unit)
        .map(|a| a.effect.lasting());
    let mut effects = known.clone();
    for effect in found {
        effect.join(&mut effects).map_err(|problem| {
            let place = args
                .calibration
                .as_ref()
                .map_or_else(String::new, |p| p.display().to_string());
            let remedy = "diagnose with a calibration without it";
            Error::new(place, problem, remedy)
        })?;
    }
    let mut judged = None;
    if let (Some(other), Some(path)) = (second, &args.verify) {
        let by =
            |fit, effects: &[FittedEffect]| verify(&other, &Calibration::of(fit, effects, &now)?);
        let before = by(&diagnosis.before, &known);
        let after = by(&diagnosis.after, &effects);
        let path = path.display();
        match (before, after) {
            (Ok(before), Ok(after)) => judged = Some((path.to_string(), [before, after])),
            (Err(refusal), _) | (_, Err(refusal)) => {
                let warning = Warning::NotJudged(Some(path.to_string()), refusal);
                diagnosis.after.warnings.push(warning);
            }
        }
    }
    let mut files = Vec::new();
    if let Some(path) = &args.output {
        let mut made = Calibration::of(&diagnosis.after, &effects, &now)?;
        // An imported recording does not know the unit's number; that it is of the same unit was checked.
        let number = given.as_ref().and_then(|given| given.unit_id.clone());
        made.unit_id = made.unit_id.or(number);
        files.push(stage(path, made.to_toml())?);
    }
    let next = next_experiment::next(&diagnosis);
    let judged = judged.as_ref().map(|(name, both)| (name.as_str(), both));
    let found = DiagnosisResult::of(&diagnosis, &next, judged);
    let mut said = String::new();
    if let Some(path) = &args.plan {
        said = match next_experiment::together(&diagnosis, &next) {
            Some((setup, answer)) => {
                let manifest = &diagnosis.before.prepared.manifest;
                let left_out = report::not_in_plan_text(&found);
                let about: String = left_out.lines().map(|l| format!("# {l}\n")).collect();
                let text = about + &answer.plan(&setup, Some(&manifest.device), manifest.sample_rate_hz);
                files.push(stage(path, text)?);
                format!(
                    "\nplan of the next experiment: {}\n{left_out}",
                    path.display()
                )
            }
            None => "\nplan of the next experiment: none written, as there is nothing that one of this kind would settle\n".into(),
        };
    }
    let named: Vec<String> = args
        .recordings
        .iter()
        .map(|r| r.display().to_string())
        .collect();
    if let Some(path) = &args.page {
        let made = Made {
            recording: named.join(", "),
            command: command_line(),
            created: now,
        };
        files.push(stage(path, report::diagnosis_page(&found, &made)?)?);
    }
    for (what, path) in [("calibration", &args.output), ("page", &args.page)] {
        if let Some(path) = path {
            said += &format!("\n{what}: {}\n", path.display());
        }
    }
    let detail = report::Detail {
        all: args.verbose.verbose,
        next: args.next,
    };
    print(
        &args.json,
        &(report::diagnosis_text(&found, detail) + &said),
        &found,
        files,
    )
}

/// The effects that the unit is known to have. Those of a sensor that the recordings lack have no matrix in the new file.
fn known(given: Option<&Calibration>, diagnosis: &mut Diagnosis) -> Vec<FittedEffect> {
    let Some(given) = given else {
        return Vec::new();
    };
    let after = &mut diagnosis.after;
    let all = given.effects().iter().cloned();
    let (kept, lost) = all.partition(|effect| after.sensor(effect.sensor()).is_some());
    let lost: Vec<FittedEffect> = lost;
    for effect in lost {
        let warning = Warning::EffectLost(effect.id(), effect.sensor());
        after.warnings.push(warning);
    }
    kept
}

/// The command as it was typed, without the path of the program.
pub(crate) fn command_line() -> String {
    let arguments = std::env::args_os().skip(1);
    let shown = arguments.map(|a| match a.to_string_lossy() {
        a if a.contains([' ', '\'', '"']) => format!("{a:?}"),
        a => a.into_owned(),
    });
    std::iter::once("mimu".to_string())
        .chain(shown)
        .collect::<Vec<_>>()
        .join(" ")
}
