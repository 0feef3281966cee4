//! `mimu-allan/1`.

use serde_json::{Value, json};

use mimu::allan::Point;
use mimu::allan::model::{NoiseModel, Term};
use mimu::allan::recording::{Channel, Survey};

/// Result of `mimu allan`, of one recording or of several of one unit.
pub fn allan_json(surveys: &[Survey]) -> Value {
    let channels = surveys
        .iter()
        .flat_map(|survey| survey.channels.iter().map(move |c| channel(survey, c)));
    let warnings = surveys.iter().flat_map(|survey| {
        let named = move |w: &String| match surveys.len() {
            1 => w.clone(),
            _ => format!("{}: {w}", survey.recording),
        };
        survey.warnings.iter().map(named)
    });
    let first = surveys.first();
    let mut value = json!({
        "format": "mimu-allan/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "device": first.map(|s| &s.device),
        "kind": first.map(|s| s.options.kind.name()),
        "confidence": first.map(|s| s.options.confidence),
        "channels": channels.collect::<Vec<_>>(),
        "warnings": warnings.collect::<Vec<_>>(),
    });
    if let [survey] = surveys {
        value["sample_rate_hz"] = survey.sample_rate_hz.into();
        value["span_s"] = survey.span_s.to_vec().into();
    }
    value
}

fn channel(survey: &Survey, channel: &Channel) -> Value {
    let column = |of: fn(&Point) -> f64| channel.curve.iter().map(of).collect::<Vec<_>>();
    let model = channel.model.as_ref();
    let mut value = json!({
        "name": channel.name,
        "recording": survey.recording,
        "temp_c": survey.temp_c,
        "unit": channel.unit.name,
        "samples": channel.samples,
        "tau_s": column(|p| p.tau_s),
        "adev": column(|p| p.deviation),
        "lower": column(|p| p.lower),
        "upper": column(|p| p.upper),
        "edf": column(|p| p.edf),
        "alpha": channel.curve.iter().map(|p| p.alpha).collect::<Vec<_>>(),
        "fang_7": column(|p| p.fang_7),
        "model": model.map(|m| m_json(m, channel)),
        "useful_average_s": model.and_then(|m| m.useful_average_s()),
    });
    let (mut reasons, mut bounds) = (serde_json::Map::new(), serde_json::Map::new());
    for term in Term::ALL {
        let key = term.letter().to_lowercase();
        value[&key] = match model.map(|m| m.get(term)) {
            Some(Ok(c)) => json!({
                "value": c.value,
                "sigma": c.sigma,
                "lower": c.lower,
                "upper": c.upper,
                "unit": channel.unit.coefficient(term),
            }),
            missing => {
                let why = missing
                    .and_then(Result::err)
                    .unwrap_or(super::text::TOO_SHORT);
                reasons.insert(key.clone(), why.into());
                bounds.insert(key.clone(), model.and_then(|m| m.at_most(term)).into());
                Value::Null
            }
        };
    }
    value["reasons"] = reasons.into();
    value["at_most"] = bounds.into();
    if let Some(hadamard) = &channel.hadamard {
        let column = |of: fn(&Point) -> f64| hadamard.iter().map(of).collect::<Vec<_>>();
        value["hadamard"] = json!({
            "tau_s": column(|p| p.tau_s),
            "hdev": column(|p| p.deviation),
            "lower": column(|p| p.lower),
            "upper": column(|p| p.upper),
        });
    }
    value
}

fn m_json(model: &NoiseModel, channel: &Channel) -> Value {
    let at: Vec<f64> = channel
        .curve
        .iter()
        .map(|p| model.deviation(p.tau_s))
        .collect();
    json!({
        "range_s": model.range_s,
        "filtered": model.filtered,
        "excess": model.excess,
        "adev": at,
    })
}
