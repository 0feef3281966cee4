//! `mimu thermal plan`: arguments and execution.

use std::path::PathBuf;

use clap::Args;
use mimu::plan::design::budget::DwellNoise;
use mimu::signal::blocks::extent;
use mimu::{NoiseFile, Sensor};
use mimu_recording::error::Result;
use mimu_thermal::basis::Shape;
use mimu_thermal::plan::{Procedure, Request, plan, to_toml};

use crate::arguments::{JsonArgs, choice, number, range_c};
use crate::output::{Results, check_outputs};
use crate::overwriting::check_overwritten;
use crate::report;

#[derive(Args)]
pub(super) struct PlanArgs {
    /// Sequence of temperatures and motions
    #[arg(long, value_parser = choice(&[
        ("soak", "Set points; the unit soaks at each before it is measured (fang, 4.4)", Procedure::Soak),
        ("niu", "Positions and quarter turns on a ramp up and down (niu, 3.2)", Procedure::Niu),
        ("ramp", "Six faces and rates about all axes on a ramp up and down", Procedure::Ramp),
        ("rest-ramp", "At rest with z up on a ramp up: biases only", Procedure::RestRamp),
    ]))]
    procedure: Procedure,
    /// Temperatures of the chamber, °C
    #[arg(long, value_name = "FROM..TO", default_value = "-10..70", allow_hyphen_values = true, value_parser = range_c)]
    range: [f64; 2],
    /// Temperatures of the chamber in turn, °C, each with the minutes it is held, for niu and ramp; 25,-35:30,75:60,-35:30 is niu's first profile
    #[arg(long, value_name = "C[:MIN],...", value_delimiter = ',', allow_hyphen_values = true, value_parser = held, conflicts_with_all = ["range", "soak"])]
    course: Vec<[f64; 2]>,
    /// Curves of all parameters over temperature, for the prediction
    #[arg(long, default_value = "cubic", value_parser = choice(&[
        ("line", "A straight line, from 10 K", Shape::Line),
        ("cubic", "One cubic, from 20 K", Shape::Cubic),
    ]))]
    curves: Shape,
    /// Rate of the chamber, K/min
    #[arg(long, value_name = "K/MIN", default_value_t = 2.0, value_parser = |t: &str| number(t, 0.01, 30.0))]
    rate: f64,
    /// Set points of a soak
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u16).range(1..=100))]
    points: u16,
    /// Return through the set points of a soak, as niu does
    #[arg(long)]
    both_ways: bool,
    /// Time at each set point, or before and after a ramp, min [default: 60 for a soak, 30 for the others]
    #[arg(long, value_name = "MIN", value_parser = |t: &str| number(t, 0.0, 2880.0))]
    soak: Option<f64>,
    /// Length of a dwell, s [default: 9 for niu, 20 for the others]
    #[arg(long, value_name = "S", value_parser = |t: &str| number(t, 0.1, 3600.0))]
    dwell: Option<f64>,
    /// Largest rate of the table, deg/s; turns of niu are at 10 or less
    #[arg(long, value_name = "DPS", default_value_t = 50.0, value_parser = |t: &str| number(t, 0.1, 10_000.0))]
    table_rate: f64,
    /// Noise file of the unit (`mimu allan -o`) [default: that of fang's sensors]
    #[arg(long, value_name = "FILE")]
    noise: Option<PathBuf>,
    /// Samples a second
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = |t: &str| number(t, 1.0, 20_000.0))]
    sample_rate: f64,
    /// Plan to write, for `mimu-rig record` or a person at a chamber
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgs,
}

/// A temperature, °C, and the time that it is held, s.
fn held(text: &str) -> std::result::Result<[f64; 2], String> {
    let (temp_c, min) = text.split_once(':').unwrap_or((text, "0"));
    match (temp_c.parse(), min.parse::<f64>()) {
        (Ok(c), Ok(min)) if (-100.0..=300.0).contains(&c) && (0.0..=2880.0).contains(&min) => {
            Ok([c, 60.0 * min])
        }
        _ => Err("write a temperature and the minutes it is held, as -35:30".into()),
    }
}

impl PlanArgs {
    fn request(&self) -> Result<Request> {
        let procedure = self.procedure;
        let noise = match &self.noise {
            None => Sensor::BOTH.map(DwellNoise::fang),
            Some(path) => {
                let file = NoiseFile::read(path)?;
                let of = |sensor| DwellNoise::from_file(&file, sensor);
                [of(Sensor::Gyro)?, of(Sensor::Accel)?]
            }
        };
        let usual_min = if procedure == Procedure::Soak {
            60.0
        } else {
            30.0
        };
        let usual_s = if procedure == Procedure::Niu {
            9.0
        } else {
            20.0
        };
        Ok(Request {
            procedure,
            range_c: match self.course.as_slice() {
                [] => self.range,
                course => extent(course.iter().map(|[temp_c, _]| *temp_c)),
            },
            shape: self.curves,
            kelvin_per_min: self.rate,
            set_points: usize::from(self.points),
            both_ways: self.both_ways,
            course: self.course.clone(),
            soak_s: 60.0 * self.soak.unwrap_or(usual_min),
            dwell_s: self.dwell.unwrap_or(usual_s),
            largest_dps: self.table_rate,
            sample_rate_hz: self.sample_rate,
            noise,
        })
    }
}

pub(super) fn run(args: &PlanArgs) -> Result<()> {
    check_outputs(&[args.output.as_deref(), args.json.file()], &args.noise)?;
    check_overwritten(&[args.output.as_deref()])?;
    let planned = plan(&args.request()?)?;
    let mut out = Results::new(report::thermal_plan_text(&planned));
    let made = || Ok(to_toml(&planned, args.sample_rate));
    out.file("plan", args.output.as_ref(), made)?;
    out.print(&args.json, &planned)
}
