//! `mimu design`: arguments and what follows from them.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use mimu::calibration::stage;
use mimu::design::Problem;
use mimu::design::budget::{DwellNoise, spend};
use mimu::design::model::{Model, Setting, Terms};
use mimu::design::reach::{Carrier, RateList, Rates};
use mimu::design::schemes::Scheme;
use mimu::design::tour::Motion;
use mimu::dwell::Sensor;
use mimu::error::{Error, Result};
use mimu::recording::Reference;
use mimu::report::{self, DesignReport};
use nalgebra::Vector3;

use crate::{JsonArgs, SensorArg, check_outputs, print};

#[derive(Args)]
#[command(group(ArgGroup::new("design").required(true).args(["n", "budget", "scheme", "compare"])))]
pub struct DesignArgs {
    /// Sensor to calibrate
    #[arg(long, value_enum, default_value = "accel")]
    sensor: SensorArg,
    /// What is known of the input: table (all of it) or gravity (its size, at rest)
    #[arg(long, default_value = "table")]
    reference: Reference,
    /// Terms to determine: affine and any of quadratic, cubic, cross, g-sensitivity
    #[arg(long, value_name = "LIST", default_value = "affine")]
    model: Terms,
    /// Find the best design of N dwells
    #[arg(short, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=200))]
    n: Option<u16>,
    /// Find how many dwells and how long are best within so many minutes, moves included
    #[arg(long, value_name = "MINUTES", value_parser = positive)]
    budget: Option<f64>,
    /// Judge a published scheme
    #[arg(long, value_enum, value_name = "NAME")]
    scheme: Option<SchemeArg>,
    /// Judge all published schemes beside the best designs of as many dwells
    #[arg(long)]
    compare: bool,
    /// What carries the unit; without it three-axis, or hand with --reference gravity
    #[arg(long, value_enum)]
    table: Option<TableArg>,
    /// Length of a dwell, s
    #[arg(long, value_name = "S", default_value_t = 20.0, value_parser = positive, conflicts_with = "budget")]
    dwell: f64,
    /// Rates of the table, deg/s: `10,100,300`, or `..300` for any up to 300
    #[arg(long, value_name = "LIST", default_value = "..300", conflicts_with_all = ["scheme", "compare"])]
    rates: RateList,
    /// Rate at which the attitude is changed, deg/s; without it 10 on a table, 45 by hand
    #[arg(long, value_name = "DPS", value_parser = positive)]
    slew: Option<f64>,
    /// Time from the end of a move to the dwell, s
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = not_negative)]
    settle: f64,
    /// Sigma of a dwell mean, m/s² or rad/s; without it, from --noise and --instability
    #[arg(long, value_name = "SI", value_parser = positive,
          conflicts_with_all = ["budget", "noise", "instability", "walk"])]
    sigma: Option<f64>,
    /// White noise N, m/s² or rad/s per √Hz; without it that of fang's sensors
    #[arg(long, value_name = "SI", value_parser = positive)]
    noise: Option<f64>,
    /// Bias instability B, m/s² or rad/s; without it, what --noise averages to in 20 s
    #[arg(long, value_name = "SI", value_parser = not_negative)]
    instability: Option<f64>,
    /// Random walk K, m/s² or rad/s per √s
    #[arg(long, value_name = "SI", default_value_t = 0.0, value_parser = not_negative)]
    walk: f64,
    /// Seed of the search
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Plan to write, for a table or a person to carry out
    #[arg(short, value_name = "FILE", conflicts_with = "compare")]
    output: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum TableArg {
    /// Every attitude, and a rate about the vertical
    ThreeAxis,
    /// Any turn about the body's z, tilted by at most 95 degrees
    TwoAxis,
    /// Six faces only
    Faces,
    /// Every attitude, by hand
    Hand,
}

#[derive(Clone, Copy, ValueEnum)]
enum SchemeArg {
    /// Each axis up and down
    SixFace,
    /// Nine positions (fang, Table 2)
    FangNine,
    /// 33 accelerometer positions (xu, appendix)
    #[value(name = "xu-33")]
    Xu33,
    /// Rates about each axis in both directions (xu, 2.2.1)
    XuRates,
    /// Eight dwells on a two-axis table (niu, 3.2)
    #[value(name = "niu-8")]
    Niu8,
}

fn not_negative(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(v) if (0.0..=1e9).contains(&v) => Ok(v),
        _ => Err("write a number of at least 0".into()),
    }
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    match not_negative(text) {
        Ok(v) if v >= 1e-12 => Ok(v),
        _ => Err("write a number above 0".into()),
    }
}

impl DesignArgs {
    fn sensor(&self) -> Sensor {
        match self.sensor {
            SensorArg::Gyro => Sensor::Gyro,
            SensorArg::Accel => Sensor::Accel,
        }
    }

    fn carrier(&self) -> Carrier {
        match (self.table, self.reference) {
            (Some(TableArg::ThreeAxis), _) | (None, Reference::Table) => Carrier::ThreeAxis,
            (Some(TableArg::TwoAxis), _) => Carrier::TwoAxis,
            (Some(TableArg::Faces), _) => Carrier::Faces,
            (Some(TableArg::Hand), _) | (None, Reference::Gravity) => Carrier::Hand,
        }
    }

