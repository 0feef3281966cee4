//! Warnings in words, where a sentence has several forms. These sentences are for people; no code may depend on them.

use mimu_recording::RAW_COLUMNS;

use crate::fault::{Fault, SHORTEST_S};
use crate::quantity::{Figure, Sensor, duration, normal_gravity, plural, significant};

/// How uncertain `parameter` would be without a dwell or a turn.
pub(super) fn open(parameter: &str, grows: f64) -> String {
    match grows < 1e3 {
        true => format!(
            "without it the interval of {parameter} would be {} times as wide",
            significant(grows)
        ),
        false => format!("nothing else determines {parameter}"),
    }
}

pub(super) fn off(error: f64) -> String {
    let off = significant(1e3 * error);
    format!(
        "its magnitude of specific force differs by {off} mm/s² from what the other dwells predict"
    )
}

/// The first eight names.
pub(super) fn few(names: &[String]) -> String {
    let more = if names.len() > 8 { ", ..." } else { "" };
    names[..names.len().min(8)].join(", ") + more
}

/// Numbers as a person reads them, each times `factor`.
pub(super) fn list(numbers: &[f64], factor: f64) -> String {
    let each = numbers.iter().map(|v| significant(v * factor));
    each.collect::<Vec<_>>().join(", ")
}

/// What a calibration that does no better was compared with.
pub(super) fn without(readings_in_si: bool) -> &'static str {
    match readings_in_si {
        true => "the uncalibrated readings",
        false => "its own mean scale factor and mean bias on all three axes, without misalignment",
    }
}

/// Three values with the halves of their intervals.
pub(super) fn vector(values: &[f64; 3], halves: &[f64; 3]) -> String {
    let each = values.iter().zip(halves);
    let each = each.map(|(v, half)| format!("{v:.1} ± {half:.1}"));
    each.collect::<Vec<_>>().join(", ")
}

pub(super) fn degrees(rad: f64) -> String {
    significant(rad.abs().to_degrees())
}

pub(super) fn bias_moved(sensor: Sensor, t_s: f64, moved: &[f64], half_width: &[f64]) -> String {
    let (factor, unit) = Figure::Input.readable(sensor);
    let begun = match t_s.is_finite() {
        true => format!("from the restart at {t_s:.1} s on"),
        false => "before the first restart".into(),
    };
    format!(
        "{sensor}: {begun}, the bias is more by {} {unit} (to {}): this is not judged",
        list(moved, factor),
        list(half_width, factor)
    )
}

pub(super) fn not_used(dwells: &[String], fault: &Fault, sensor: Option<Sensor>) -> String {
    let verb = if dwells.len() == 1 { "is" } else { "are" };
    let count = plural(dwells.len() as u64, "dwell");
    let why = match (fault, sensor) {
        (Fault::TooShort, _) => format!("shorter than {SHORTEST_S} s"),
        (Fault::Turning, _) => "the unit turns evenly instead of resting".into(),
        (Fault::NotStill, Some(sensor)) => format!("not still enough for the {sensor}"),
        (Fault::TooFast, Some(sensor)) => format!(
            "the input of the {sensor} moves too far within a tenth of a second, by two fifths of its range"
        ),
        (other, _) => other.to_string(),
    };
    format!("{count} ({}) {verb} not used: {why}", few(dwells))
}

pub(super) fn gravity(gravity_mps2: f64, latitude_deg: f64) -> String {
    let normal = normal_gravity(latitude_deg);
    let ppm = ((gravity_mps2 - normal) / normal * 1e6).abs();
    format!(
        "gravity_mps2 is given as {gravity_mps2} m/s², but at sea level at latitude_deg {latitude_deg}° it is {normal:.5}, and no height explains the difference. If gravity_mps2 is wrong, every scale factor of the accelerometer is wrong by {ppm:.0} ppm: check both"
    )
}

pub(super) fn other_gravity([ours, theirs]: [f64; 2], force: f64, contradicted: bool) -> String {
    let ppm = 1e6 * (theirs / ours - 1.0).abs();
    let who = match contradicted {
        true => {
            "the readings contradict the gravity of the recording; give both the gravity of their place"
        }
        false => "if both were recorded at one place, one of the two is wrong",
    };
    format!(
        "gravity is {ours:.5} m/s² in the calibration and {theirs:.5} m/s² in the recording, a difference of {ppm:.0} ppm, and the calibrated force at rest has a magnitude of {force:.5} m/s²: {who}"
    )
}

/// Whose model.
pub(super) fn model(sensor: Option<Sensor>) -> &'static str {
    match sensor {
        None => "the model",
        Some(Sensor::Gyro) => "the gyro's model",
        Some(Sensor::Accel) => "the accelerometer's model",
    }
}

pub(super) fn turn_fault(fault: &Option<Fault>) -> String {
    match fault {
        Some(Fault::Saturated(c)) => format!("{} is at its rail", RAW_COLUMNS[*c]),
        Some(Fault::Stuck(c)) => format!("{} is stuck", RAW_COLUMNS[*c]),
        Some(other) => other.to_string(),
        None => "samples are missing".into(),
    }
}

pub(super) fn not_held_out(blocks: bool, parts: &[usize], why: &str) -> String {
    let name = if blocks { "block" } else { "part" };
    let all: Vec<String> = parts.iter().map(usize::to_string).collect();
    let all = all.join(", ");
    match parts {
        [_] => format!("{name} {all} cannot be held out: without it, {why}"),
        _ => format!("{name}s {all} cannot be held out: without the first of these, {why}"),
    }
}

pub(super) fn left_out_changes(changed: usize, of: usize, largest: &[String]) -> String {
    let largest = largest.join("; ");
    match changed {
        0 => format!(
            "leaving out dwells or turns changes no parameter by more than its interval; the largest change: {largest}"
        ),
        _ => format!(
            "leaving out dwells or turns changes {changed} of {of} parameters by more than their intervals, most of all: {largest}"
        ),
    }
}

pub(super) fn improves(undecided: Option<usize>) -> String {
    match undecided {
        None => "this calibration does not improve the readings".into(),
        Some(count) => {
            format!("{count} errors do not show whether this calibration improves the readings")
        }
    }
}

pub(super) fn rate_error(rates_dps: &[f64], share: f64) -> String {
    let list: Vec<String> = rates_dps.iter().map(|r| significant(*r)).collect();
    let factors = match rates_dps.len() {
        1 => "its share is a common factor of all scale factors",
        _ => "each rate has a separate share, and these are factors of all scale factors",
    };
    format!(
        "the turntable's rate of {} deg/s is known to ±{} % (95 %): {factors}. Their intervals include it, and no number of dwells reduces it",
        list.join(" and "),
        significant(100.0 * share)
    )
}

/// Who names no unit.
pub(super) fn unnamed(unnamed: [bool; 2]) -> &'static str {
    match unnamed {
        [true, true] => "calibration and recording name no unit",
        [true, false] => "the calibration names no unit",
        [false, _] => "the recording names no unit",
    }
}

pub(super) fn beyond(beyond_k: Option<f64>) -> String {
    match beyond_k {
        Some(beyond) => {
            format!("its curves continue in a straight line for {beyond} K and are constant beyond")
        }
        None => {
            "it has no curves over temperature: fit one with recordings over temperature".into()
        }
    }
}

pub(super) fn moves([count, of]: [usize; 2], window_s: f64, first_s: f64, channel: &str) -> String {
    format!(
        "the unit moves, or something shakes it, in {count} of {of} windows of {}, {} % of the time, first at {first_s:.1} s ({channel})",
        duration(window_s),
        significant(100.0 * count as f64 / of as f64)
    )
}
