//! `mimu design --effects`: the next experiment.

use std::path::Path;

use mimu::plan::design::budget::DwellNoise;
use mimu::plan::design::reach::{Fixture, RateList, Rates};
use mimu::plan::design::tour::Motion;
use mimu::plan::next_experiment::prediction::Target;
use mimu::plan::next_experiment::{CHAMBER_C, DWELL_S, RATE_DPS, SLEW, Setup, smallest};
use mimu::result::next_experiment::NextExperiment;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::{Fit, NoiseFile, Options, Sensor, effects, fit};
use mimu_recording::{Error, Reference, Result};

use super::{DesignArgs, NoiseArg};
use crate::reading::{LogArgs, read_samples};

/// Default sample rate without a recording, Hz.
const SAMPLE_RATE_HZ: f64 = 1000.0;

/// Parses the chamber's temperatures.
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

fn targets(ids: &[String]) -> Result<Vec<Target>> {
    let mut all: Vec<Target> = Vec::new();
    for id in ids {
        let Some(effect) = effects::by_id(id) else {
            let known: Vec<&str> = effects::all().map(|e| e.id).collect();
            return Err(Error::new(
                format!("--effects {id}"),
                "no effect has this name",
                format!("choose one of {}", known.join(", ")),
            ));
        };
        let target = Target::listed(effect);
        if !all.iter().any(|t| t.candidate.id() == effect.id) {
            all.push(target);
        }
    }
    Ok(all)
}

impl DesignArgs {
    /// The unit and its fixture from the options, if no recording is given.
    fn setup(&self) -> Setup {
        let fixture = self.fixture();
        let motion = self.motion();
        let slew = match self.slew {
            None => motion.slew.max(SLEW),
            Some(_) => motion.slew,
        };
        Setup {
            reference: match fixture {
                Fixture::Hand => Reference::Gravity,
                _ => self.reference(),
            },
            fixture,
            sensors: Sensor::BOTH.to_vec(),
            rates: RateList {
                largest_dps: RATE_DPS,
                rates: Rates::Any,
            },
            chamber_c: CHAMBER_C,
            noise: Sensor::BOTH.map(DwellNoise::fang),
            dwell_s: DWELL_S,
            motion: Motion { slew, ..motion },
            seed: self.seed,
        }
    }

    /// Noise of gyro and accelerometer from the options, if given.
    fn given_noise(&self, targets: &[Target]) -> Result<Option<[DwellNoise; 2]>> {
        match &self.noise {
            None => Ok(None),
            Some(NoiseArg::File(path)) => {
                let file = NoiseFile::read(path)?;
                let [gyro, accel] = Sensor::BOTH.map(|s| match file.of(s).is_empty() {
                    true => Ok(DwellNoise::fang(s)),
                    false => DwellNoise::from_file(&file, s),
                });
                Ok(Some([gyro?, accel?]))
            }
            Some(NoiseArg::Density(n)) => {
                let own = targets.first().map(|s| s.candidate.sensor);
                if targets.iter().any(|s| Some(s.candidate.sensor) != own) {
                    return Err(Error::new(
                        format!("--noise {n}"),
                        "one number cannot be the noise of both gyro and accelerometer",
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

/// Fit of a recording of the unit.
fn after(path: &Path, args: &DesignArgs) -> Result<Fit> {
    let outputs = [args.output.as_deref(), args.json.file()];
    let (log, search) = (LogArgs::default(), STILL_FACTOR.into());
    let (prepared, _) = read_samples(path, &log, search, &outputs, &[])?;
    let prepared = match &args.noise {
        Some(NoiseArg::File(file)) => prepared.with_noise(&NoiseFile::read(file)?)?,
        _ => prepared,
    };
    fit(prepared, Options::IN_SAMPLE)
}

/// The smallest experiment that shows the effects `ids`, and its plan as TOML.
pub(super) fn smallest_experiment(
    args: &DesignArgs,
    ids: &[String],
) -> Result<(NextExperiment, String)> {
    let targets = targets(ids)?;
    let recording = args
        .after
        .as_deref()
        .map(|path| after(path, args))
        .transpose()?;
    let mut setup = args.setup();
    if let Some(fit) = &recording {
        let own = Setup::of(fit, args.table.is_some().then(|| args.fixture()));
        setup = Setup {
            motion: args.slew.map_or(own.motion, |_| args.motion()),
            seed: args.seed,
            ..own
        };
    }
    setup.rates = args.rates.clone().unwrap_or(setup.rates);
    setup.chamber_c = args.chamber.unwrap_or(setup.chamber_c);
    setup.dwell_s = args.dwell.unwrap_or(setup.dwell_s);
    setup.noise = args.given_noise(&targets)?.unwrap_or(setup.noise);
    let missing = targets
        .iter()
        .find(|t| !setup.sensors.contains(&t.candidate.sensor));
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
    let Some(answer) = smallest(&setup, &targets) else {
        return Err(Error::new(
            format!("--effects {}", ids.join(",")),
            format!(
                "no recipe with --table {} and these rates determines all of its coefficients",
                setup.fixture.name()
            ),
            "use another --table, --reference or --rates, or fewer effects at once",
        ));
    };
    let manifest = recording.as_ref().map(|f| &f.prepared.manifest);
    let result = NextExperiment::new(&setup, &answer);
    let device = manifest.map(|m| m.device.as_str());
    let sample_rate_hz = manifest.map_or(SAMPLE_RATE_HZ, |m| m.sample_rate_hz);
    Ok((result, answer.plan(&setup, device, sample_rate_hz)))
}
