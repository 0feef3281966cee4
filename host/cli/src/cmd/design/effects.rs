//! `mimu design --effects`: the next experiment.

use std::path::Path;

use crate::report::{self, NextReport};
use mimu::design::budget::DwellNoise;
use mimu::design::reach::{Carrier, RateList, Rates};
use mimu::design::settle::{Question, Suspect, settle};
use mimu::diagnose::library;
use mimu::diagnose::next::{self, CHAMBER_C, DWELL_S, RATE_DPS};
use mimu::fit::{Fit, Method, Options, fit};
use mimu::noise_file::NoiseFile;
use mimu::quantity::Sensor;
use mimu::stillness::STILL_FACTOR;
use mimu_recording::Reference;
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::stage;

use super::{DesignArgs, NoiseArg};
use crate::output::{check_outputs, print};
use crate::reading::read;

/// Sample rate where no recording says another, Hz.
const SAMPLE_RATE_HZ: f64 = 1000.0;

/// Temperatures as on the command line.
pub(super) fn chamber(text: &str) -> std::result::Result<[f64; 3], String> {
    let list: Vec<f64> = text
        .split(',')
        .filter_map(|t| t.trim().parse().ok())
        .collect();
    match list[..] {
        [a, b, c] if list.iter().all(|t| (-90.0..=200.0).contains(t)) && a != b && b != c => {
            Ok([a, b, c])
        }
        _ => Err(
            "write three temperatures in °C: where it begins and ends, and two others, as 25,45,5"
                .into(),
        ),
    }
}

fn suspects(ids: &[String]) -> Result<Vec<Suspect>> {
    let mut all: Vec<Suspect> = Vec::new();
    for id in ids {
        let Some(effect) = library::by_id(id) else {
            let known: Vec<&str> = library::all().map(|e| e.id).collect();
            return Err(Error::new(
                format!("--effects {id}"),
                "there is no effect of this name",
                format!("choose of {}", known.join(", ")),
            ));
        };
        if all.iter().any(|s| s.candidate.id() == effect.id) {
            continue;
        }
        let suspect = Suspect::listed(effect).ok_or_else(|| {
            Error::new(
                format!("--effects {id}"),
                "an error of the code is met by chance, and no dwell can be planned for it",
                format!("needs {}", effect.needs),
            )
        })?;
        all.push(suspect);
    }
    Ok(all)
}

impl DesignArgs {
    /// What is asked without a recording.
    fn question(&self) -> Question<'static> {
        let carrier = self.carrier();
        let fang = Sensor::BOTH.map(DwellNoise::fang);
        let reference = match carrier {
            Carrier::Hand => Reference::Gravity,
            _ => self.reference,
        };
        Question {
            suspects: Vec::new(),
            reference,
            carrier,
            sensors: Sensor::BOTH.to_vec(),
            rates: RateList {
                largest_dps: RATE_DPS,
                rates: Rates::Any,
            },
            chamber_c: CHAMBER_C,
            noise: fang,
            dwell_s: DWELL_S,
            motion: self.motion(),
            seed: self.seed,
            known: None,
        }
    }

    /// Noise of gyro and accelerometer, where it is given here.
    fn given_noise(&self, suspects: &[Suspect]) -> Result<Option<[DwellNoise; 2]>> {
        match &self.noise {
            None => Ok(None),
            Some(NoiseArg::File(path)) => {
                let file = NoiseFile::read(path)?;
                let [gyro, accel] = Sensor::BOTH.map(|s| match file.of(s).is_empty() {
                    true => Ok(DwellNoise::fang(s)),
                    false => DwellNoise::stated(&file, s),
                });
                Ok(Some([gyro?, accel?]))
            }
            Some(NoiseArg::Density(n)) => {
                let own = suspects.first().map(|s| s.candidate.sensor);
                if suspects.iter().any(|s| Some(s.candidate.sensor) != own) {
                    return Err(Error::new(
                        format!("--noise {n}"),
                        "one number cannot be the noise of gyro and accelerometer",
                        "give the noise file of the unit, or effects of one sensor",
                    ));
                }
                Ok(Some(Sensor::BOTH.map(|s| match Some(s) == own {
                    true => DwellNoise {
                        n: *n,
                        b: 0.0,
                        k: 0.0,
                    },
                    false => DwellNoise::fang(s),
                })))
            }
        }
    }
}

