//! `mimu design`: arguments and execution.

mod effects;
mod noise;
mod prior;

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use mimu::plan::design::Problem;
use mimu::plan::design::budget::Session;
use mimu::plan::design::reach::{Fixture, RateList, Rates};
use mimu::plan::design::tour::{Motion, randomised};
use mimu::quantity::Sensor;
use mimu::result::design::{Conditions, Design};
use mimu::result::next_experiment::NextExperiment;
use mimu_recording::{Error, Reference, Result};
use nalgebra::Vector3;
use serde::Serialize;

use crate::arguments::{JsonArgs, VerboseArgs, choice, number, sensor};
use crate::output::{Results, check_outputs};
use crate::overwriting::check_overwritten;
use crate::report;
use noise::NoiseArg;

#[derive(Args)]
#[command(group(ArgGroup::new("design").args(["n", "budget", "effects"])))]
#[command(group(ArgGroup::new("goal").required(true).multiple(true).args(["n", "budget", "effects", "prior"])))]
pub struct DesignArgs {
    /// Sensor to calibrate
    #[arg(long, value_parser = sensor(), default_value = "accel")]
    sensor: Sensor,
    /// What is known of the input: table (all of it) or gravity (its magnitude at rest) [default: table, or gravity with --table hand or --prior]
    #[arg(long)]
    reference: Option<Reference>,
    /// Find the best design of N dwells
    #[arg(short, value_name = "N", value_parser = dwells, allow_negative_numbers = true)]
    n: Option<u16>,
    /// Find the best number and length of dwells within this time in minutes, moves included
    #[arg(long, value_name = "MINUTES", value_parser = |t: &str| number(t, 0.1, 2880.0))]
    budget: Option<f64>,
    /// Find the smallest experiment that shows these effects (see `mimu diagnose`)
    #[arg(long, value_name = "ID[,ID..]", value_delimiter = ',',
          conflicts_with_all = ["sigma", "instability", "walk"])]
    effects: Option<Vec<String>>,
    /// With --effects: a recording of the unit, for its noise, sensors, rates and fixture
    #[arg(long, value_name = "REC", requires = "effects")]
    after: Option<PathBuf>,
    /// With --effects: temperatures of the chamber, °C: the one at the beginning and the end, and the two extremes
    #[arg(long, value_name = "C,C,C", requires = "effects", allow_hyphen_values = true, value_parser = effects::chamber)]
    chamber: Option<[f64; 3]>,
    /// Population of the unit's kind (`mimu fleet --prior`): the plan counts what it says, and is for poses by hand
    ///
    /// Without -n or --budget, the plan has the fewest dwells that meet the targets. Fit its recording with `mimu fit --prior` and the same
    /// file.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// With --prior: how well a person takes a pose, degrees about each level axis, one standard deviation
    ///
    /// Beside few poses the intervals depend on it: six faces hit exactly do not show the angles between the axes, and 3 degrees beside them these enter the
    /// scale factors.
    #[arg(long, value_name = "DEG", requires = "prior", default_value_t = 3.0, value_parser = |t: &str| number(t, 0.0, 25.0))]
    aim: f64,
    /// With --prior: target for the half-width of a 95 % interval: accel-bias=1 (mg), accel-scale=1000 (ppm), accel-angle=1000 (µrad), which are the
    /// defaults and those of the wizard; may be repeated
    #[arg(long = "target", value_name = "NAME=VALUE", requires = "prior", conflicts_with_all = ["n", "budget"])]
    targets: Vec<String>,
    /// What holds the unit [default: three-axis, or hand with --reference gravity or --prior]
    #[arg(long, value_parser = choice(&[
        ("three-axis", "Every attitude, and a rate about the vertical", Fixture::ThreeAxis),
        ("two-axis", "Any turn about the body's z, tilted by at most 95 degrees", Fixture::TwoAxis),
        ("faces", "Six faces only", Fixture::Faces),
        ("hand", "Every attitude, by hand", Fixture::Hand),
    ]))]
    table: Option<Fixture>,
    /// Length of a dwell, s
    ///
    /// By default 20 s, by hand 4 s; with a noise file, the length beyond which longer dwells reduce sigma by at most 5 %.
    #[arg(long, value_name = "S", conflicts_with = "budget",
          value_parser = |t: &str| number(t, 0.1, 86400.0))]
    dwell: Option<f64>,
    /// Rates of the table for a gyro, deg/s: `10,100,300`, or `..300` for any up to 300 [default: ..300]
    #[arg(long, value_name = "LIST")]
    rates: Option<RateList>,
    /// Rate of moves between attitudes, deg/s [default: 10 on a table, 45 by hand]
    #[arg(long, value_name = "DPS", value_parser = |t: &str| number(t, 0.01, 10000.0))]
    slew: Option<f64>,
    /// Time from the end of a move to the dwell, s
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = |t: &str| number(t, 0.0, 3600.0))]
    settle: f64,
    /// Sigma of a dwell mean, m/s² or rad/s [default: from --noise, --instability and --walk]
    #[arg(long, value_name = "SI", value_parser = |t: &str| number(t, 1e-12, 1e3),
          conflicts_with_all = ["budget", "noise", "instability", "walk"])]
    sigma: Option<f64>,
    /// White noise N, m/s² or rad/s per √Hz, or the noise file of the unit [default: that of fang's sensors]
    #[arg(long, value_name = "SI|FILE")]
    noise: Option<NoiseArg>,
    /// Bias instability B, m/s² or rad/s [default: such that its floor equals white noise in a mean of 20 s]
    #[arg(long, value_name = "SI", value_parser = |t: &str| number(t, 0.0, 1e3))]
    instability: Option<f64>,
    /// Random walk K, m/s² or rad/s per √s [default: 0]
    #[arg(long, value_name = "SI", value_parser = |t: &str| number(t, 0.0, 1e3))]
    walk: Option<f64>,
    /// Seed of the search and of the random order
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Plan to write, for a table or a person
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    verbose: VerboseArgs,
    #[command(flatten)]
    json: JsonArgs,
}

