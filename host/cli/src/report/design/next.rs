//! The next experiment, as text, JSON and plan.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::text::{LISTED, minutes, wrapped};
use mimu::design::plan::round;
use mimu::next_experiment::recipe::Course;
use mimu::next_experiment::{Answer, Setup};
use mimu::quantity::Figure;
use mimu::quantity::significant;
use mimu_recording::Reference;

/// An experiment that shows effects, with what it is made with.
#[derive(Debug, Clone)]
pub struct NextReport<'a> {
    /// The unit and its fixture.
    pub setup: &'a Setup,
    /// The experiment.
    pub answer: &'a Answer,
    /// Name of the unit, if it is known.
    pub device: Option<String>,
    /// Sample rate of the recording to come, Hz.
    pub sample_rate_hz: f64,
}

impl NextReport<'_> {
    fn subject(&self) -> String {
        let each = self.answer.predictions.iter();
        each.map(|p| p.id.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The plan, as a file.
    pub fn plan(&self) -> String {
        let device = self.device.as_deref();
        self.answer.plan(self.setup, device, self.sample_rate_hz)
    }
}

/// Result of `mimu design --effects`.
pub fn next_text(report: &NextReport) -> String {
    let (setup, answer) = (report.setup, report.answer);
    let experiment = &answer.experiment;
    let mut out = String::new();
    let _ = writeln!(out, "to show {}", report.subject());
    wrapped(&mut out, "experiment", &answer.words(setup));
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:<28}{text}");
    };
    line("time", minutes(experiment.time_s));
    for sensor in &setup.sensors {
        let sigma = setup.noise_of(*sensor).sigma(setup.dwell_s);
        let (factor, unit) = Figure::Input.readable(*sensor);
        line(
            "sigma of a dwell mean",
            format!("{sensor} {} {unit}", significant(sigma * factor)),
        );
    }
    for p in &answer.predictions {
        let [share, wanted] = [p.share, p.wanted].map(|s| 100.0 * s);
        line(
            &p.id,
            format!("sigma at most {share:.1} % of the typical size, {wanted:.0} % wanted"),
        );
    }
    let _ = writeln!(
        out,
        "\n  {:<6}{:>10}{:>9}{:>9}{:>9}{:>11}",
        "dwell", "up: x", "y", "z", "deg/s", "begins, s"
    );
    let each = experiment.settings.iter().zip(&experiment.begin_s);
    for (i, (setting, begin_s)) in each.enumerate().take(LISTED) {
        let up = setting.up;
        let _ = writeln!(
            out,
            "  {:<6}{:>10.4}{:>9.4}{:>9.4}{:>9.1}{begin_s:>11.0}",
            i + 1,
            up.x + 0.0,
            up.y + 0.0,
            up.z + 0.0,
            setting.rate.to_degrees(),
        );
    }
    let more = experiment.settings.len().saturating_sub(LISTED);
    if more > 0 {
        let _ = writeln!(out, "  ... and {more} more: -o and --json have them");
    }
    out
}

/// The same as JSON. A design for effects is judged by them, and has no D-efficiency.
pub fn next_json(report: &NextReport) -> Value {
    let (setup, answer) = (report.setup, report.answer);
    let experiment = &answer.experiment;
    let settings = experiment.settings.iter();
    let positions: Vec<[f64; 3]> = settings.clone().map(|s| s.up.into()).collect();
    let rates: Vec<f64> = settings.map(|s| s.rate.to_degrees()).collect();
    let begins: Vec<f64> = experiment.begin_s.iter().map(|t| round(*t, 1e3)).collect();
    let predictions = answer.predictions.iter();
    let effects: Vec<Value> = predictions
        .clone()
        .map(|p| {
            json!({
                "id": p.id,
                "sigmas": 1.0 / p.share,
                "wanted": (1.0 / p.wanted).round(),
                "settled": p.done(),
            })
        })
        .collect();
    let sigmas: Vec<Value> = predictions
        .flat_map(|p| {
            p.coefficients.iter().map(|(name, unit, sigma)| {
                json!({ "name": format!("{} {name}", p.id), "value": sigma, "unit": unit })
            })
        })
        .collect();
    json!({
        "format": "mimu-design/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "title": format!("to show {}", report.subject()),
        "experiment": answer.words(setup),
        "reference": match setup.reference {
            Reference::Table => "table",
            Reference::Gravity => "gravity",
        },
        "table": setup.carrier.name(),
        "effects": effects,
        "positions": positions,
        "rates_dps": rates,
        "begin_s": begins,
        "chamber_c": experiment.chamber_c,
        "cold_start": experiment.recipe.course != Course::Dwells,
        "d_efficiency": Value::Null,
        "sigma_per_parameter": sigmas,
        "dwell_s": experiment.dwell_s,
        "order": "lot",
        "time_s": experiment.time_s,
    })
}