/// The recording that the next one is to add to, fitted.
fn after(path: &Path, args: &DesignArgs) -> Result<Fit> {
    let outputs = [args.output.as_deref(), args.json.file()];
    let prepared = read(path, STILL_FACTOR, &outputs, &[])?;
    let prepared = match &args.noise {
        Some(NoiseArg::File(file)) => prepared.with_noise(&NoiseFile::read(file)?)?,
        _ => prepared,
    };
    let options = Options {
        method: Method::LeastSquares,
        holdout_blocks: 0,
        still_factor: STILL_FACTOR,
        only: None,
    };
    fit(prepared, options)
}

pub(super) fn run(args: &DesignArgs, ids: &[String]) -> Result<()> {
    let stated: Vec<&Path> = match &args.noise {
        Some(NoiseArg::File(path)) => vec![path],
        _ => Vec::new(),
    };
    check_outputs(&[args.output.as_deref(), args.json.file()], &stated)?;
    let suspects = suspects(ids)?;
    let recording = args
        .after
        .as_deref()
        .map(|path| after(path, args))
        .transpose()?;
    let known = recording.as_ref().map(next::known);
    let mut question = args.question();
    if let Some(fit) = &recording {
        let carrier = args.table.is_some().then(|| args.carrier());
        let own = next::question(fit, carrier);
        if own.reference != fit.prepared.manifest.reference {
            return Err(Error::new(
                args.after.as_deref().unwrap_or(Path::new("")).display(),
                "what it tells by another kind of reference cannot be added to",
                "leave --after or --table out",
            ));
        }
        question = Question {
            motion: args.slew.map_or(own.motion, |_| args.motion()),
            seed: args.seed,
            known: known.as_ref(),
            ..own
        };
    } else if args.slew.is_none() {
        question.motion.slew = question.motion.slew.max(next::SLEW);
    }
    question.rates = args.rates.clone().unwrap_or(question.rates);
    question.chamber_c = args.chamber.unwrap_or(question.chamber_c);
    question.dwell_s = args.dwell.unwrap_or(question.dwell_s);
    question.noise = args.given_noise(&suspects)?.unwrap_or(question.noise);
    question.suspects = suspects;
    let missing = question
        .suspects
        .iter()
        .find(|s| !question.sensors.contains(&s.candidate.sensor));
    if let (Some(missing), Some(path)) = (missing, &args.after) {
        return Err(Error::new(
            path.display(),
            format!(
                "it has no {} to show {} with",
                missing.candidate.sensor,
                missing.candidate.id()
            ),
            "give a recording with both sensors, or leave the effect out",
        ));
    }
    let answer = settle(&question);
    if !answer.possible() {
        return Err(Error::new(
            format!("--effects {}", ids.join(",")),
            answer.words(),
            "use another --table or --reference, or fewer effects at once",
        ));
    }
    let manifest = recording.as_ref().map(|f| &f.prepared.manifest);
    let report = NextReport {
        question: &question,
        answer: &answer,
        device: manifest.map(|m| m.device.clone()),
        sample_rate_hz: manifest.map_or(SAMPLE_RATE_HZ, |m| m.sample_rate_hz),
    };
    let mut text = report::next_text(&report);
    let mut plan = None;
    if let Some(path) = &args.output {
        plan = Some(stage(path, report.plan())?);
        text.push_str(&format!("\nplan: {}\n", path.display()));
    }
    print(&args.json, &text, &report::next_json(&report), plan)
}