fn dwells(text: &str) -> std::result::Result<u16, String> {
    match text.parse() {
        Ok(n) if (1..=200).contains(&n) => Ok(n),
        _ => Err("write a whole number, 1 to 200".into()),
    }
}

impl DesignArgs {
    fn reference(&self) -> Reference {
        self.reference.unwrap_or(match (self.table, &self.prior) {
            (Some(Fixture::Hand), _) | (_, Some(_)) => Reference::Gravity,
            _ => Reference::Table,
        })
    }

    fn fixture(&self) -> Fixture {
        self.table.unwrap_or(match self.reference() {
            Reference::Table => Fixture::ThreeAxis,
            Reference::Gravity | Reference::TurntableRate => Fixture::Hand,
        })
    }

    fn motion(&self) -> Motion {
        let usual = Motion::of(self.fixture());
        Motion {
            slew: self.slew.map_or(usual.slew, f64::to_radians),
            settle_s: self.settle,
            ..usual
        }
    }

    /// The problem with the requested rates of the table.
    fn problem(&self) -> Result<Problem> {
        match (self.sensor, self.reference()) {
            (Sensor::Accel, _) if self.rates.is_some() => Err(Error::new(
                "--rates",
                "dwells of an accelerometer are at rest",
                "leave it out, or use --sensor gyro",
            )),
            (Sensor::Accel, reference) => Problem::accel(reference, self.fixture()),
            (Sensor::Gyro, Reference::Table) => {
                let (dps, rates) = match &self.rates {
                    Some(list) => (list.largest_dps, list.rates.clone()),
                    None => (RATE_DPS, Rates::Any),
                };
                let span = Vector3::repeat(dps.to_radians());
                Problem::gyro(span, self.fixture(), rates)
            }
            (Sensor::Gyro, Reference::TurntableRate) => Err(Error::new(
                "gyro, --reference turntable-rate",
                "this command does not design orientations on a record player",
                "design poses by gravity (--sensor accel --reference gravity --table hand): the same orientations serve a gyro",
            )),
            (Sensor::Gyro, Reference::Gravity) => Err(Error::new(
                "gyro, --reference gravity",
                "by hand a gyro's known inputs are the turns between dwells, which this command does not design",
                "design the accelerometer's dwells, and turn by 90 degrees or more between them",
            )),
        }
    }

