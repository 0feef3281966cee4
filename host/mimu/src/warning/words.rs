//! Warnings in words. These sentences are for people; no code may depend on them.

use std::fmt;

use mimu_recording::RAW_COLUMNS;
use mimu_recording::error::Error;

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
    format!(
        "its magnitude of specific force differs by {} mm/s² from what the other dwells predict",
        significant(1e3 * error)
    )
}

/// The first eight names.
pub(super) fn few(names: &[String]) -> String {
    let more = if names.len() > 8 { ", ..." } else { "" };
    names[..names.len().min(8)].join(", ") + more
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
    let each: Vec<String> = each
        .map(|(v, half)| format!("{v:.1} ± {half:.1}"))
        .collect();
    each.join(", ")
}

pub(super) fn degrees(rad: f64) -> String {
    significant(rad.abs().to_degrees())
}

pub(super) fn bias_moved(
    sensor: &Sensor,
    t_s: &f64,
    moved: &[f64; 3],
    half_width: &[f64; 3],
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let (factor, unit) = Figure::Input.readable(*sensor);
    let written = |si: &[f64; 3]| si.map(|v| significant(v * factor)).join(", ");
    let begun = match t_s.is_finite() {
        true => format!("from the restart at {t_s:.1} s on"),
        false => "before the first restart".into(),
    };
    write!(
        f,
        "{sensor}: {begun}, the bias is more by {} {unit} (to {}): this is not judged",
        written(moved),
        written(half_width)
    )
}

pub(super) fn repeated(rows: &u64, f: &mut fmt::Formatter) -> fmt::Result {
    match rows {
        1 => f.write_str("1 row repeats the row before, time included: left out"),
        n => write!(f, "{n} rows repeat the row before, time included: left out"),
    }
}

pub(super) fn dwells_not_used(
    dwells: &[String],
    fault: &Fault,
    sensor: &Option<Sensor>,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let verb = if dwells.len() == 1 { "is" } else { "are" };
    let count = plural(dwells.len() as u64, "dwell");
    write!(f, "{count} ({}) {verb} not used: ", few(dwells))?;
    match (fault, sensor) {
        (Fault::TooShort, _) => write!(f, "shorter than {SHORTEST_S} s"),
        (Fault::Turning, _) => f.write_str("the unit turns evenly instead of resting"),
        (Fault::NotStill, Some(sensor)) => write!(f, "not still enough for the {sensor}"),
        (Fault::TooFast, Some(sensor)) => write!(
            f,
            "the input of the {sensor} moves too far within a tenth of a second, by two fifths of its range"
        ),
        (other, _) => write!(f, "{other}"),
    }
}

pub(super) fn gravity(
    gravity_mps2: &f64,
    latitude_deg: &f64,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let normal = normal_gravity(*latitude_deg);
    let ppm = ((gravity_mps2 - normal) / normal * 1e6).abs();
    write!(
        f,
        "gravity_mps2 is given as {gravity_mps2} m/s², but at sea level at latitude_deg {latitude_deg}° it is {normal:.5}, and no height explains the difference. If gravity_mps2 is wrong, every scale factor of the accelerometer is wrong by {ppm:.0} ppm: check both"
    )
}

pub(super) fn other_gravity(
    gravity_mps2: &[f64; 2],
    force_mps2: &f64,
    contradicted: &bool,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let [ours, theirs] = gravity_mps2;
    let ppm = 1e6 * (theirs / ours - 1.0).abs();
    write!(
        f,
        "gravity is {ours:.5} m/s² in the calibration and {theirs:.5} m/s² in the recording, a difference of {ppm:.0} ppm, and the calibrated force at rest has a magnitude of {force_mps2:.5} m/s²: "
    )?;
    let who = match contradicted {
        true => {
            "the readings contradict the gravity of the recording; give both the gravity of their place"
        }
        false => "if both were recorded at one place, one of the two is wrong",
    };
    f.write_str(who)
}

