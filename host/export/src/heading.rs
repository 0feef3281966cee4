//! Comments at the head of every file: the calibrated unit, the formula, and the remaining errors.

use mimu::calibration::Calibration;
use mimu::calibration::thermal_biases::ThermalBiases;
use mimu::noise::noise_file::NoiseFile;
use mimu::quantity::Sensor;

use crate::judged::JudgedSource;
use crate::{Export, Sources};

/// Header of a file made from a calibration, without comment signs.
pub fn of_calibration(calibration: &Calibration, export: &Export) -> Vec<String> {
    let date = calibration.created.as_deref().unwrap_or("an unknown date");
    let mut lines = vec![first_line(&calibration.device, export)];
    let unit = match &calibration.unit_id {
        Some(id) => format!("unit {id}, "),
        None => String::new(),
    };
    lines.push(format!("{unit}calibrated {date}"));
    for sensor in Sensor::BOTH {
        if let Some(table) = calibration.table(sensor) {
            lines.push(format!(
                "{sensor}: readings in {}, output in {} in the frame {:?}",
                table.raw_unit, table.unit, table.frame
            ));
        }
        let effects = calibration.effects_of(sensor);
        if !effects.is_empty() {
            lines.push(format!(
                "{sensor}: right only with the effects {}: x = C (u - S e) + o, with e their error and S the scale factors",
                effects.join(", ")
            ));
        }
    }
    lines.extend(notes_and_remaining(export));
    lines
}

/// Header of a file made from biases over temperature alone, without comment signs.
pub fn of_biases(biases: &ThermalBiases, export: &Export) -> Vec<String> {
    let unit = match &biases.unit_id {
        Some(id) => format!("unit {id}, "),
        None => String::new(),
    };
    let mut lines = vec![
        first_line(&biases.device, export),
        format!(
            "{unit}biases over temperature from a recording at rest, evaluated {}; readings in {}",
            biases.created, biases.recording.raw_unit
        ),
    ];
    lines.extend(notes_and_remaining(export));
    lines
}

/// Header of a file made from noise, without comment signs.
pub fn of_noise(noise: &NoiseFile, export: &Export) -> Vec<String> {
    let mut lines = vec![
        first_line(&noise.device, export),
        format!(
            "from {:.0} s at rest, evaluated {}",
            noise.duration_s,
            noise.created.as_deref().unwrap_or("at an unknown date")
        ),
    ];
    lines.extend(notes_and_remaining(export));
    lines
}

/// Length of the recording that the noise was estimated from.
pub fn noise_from(noise: &NoiseFile) -> String {
    format!(
        "noise of {} from {:.0} s at rest",
        noise.device, noise.duration_s
    )
}

/// For a format without curves: the temperature at which the exported calibration is valid.
pub fn temperature(calibration: &Calibration) -> Option<String> {
    calibration.temperature.as_ref()?;
    let temp_c = calibration.recording.temp_c?;
    Some(format!("The numbers are those at {temp_c:.1} °C."))
}

/// A note on a calibration that a program cannot take.
pub fn needs_calibrated(from: &Sources) -> Option<String> {
    from.calibration.map(|_| {
        "The program has no place for a calibration: it needs calibrated readings, as `mimu apply` and the device make them.".into()
    })
}

/// Lines after the first ones, for the file.
fn notes_and_remaining(export: &Export) -> Vec<String> {
    let judgements = export.judgements.iter().map(JudgedSource::line);
    judgements.chain(after_judgements(export)).collect()
}

/// The same for the terminal, where a judgement that is not good is a warning.
pub fn for_terminal(export: &Export) -> Vec<String> {
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
pub fn comments(sign: &str, lines: &[String]) -> String {
    let line = |line: &String| format!("{sign} {line}").trim_end().to_string() + "\n";
    lines.iter().map(line).collect()
}

fn first_line(device: &str, export: &Export) -> String {
    let (to, version) = (export.to, env!("CARGO_PKG_VERSION"));
    format!("{device}: for {to}, by mimu {version}")
}
