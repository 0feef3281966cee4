//! The next experiment, as text, JSON and plan.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::text::{minutes, wrapped};
use mimu::design::plan::round;
use mimu::design::settle::{Answer, Question};
use mimu::quantity::Figure;
use mimu::quantity::significant;
use mimu_recording::Reference;

/// An experiment that settles effects, with what was asked.
#[derive(Debug, Clone)]
pub struct NextReport<'a> {
    /// What was asked.
    pub question: &'a Question<'a>,
    /// The experiment.
    pub answer: &'a Answer,
    /// Name of the unit, if it is known.
    pub device: Option<String>,
    /// Sample rate of the recording to come, Hz.
    pub sample_rate_hz: f64,
}

impl NextReport<'_> {
    fn subject(&self) -> String {
        let ids: Vec<&str> = self.answer.settled.iter().map(|s| s.id.as_str()).collect();
        ids.join(", ")
    }

    /// The plan, as a file.
    pub fn plan(&self) -> String {
        self.answer
            .plan(self.device.as_deref(), self.sample_rate_hz)
    }
}

/// Result of `mimu design --effects`.
pub fn next_text(report: &NextReport) -> String {
    let (question, answer) = (report.question, report.answer);
    let mut out = String::new();
    let _ = writeln!(out, "to show {}", report.subject());
    wrapped(&mut out, "experiment", &answer.words());
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:<28}{text}");
    };
    line("time", minutes(answer.time_s));
    for sensor in &question.sensors {
        let sigma = question.noise_of(*sensor).sigma(question.dwell_s);
        let (factor, unit) = Figure::Input.readable(*sensor);
        line(
            "sigma of a dwell mean",
            format!("{sensor} {} {unit}", significant(sigma * factor)),
        );
    }
    for s in &answer.settled {
        let said = match (s.possible(), s.done()) {
            (false, _) => "cannot be seen".to_string(),
            (true, done) => format!(
                "{:.1} sigmas at the size of data sheets{}",
                s.sigmas,
                if done {
                    String::new()
                } else {
                    format!(", {:.0} wanted", s.wanted)
                }
            ),
        };
        line(&s.id, said);
    }
    let _ = writeln!(
        out,
        "\n  {:<6}{:>10}{:>9}{:>9}{:>9}{:>11}{:>9}",
        "dwell", "up: x", "y", "z", "deg/s", "begins, s", "°C"
    );
    for (i, stop) in answer.stops.iter().enumerate() {
        let up = stop.setting.up;
        let temperature = match answer.chamber_c.is_empty() {
            true => "-".into(),
            false => format!("{:.1}", stop.warm_c + mimu::diagnose::effect::REFERENCE_C),
        };
        let _ = writeln!(
            out,
            "  {:<6}{:>10.4}{:>9.4}{:>9.4}{:>9.1}{:>11.0}{temperature:>9}",
            i + 1,
            up.x + 0.0,
            up.y + 0.0,
            up.z + 0.0,
            stop.setting.rate.to_degrees(),
            stop.t_s - 0.5 * stop.dwell_s,
        );
    }
    out
}

/// The same as JSON. A design for effects is judged by them, and has no D-efficiency.
pub fn next_json(report: &NextReport) -> Value {
    let (question, answer) = (report.question, report.answer);
    let positions: Vec<[f64; 3]> = answer.stops.iter().map(|s| s.setting.up.into()).collect();
    let rates: Vec<f64> = answer
        .stops
        .iter()
        .map(|s| s.setting.rate.to_degrees())
        .collect();
    let begins: Vec<f64> = answer
        .stops
        .iter()
        .map(|s| round(s.t_s - 0.5 * s.dwell_s, 1e3))
        .collect();
    let effects: Vec<Value> = answer
        .settled
        .iter()
        .map(|s| {
            json!({
                "id": s.id,
                "sigmas": s.sigmas,
                "wanted": s.wanted,
                "settled": s.done(),
                "cannot": s.lost,
                "not_told_from": s.twins,
            })
        })
        .collect();
    let sigmas: Vec<Value> = answer
        .settled
        .iter()
        .flat_map(|s| {
            s.coefficients.iter().map(|(name, unit, sigma)| {
                json!({ "name": format!("{} {name}", s.id), "value": sigma, "unit": unit })
            })
        })
        .collect();
    json!({
        "format": "mimu-design/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "title": format!("to show {}", report.subject()),
        "experiment": answer.words(),
        "reference": match question.reference {
            Reference::Table => "table",
            Reference::Gravity => "gravity",
        },
        "table": answer.carrier.name(),
        "effects": effects,
        "positions": positions,
        "rates_dps": rates,
        "begin_s": begins,
        "chamber_c": answer.chamber_c,
        "cold_start": answer.cold,
        "beside_recording": answer.together,
        "d_efficiency": Value::Null,
        "sigma_per_parameter": sigmas,
        "dwell_s": answer.dwell_s,
        "order": "lot",
        "time_s": answer.time_s,
    })
}
