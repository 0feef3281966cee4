//! `mimu-diagnosis/1`.

use serde_json::{Map, Value, json};

use super::DiagnosisReport;
use mimu::result::verify::VerifyResult;
use mimu::calibration::ConverterTable;
use mimu::diagnose::decision::{Accepted, Decision, Split};
use mimu::diagnose::{Diagnosis, SensorDiagnosis};
use mimu::quantity::Sensor;

/// Result of `mimu diagnose`.
pub fn diagnosis_json(report: &DiagnosisReport) -> Value {
    let d = &report.diagnosis;
    let all = |of: &dyn Fn(&SensorDiagnosis) -> Vec<Value>| -> Vec<Value> {
        d.sensors.iter().flat_map(of).collect()
    };
    let sensors: Map<String, Value> = d
        .sensors
        .iter()
        .map(|s| (s.sensor.name().to_string(), sensor(d, s)))
        .collect();
    let mut value = json!({
        "format": "mimu-diagnosis/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "device": d.before.prepared.manifest.device,
        "recordings": d.sources.iter()
            .map(|s| json!({ "samples": s.place, "rows": s.rows, "period_s": s.period_s, "sha256": s.sha256 }))
            .collect::<Vec<_>>(),
        "verdict": d.verdict.name(),
        "effects": all(&|s| s.decision.accepted.iter().map(|a| accepted(s.sensor, a)).collect()),
        "rejected": all(&|s| pairs(&s.decision.rejected, "reason")),
        "not_excited": pairs(&report.next.not_excited, "experiment"),
        "confused": report.next.confused.iter()
            .map(|c| json!({ "ids": c.ids, "difference": c.difference, "experiment": c.experiment }))
            .collect::<Vec<_>>(),
        "sensors": sensors,
        "undecided": all(&|s| undecided(&s.decision)),
        "leftover": all(&|s| leftover(s.sensor, &s.decision)),
        "warnings": d.after.warnings,
    });
    if let Some((name, [before, after])) = &report.second {
        value["second"] = json!({
            "recording": name,
            "before": VerifyResult::of(before),
            "after": VerifyResult::of(after),
        });
    }
    value
}

fn pairs(list: &[(String, String)], key: &str) -> Vec<Value> {
    list.iter()
        .map(|(id, why)| json!({ "id": id, key: why }))
        .collect()
}

fn number(value: f64) -> Value {
    match value.is_finite() {
        true => value.into(),
        false => Value::Null,
    }
}

fn split(split: Split) -> &'static str {
    match split {
        Split::Blocks => "blocks",
        Split::Interleaved => "interleaved",
    }
}

fn accepted(sensor: Sensor, a: &Accepted) -> Value {
    let names = a.chosen.candidate.names();
    let coefficients: Vec<Value> = names
        .iter()
        .enumerate()
        .map(|(i, (name, unit))| {
            json!({
                "name": name,
                "value": a.values[i],
                "sigma": a.covariance[(i, i)].sqrt(),
                "unit": unit,
            })
        })
        .collect();
    let mut value = json!({
        "id": a.chosen.candidate.id(),
        "sensor": sensor.name(),
        "coefficients": coefficients,
        "held_out_rms_before": number(a.held_out[0]),
        "held_out_rms_after": number(a.held_out[1]),
        "held_out": split(a.split),
        "chance": a.chosen.p,
        "alternatives": a.chosen.alternatives.iter()
            .map(|(id, worse)| json!({ "id": id, "score_worse_by": worse }))
            .collect::<Vec<_>>(),
    });
    if let Some(second) = a.second {
        value["second"] = json!({
            "rms_before": number(second.rms[0]),
            "rms_after": number(second.rms[1]),
            "chi2_before": number(second.chi2[0]),
            "chi2_after": number(second.chi2[1]),
            "expected_sigmas": number(second.expected),
        });
    }
    if let Some(form) = a.chosen.candidate.form() {
        value["form"] = json!({ "name": form.name, "value": a.chosen.form });
    }
    let converters = ConverterTable::of(&a.chosen.candidate.codes);
    if !converters.is_empty() {
        let table = |c: &ConverterTable| {
            json!({
                "axes": c.axes,
                "weight_of_bit_0_raw": c.weight_of_bit_0_raw,
                "reading_of_code_0_raw": c.reading_of_code_0_raw,
                "reading_of_code_0_within_raw": c.reading_of_code_0_within_raw,
            })
        };
        value["converters"] = converters.iter().map(table).collect();
    }
    value
}

fn sensor(d: &Diagnosis, s: &SensorDiagnosis) -> Value {
    let decision = &s.decision;
    let figure = d.before.sensor(s.sensor).map(|f| f.figure);
    json!({
        "unit": figure.map(|f| f.unit(s.sensor)),
        "rms_before": decision.rms[0],
        "rms_after": decision.rms[1],
        "held_out_rms_before": number(decision.held_out_rms[0]),
        "held_out_rms_after": number(decision.held_out_rms[1]),
        "held_out": split(decision.split),
        "interleaved_rms_after": number(decision.interleaved_rms),
        "noise_floor": decision.noise_floor,
        "notes": decision.notes,
        "rows": decision.rows[0],
        "affine_parameters": decision.rows[1],
        "omnibus_chance": decision.omnibus_p,
    })
}

fn undecided(decision: &Decision) -> Vec<Value> {
    let one = |u: &mimu::diagnose::decision::Undecided| json!({ "id": u.id, "law": u.law, "difference": u.worse, "experiment": u.settled_by });
    decision.undecided.iter().map(one).collect()
}

fn leftover(sensor: Sensor, decision: &Decision) -> Vec<Value> {
    let one = |l: &mimu::diagnose::decision::Leftover| {
        json!({
            "sensor": sensor.name(),
            "axis": l.axis.map(|a| mimu::quantity::AXES[a]),
            "rows": l.stratum,
            "against": l.against,
            "usual": l.usual,
            "strength": l.strength,
        })
    };
    decision.leftover.iter().map(one).collect()
}
