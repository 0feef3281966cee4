//! Comments at the head of every file: the calibrated unit, the formula, and the remaining errors.

use mimu::{Calibration, NoiseFile, Sensor};

use crate::judged::JudgedSource;
use crate::{Export, Noise, Sources, body};

/// Header of a file, without comment signs.
pub(crate) fn of(export: &Export, from: &Sources) -> Vec<String> {
    let has_noise = matches!(export.noise, Noise::Needed | Noise::Only);
    let noise = from.noise.filter(|_| has_noise);
    let calibration = from.calibration.map(|(calibration, _)| calibration);
    let calibration = calibration.filter(|_| export.noise != Noise::Only);
    let unit = |id: &Option<String>| {
        id.as_ref()
            .map_or_else(String::new, |id| format!("unit {id}, "))
    };
    let rested = |noise: &NoiseFile| match noise.duration_s.is_finite() {
        true => format!("from {:.0} s at rest", noise.duration_s),
        false => format!("from {}", noise.place),
    };
    let mut lines = Vec::new();
    let mut begin = |device: &str, line: String| {
        let (to, version) = (export.to, env!("CARGO_PKG_VERSION"));
        lines.push(format!("{device}: for {to}, by mimu {version}"));
        lines.push(line);
    };
    if let Some(of) = calibration {
        let date = of.created.as_deref().unwrap_or("an unknown date");
        begin(
            &of.device,
            format!("{}calibrated {date}", unit(&of.unit_id)),
        );
        lines.extend(noise.map(|noise| format!("noise of {} {}", noise.device, rested(noise))));
        lines.extend(Sensor::BOTH.iter().flat_map(|s| of_sensor(of, *s)));
        let further = of.body.iter().filter(|_| export.further_triads);
        lines.extend(further.map(body::line));
    } else if let Some(of) = from.biases {
        let (unit, date, raw_unit) = (unit(&of.unit_id), &of.created, of.recording.raw_unit);
        begin(
            &of.device,
            format!(
                "{unit}biases over temperature from a recording at rest, evaluated {date}; readings in {raw_unit}"
            ),
        );
    } else if let Some(of) = noise {
        let date = of.created.as_deref().unwrap_or("at an unknown date");
        begin(&of.device, format!("{}, evaluated {date}", rested(of)));
    }
    lines.extend(export.judgements.iter().map(JudgedSource::line));
    lines.extend(after_judgements(export));
    lines
}

fn of_sensor(calibration: &Calibration, sensor: Sensor) -> Vec<String> {
    let table = calibration.table(sensor).map(|table| {
        let (raw_unit, unit, frame) = (table.raw_unit, &table.unit, &table.frame);
        format!("{sensor}: readings in {raw_unit}, output in {unit} in the frame {frame:?}")
    });
    let effects = Some(calibration.effects_of(sensor).join(", ")).filter(|e| !e.is_empty());
    let effects = effects.map(|effects| {
        format!("{sensor}: right only with the effects {effects}: x = C (u - S e) + o, with e their error and S the scale factors")
    });
    table.into_iter().chain(effects).collect()
}

/// Lines for the terminal, where a judgement that is not good is a warning.
pub(crate) fn for_terminal(export: &Export) -> Vec<String> {
    let line = |source: &JudgedSource| match source.is_good() {
        true => source.line(),
        false => format!("warning: {}", source.line()),
    };
    let judgements = export.judgements.iter().map(line);
    judgements.chain(after_judgements(export)).collect()
}

fn after_judgements(export: &Export) -> Vec<String> {
    let mut lines = export.formulas.clone();
    lines.extend(export.notes.iter().cloned());
    for (head, errors) in [
        (
            "Errors of the calibration itself, which remain in every program:",
            &export.calibration_errors,
        ),
        ("What this format adds to those errors:", &export.remaining),
    ] {
        if !errors.is_empty() {
            lines.push(head.into());
            lines.extend(errors.iter().map(|r| format!("  {}", r.line())));
        }
    }
    lines
}

/// `lines` as comments with the sign `sign`.
pub(crate) fn comments(sign: &str, lines: &[String]) -> String {
    let line = |line: &String| format!("{sign} {line}").trim_end().to_string() + "\n";
    lines.iter().map(line).collect()
}