pub(super) fn without_temperature(
    low_c: &f64,
    high_c: &f64,
    sensor: &Option<Sensor>,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let whose = match sensor {
        None => "the model",
        Some(Sensor::Gyro) => "the gyro's model",
        Some(Sensor::Accel) => "the accelerometer's model",
    };
    write!(
        f,
        "the dwells range from {low_c:.1} to {high_c:.1} °C, but {whose} does not depend on temperature"
    )
}

pub(super) fn dwell_kept(
    dwell: &i32,
    error: &f64,
    parameter: &str,
    wider: &f64,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let why = if error.is_finite() {
        off(*error)
    } else {
        "it is suspect".into()
    };
    write!(
        f,
        "dwell {dwell} is kept for the accelerometer, although {why}: {}, so it cannot be tested; repeat its pose",
        open(parameter, *wider)
    )
}

pub(super) fn turn_not_used(
    from: &i32,
    to: &i32,
    fault: &Option<Fault>,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    write!(f, "the turn from dwell {from} to {to} is not used: ")?;
    match fault {
        Some(Fault::Saturated(c)) => write!(f, "{} is at its rail", RAW_COLUMNS[*c]),
        Some(Fault::Stuck(c)) => write!(f, "{} is stuck", RAW_COLUMNS[*c]),
        Some(other) => write!(f, "{other}"),
        None => f.write_str("samples are missing"),
    }
}

pub(super) fn matrix_given(with_intervals: &bool, f: &mut fmt::Formatter) -> fmt::Result {
    match with_intervals {
        true => f.write_str("the matrix and its intervals are given; the biases are those of this recording, and the intervals include both uncertainties"),
        false => f.write_str("the matrix is given without intervals, so no interval includes its error; the biases are those of this recording"),
    }
}

pub(super) fn not_held_out(
    blocks: &bool,
    parts: &[usize],
    why: &str,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let name = if *blocks { "block" } else { "part" };
    match parts {
        [one] => write!(f, "{name} {one} cannot be held out: without it, {why}"),
        all => {
            let all: Vec<String> = all.iter().map(usize::to_string).collect();
            write!(
                f,
                "{name}s {} cannot be held out: without the first of these, {why}",
                all.join(", ")
            )
        }
    }
}

pub(super) fn left_out_changes(
    changed: &usize,
    of: &usize,
    largest: &[String],
    f: &mut fmt::Formatter,
) -> fmt::Result {
    match (changed, of, largest) {
        (0, _, largest) => write!(
            f,
            "leaving out dwells or turns changes no parameter by more than its interval; the largest change: {}",
            largest.join("; ")
        ),
        (moved, of, largest) => write!(
            f,
            "leaving out dwells or turns changes {moved} of {of} parameters by more than their intervals, most of all: {}",
            largest.join("; ")
        ),
    }
}

pub(super) fn no_better(
    errors: &[f64; 2],
    unit: &str,
    held_out: &bool,
    undecided: &Option<usize>,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let [came, calibrated] = errors;
    let how = if *held_out {
        "on held-out data"
    } else {
        "in sample"
    };
    let [came, calibrated] = [came, calibrated].map(|v| significant(*v));
    write!(
        f,
        "the error of the uncalibrated readings is {came} {unit}, that of the calibrated ones {calibrated} {unit} {how}: "
    )?;
    match undecided {
        None => f.write_str("this calibration does not improve the readings"),
        Some(count) => write!(
            f,
            "{count} errors do not show whether this calibration improves the readings"
        ),
    }
}

pub(super) fn unseen_poses(
    directions: &[String],
    worst: &f64,
    typical: &f64,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let [worst, typical] = [worst, typical].map(|v| significant(1e3 * v));
    write!(
        f,
        "no pose is near {} up, where the calibration is uncertain by {worst} mm/s² (one sigma); in the recorded poses it is {typical} mm/s². Add such poses before you use it there",
        directions.join(", ")
    )
}

pub(super) fn follows_temperature(
    without: &f64,
    with: &f64,
    mean_c: &f64,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let [without, with] = [without, with].map(|share| significant(100.0 * share));
    write!(
        f,
        "a model without temperature leaves {without} % of the readings unexplained, one with temperature {with} %. The parameters are valid at about {mean_c:.1} °C, the mean of the dwells, and their intervals include the effect of temperature; `mimu diagnose` finds this effect"
    )
}