    fn motion(&self) -> Motion {
        let usual = Motion::of(self.carrier());
        Motion {
            slew: self.slew.map_or(usual.slew, f64::to_radians),
            settle_s: self.settle,
            ..usual
        }
    }

    fn noise(&self) -> DwellNoise {
        let fang = DwellNoise::fang(self.sensor());
        let n = self.noise.unwrap_or(fang.n);
        DwellNoise {
            n,
            b: self.instability.unwrap_or(fang.b * n / fang.n),
            k: self.walk,
        }
    }

    /// The problem, with full rates `span` for a gyro.
    fn problem(&self, span: Vector3<f64>, rates: Rates) -> Result<Problem> {
        match (self.sensor(), self.reference) {
            (Sensor::Accel, reference) => {
                Problem::accel(Model::accel(reference, &self.model), self.carrier())
            }
            (Sensor::Gyro, Reference::Table) => {
                Problem::gyro(Model::gyro(&self.model, span), self.carrier(), rates)
            }
            (Sensor::Gyro, Reference::Gravity) => Err(Error::new(
                "gyro, --reference gravity",
                "by hand a gyro's known input are the turns between dwells, which are not designed here",
                "design the accelerometer's dwells and turn by a quarter or more between them",
            )),
        }
    }

    fn report(&self, problem: &Problem, title: String, settings: &[Setting]) -> DesignReport {
        let noise = self.sigma.is_none().then(|| self.noise());
        let sigma = self.sigma.unwrap_or_else(|| self.noise().sigma(self.dwell));
        DesignReport {
            title,
            judgement: problem.judge(settings, sigma),
            problem: problem.clone(),
            dwell_s: self.dwell,
            noise,
            motion: self.motion(),
            scheme: None,
            budget: None,
        }
    }

    fn best(&self, problem: &Problem, n: usize) -> Result<Vec<Setting>> {
        Ok(self.motion().ordered(&problem.best(n, self.seed)?))
    }

    fn scheme(&self, problem: &Problem, scheme: Scheme) -> Result<DesignReport> {
        let title = format!("scheme {}", scheme.name());
        let settings = scheme.settings(self.sensor())?;
        Ok(DesignReport {
            scheme: Some(scheme),
            ..self.report(problem, title, &settings)
        })
    }

    /// Every scheme for the sensor, each followed by the best design of as many dwells.
    fn compare(&self) -> Result<Vec<DesignReport>> {
        let mut reports = Vec::new();
        let mut done: Vec<(usize, Vector3<f64>)> = Vec::new();
        for scheme in Scheme::ALL {
            let Ok(settings) = scheme.settings(self.sensor()) else {
                continue;
            };
            let (n, span) = (settings.len(), scheme.rate_span());
            let problem = self.problem(span, Rates::Any)?;
            reports.push(self.scheme(&problem, scheme)?);
            let enough =
                problem.optimum.parameters <= n * problem.reach.model.distinct_regressions();
            if enough && !done.contains(&(n, span)) {
                done.push((n, span));
                let title = format!("best of {n}");
                reports.push(self.report(&problem, title, &self.best(&problem, n)?));
            }
        }
        Ok(reports)
    }
}

pub fn run(args: &DesignArgs) -> Result<()> {
    check_outputs(&[args.output.as_deref(), args.json.file()], &[])?;
    if args.compare {
        let reports = args.compare()?;
        let (text, json) = (
            report::comparison_text(&reports),
            report::comparison_json(&reports),
        );
        return print(&args.json, &text, &json, None);
    }
    let span = Vector3::repeat(args.rates.largest_dps.to_radians());
    let designed = match (args.scheme, args.budget, args.n) {
        (Some(scheme), ..) => {
            let scheme = match scheme {
                SchemeArg::SixFace => Scheme::SixFace,
                SchemeArg::FangNine => Scheme::FangNine,
                SchemeArg::Xu33 => Scheme::Xu33,
                SchemeArg::XuRates => Scheme::XuRates,
                SchemeArg::Niu8 => Scheme::Niu8,
            };
            args.scheme(&args.problem(scheme.rate_span(), Rates::Any)?, scheme)?
        }
        (_, Some(minutes), _) => {
            let problem = args.problem(span, args.rates.rates.clone())?;
            let budget_s = 60.0 * minutes;
            let budget = spend(&problem, &args.noise(), &args.motion(), budget_s, args.seed)?;
            let best = &budget.best;
            let title = format!("best within {minutes} min (seed {})", args.seed);
            DesignReport {
                judgement: problem.judge(&best.all(), best.sigma),
                dwell_s: best.dwell_s,
                budget: Some((budget_s, budget)),
                ..args.report(&problem, title, &[])
            }
        }
        (_, _, n) => {
            let n = usize::from(n.unwrap_or_default());
            let problem = args.problem(span, args.rates.rates.clone())?;
            let title = format!("best of {n} dwells found (seed {})", args.seed);
            args.report(&problem, title, &args.best(&problem, n)?)
        }
    };
    let mut text = report::design_text(&designed);
    let mut plan = None;
    if let Some(path) = &args.output {
        plan = Some(stage(path, designed.plan())?);
        text.push_str(&format!("\nplan: {}\n", path.display()));
    }
    print(&args.json, &text, &report::design_json(&designed), plan)
}