    /// The best design found of `n` dwells, in a randomised order.
    fn best(&self, problem: &Problem, n: usize, title: String) -> Result<Design> {
        let settings = problem.best(n, self.seed)?;
        let (noise, dwell_s, sigma) = self.dwell()?;
        let conditions = Conditions {
            title,
            dwell_s,
            noise: self.sigma.is_none().then_some(noise),
            assumed_noise: self.assumed_noise(),
            motion: self.motion(),
        };
        let judgement = problem.judge(&randomised(&settings, self.seed), sigma);
        Ok(Design::new(problem, judgement, conditions))
    }

    fn within(&self, problem: &Problem, minutes: f64) -> Result<Design> {
        let session = Session {
            time_s: 60.0 * minutes,
            noise: self.noise()?,
            motion: self.motion(),
        };
        let budget = session.spend(problem, self.seed)?;
        let best = &budget.best;
        let conditions = Conditions {
            title: format!("best within {minutes} min (seed {})", self.seed),
            dwell_s: best.dwell_s,
            noise: Some(session.noise),
            assumed_noise: self.assumed_noise(),
            motion: session.motion,
        };
        let judgement = problem.judge(&best.settings, best.sigma);
        let design = Design::new(problem, judgement, conditions);
        Ok(design.within(session.time_s, &session.noise, &budget))
    }

    /// The requested single design.
    fn designed(&self) -> Result<Design> {
        let problem = self.beside_prior(self.problem()?)?;
        let design = match (self.budget, self.n) {
            (Some(minutes), _) => self.within(&problem, minutes)?,
            (_, Some(n)) => {
                let n = usize::from(n);
                let title = format!("best of {n} dwells found (seed {})", self.seed);
                self.best(&problem, n, title)?
            }
            (None, None) => return self.fewest(&problem),
        };
        Ok(design.beside_population(&problem, self.seed, None))
    }
}

/// Largest rate if `--rates` is not given, deg/s: the range of fang's gyros.
const RATE_DPS: f64 = 300.0;

/// Result of `mimu design`.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Designed {
    /// One design (`-n`, `--budget`).
    Design(Box<Design>),
    /// The smallest experiment that shows effects (`--effects`).
    NextExperiment(Box<NextExperiment>),
}

impl Designed {
    /// The text that the command prints; in full if `verbose`.
    pub fn text(&self, verbose: bool) -> String {
        match self {
            Self::Design(design) => report::design_text(design, verbose),
            Self::NextExperiment(next) => report::next_text(next),
        }
    }
}

impl DesignArgs {
    /// The requested result, and its plan as TOML.
    pub(crate) fn made(&self) -> Result<(Designed, String)> {
        self.refuse_beside_prior()?;
        if let Some(ids) = &self.effects {
            let (next, plan) = effects::smallest_experiment(self, ids)?;
            return Ok((Designed::NextExperiment(Box::new(next)), plan));
        }
        let design = self.designed()?;
        let plan = design.plan(self.motion().slew);
        Ok((Designed::Design(Box::new(design)), plan))
    }
}

pub fn run(args: &DesignArgs) -> Result<()> {
    let noise = match &args.noise {
        Some(NoiseArg::File(path)) => Some(path),
        _ => None,
    };
    let stated = noise.into_iter().chain(&args.prior);
    check_outputs(&[args.output.as_deref(), args.json.file()], stated)?;
    check_overwritten(&[args.output.as_deref()])?;
    let (made, plan) = args.made()?;
    let mut out = Results::new(made.text(args.verbose.verbose));
    out.file("plan", args.output.as_ref(), || Ok(plan))?;
    out.print(&args.json, &made)
}