pub(super) fn outliers(
    turns: &bool,
    names: &[String],
    worst: &f64,
    unit: &str,
    times: &f64,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let what = if *turns { "turn to dwell" } else { "dwell" };
    write!(
        f,
        "{} ({what} {}): errors of up to {} {unit}, {times:.0} times the median; look for the cause, because they widen all intervals",
        plural(names.len() as u64, "outlier"),
        few(names),
        significant(*worst)
    )
}

pub(super) fn rate_error(rates_dps: &[f64], share: &f64, f: &mut fmt::Formatter) -> fmt::Result {
    let list: Vec<String> = rates_dps.iter().map(|r| significant(*r)).collect();
    let factors = match rates_dps.len() {
        1 => "its share is a common factor of all scale factors",
        _ => "each rate has a separate share, and these are factors of all scale factors",
    };
    write!(
        f,
        "the turntable's rate of {} deg/s is known to ±{} % (95 %): {factors}. Their intervals include it, and no number of dwells reduces it",
        list.join(" and "),
        significant(100.0 * share)
    )
}

pub(super) fn turned(angle: &f64, to_table: &bool, f: &mut fmt::Formatter) -> fmt::Result {
    let against = if *to_table {
        "those of the ref_ columns"
    } else {
        "the accelerometer's"
    };
    write!(
        f,
        "its axes are rotated by {:.0} degrees relative to {against}: unless it is mounted so, columns are swapped or have the wrong sign",
        angle.to_degrees()
    )
}

pub(super) fn unnamed_unit(unnamed: &[bool; 2], f: &mut fmt::Formatter) -> fmt::Result {
    let who = match unnamed {
        [true, true] => "calibration and recording name no unit",
        [true, false] => "the calibration names no unit",
        [false, _] => "the recording names no unit",
    };
    write!(
        f,
        "{who}, so they are taken to belong to one; to have this checked, give each import the name of its unit"
    )
}

pub(super) fn out_of_range(
    samples: &[u64; 2],
    range_c: &[f64; 2],
    farthest_k: &f64,
    beyond_k: &Option<f64>,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let [count, of] = samples;
    let [from, to] = range_c;
    write!(
        f,
        "{count} of {of} samples are outside the {from:.1} to {to:.1} °C that the calibration was made from, by up to {farthest_k:.1} K: "
    )?;
    match beyond_k {
        Some(beyond) => write!(
            f,
            "its beyond_k continue in a straight line for {beyond} K and are constant beyond"
        ),
        None => f.write_str(
            "it has no beyond_k over temperature: fit one with recordings over temperature",
        ),
    }
}

pub(super) fn worse(readings_in_si: &bool, f: &mut fmt::Formatter) -> fmt::Result {
    let question = if *readings_in_si {
        "this unit"
    } else {
        "this unit, in this state"
    };
    write!(
        f,
        "worse than with {}: is it the calibration of {question}?",
        without(*readings_in_si)
    )
}

pub(super) fn undecided(
    errors: &u64,
    turns: &bool,
    readings_in_si: &bool,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let noun = if *turns { "turn" } else { "dwell" };
    write!(
        f,
        "{} do not show whether it is better than {}: record more",
        plural(*errors, noun),
        without(*readings_in_si)
    )
}

pub(super) fn not_judged(
    recording: &Option<String>,
    why: &Error,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    match (recording, why) {
        (Some(recording), why) => write!(f, "{recording} cannot judge the calibration: {why}"),
        (None, why) => write!(f, "{why}"),
    }
}

pub(super) fn moves(
    windows: &[usize; 2],
    window_s: &f64,
    first_s: &f64,
    channel: &str,
    f: &mut fmt::Formatter,
) -> fmt::Result {
    let [count, of] = windows;
    write!(
        f,
        "the unit moves, or something shakes it, in {count} of {of} windows of {}, {} % of the time, first at {first_s:.1} s ({channel})",
        duration(*window_s),
        significant(100.0 * *count as f64 / *of as f64)
    )
}
