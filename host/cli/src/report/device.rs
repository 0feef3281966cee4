//! Results of the device's commands and recordings from it, as text.

use std::fmt::Write as _;

use super::text::warn;
use mimu::quantity::{AXES, Sensor, significant};
use mimu::readable::STANDARD_GRAVITY;
use mimu_core::wire::Counters;
use mimu_device::record::RecordSummary;
use mimu_device::{
    Contents, Counted, DeviceResult, Identity, LineCount, SelfTested, Streamed, Uploaded, Verdict,
};

/// Writes a line to a string, which cannot fail.
macro_rules! line {
    ($out:expr, $($of:tt)*) => { let _ = writeln!($out, $($of)*); };
}
pub(super) use line;

/// Result of `mimu device info`.
pub fn info_text(result: &DeviceResult<&Identity>) -> String {
    let (port, who) = (&result.port, result.found);
    let mut out = String::new();
    line!(out, "{port}: {}, firmware {}", who.board, who.firmware);
    line!(out, "unit          {}", who.unit_id);
    line!(
        out,
        "protocol      {}.{}",
        who.protocol.major,
        who.protocol.minor
    );
    line!(
        out,
        "started       {}, {} since power-on",
        who.start,
        starts(who.starts)
    );
    let powered = match who.powered_for_ms {
        Some(ms) => format!("{:.1} s before sampling began", f64::from(ms) / 1000.0),
        None => "unknown: a reset has lost it".into(),
    };
    line!(out, "power-on      {powered}");
    if let Some(level) = who.brown_out_level {
        line!(out, "brown-out     {}", brown_out(level));
    }
    line!(
        out,
        "samples       {} Hz{}, 6 channels in {}",
        who.sample_rate_hz,
        match (who.rate_measured, who.nominal_rate_hz) {
            (false, _) => " nominal, not measured yet".into(),
            (true, Some(nominal)) if nominal != who.sample_rate_hz => {
                format!(" measured, {nominal} nominal")
            }
            _ => String::new(),
        },
        who.raw_unit
    );
    for (sensor, triad) in who.sensors.iter() {
        let (range, unit) = sensor_range(sensor, triad.range);
        line!(
            out,
            "{sensor:<13} {}, range {range} {unit}, {} bits, filter {}",
            triad.part,
            triad.bits,
            triad.filter
        );
    }
    line!(out, "thermometers  {}", who.thermometers.join(", "));
    match &who.stored {
        None => {
            line!(out, "calibration   none");
        }
        Some(s) => {
            line!(
                out,
                "calibration   {}, {} bytes, temperature nodes: {}, effects: {}",
                s.hash,
                s.bytes,
                s.nodes,
                s.effects
            );
            line!(
                out,
                "              {}",
                origin(
                    s.unit_id.as_deref(),
                    Some(&who.unit_id),
                    s.created.as_deref()
                )
            );
        }
    }
    for (name, of) in ["first", "second"].iter().zip(&who.slots) {
        line!(out, "{name:<6} place  {of}");
    }
    line!(out, "can           {}", who.capability_names().join(", "));
    line!(
        out,
        "room          {} temperature nodes, {} effects of a kind and triad, {} bytes",
        who.room.nodes,
        who.room.effects,
        who.room.bytes
    );
    line!(out, "removes       {}", who.effects.join(", "));
    warn(&mut out, who.warnings.iter());
    out
}

/// What a level of the brown-out reset means (DS12110, table 15: falling thresholds).
fn brown_out(level: u8) -> String {
    let volts = ["1.62", "2.0", "2.3", "2.6"];
    let reset = volts
        .get(usize::from(level))
        .map_or_else(String::new, |v| format!(", reset below {v} V"));
    let remark = match level {
        0..=2 => {
            "; set level 3 with a debugger, so that a failing supply does not tear what is being stored"
        }
        _ => "",
    };
    format!("level {level}{reset}{remark}")
}

/// A range in the unit of data sheets.
fn sensor_range(sensor: Sensor, range: f64) -> (String, &'static str) {
    let (value, unit) = match sensor {
        Sensor::Gyro => (range.to_degrees(), "deg/s"),
        Sensor::Accel => (range / STANDARD_GRAVITY, "g"),
    };
    // Single precision of SI is no digit of a data sheet.
    (format!("{}", (value * 1e3).round() / 1e3), unit)
}

fn starts(count: u32) -> String {
    match count {
        1 => "1 start".into(),
        n => format!("{n} starts"),
    }
}

/// Result of `mimu device upload`.
pub fn upload_text(result: &DeviceResult<Uploaded>) -> String {
    let mut out = String::new();
    let (port, done) = (&result.port, &result.found);
    let (hash, bytes) = (done.hash, done.bytes);
    if done.was_there {
        line!(
            out,
            "{port}: already stored: {hash} ({bytes} bytes, read back)"
        );
    } else {
        let before = done.before.map_or("none".into(), |hash| hash.to_string());
        line!(
            out,
            "{port}: stored {hash} ({bytes} bytes, read back); before: {before}"
        );
    }
    if !done.effects.is_empty() {
        line!(out, "effects: {}", done.effects.join(", "));
    }
    if done.repeated > 0 || done.restarts > 0 {
        line!(
            out,
            "messages repeated: {}, restarts of the device: {}",
            done.repeated,
            done.restarts
        );
    }
    warn(&mut out, done.warnings.iter());
    out
}

/// Result of `mimu device download`.
pub fn download_text(result: &DeviceResult<Contents>) -> String {
    let mut out = String::new();
    let (port, found) = (&result.port, &result.found);
    line!(
        out,
        "{port}: calibration {}, {} bytes",
        found.hash,
        found.bytes
    );
    line!(
        out,
        "{}",
        origin(found.unit_id.as_deref(), None, found.created.as_deref())
    );
    line!(
        out,
        "{}, {}: u in {} at the sensors, x in rad/s and m/s², {} frame",
        found.formula,
        found.direction,
        found.raw_unit.unwrap_or("the device's raw unit"),
        found.frame
    );
    if let Some(at) = &found.trimmed {
        line!(out, "offsets trimmed {at}");
    }
    if let Some([from, to]) = found.range_c {
        line!(out, "valid for dies at {from} to {to} °C");
    }
    if let Some(lag_s) = found.lag_s {
        let accel = found.accel_lag_s;
        let accel = accel.map(|s| format!(", of the accelerometer's {s} s"));
        line!(
            out,
            "lag of the dies behind the thermometer {lag_s} s{}",
            accel.unwrap_or_default()
        );
    }
    if found.nodes.len() > 1 {
        line!(out, "{} between the nodes", found.between_nodes);
    }
    for node in &found.nodes {
        line!(out, "\nat {} °C", node.temp_c);
        for (sensor, model, is_slope) in [
            ("gyro", &node.gyro, false),
            ("accel", &node.accel, false),
            ("gyro/K", &node.gyro_slope, true),
            ("accel/K", &node.accel_slope, true),
        ] {
            let mut numbers = model.C.as_flattened().iter().chain(&model.o);
            if is_slope && numbers.all(|x| *x == 0.0) {
                continue;
            }
            line!(out, "  {sensor:<6} {:>42}   {:>14}", "C", "o");
            for (row, o) in model.C.iter().zip(model.o) {
                line!(
                    out,
                    "         {:>14e}{:>14e}{:>14e}   {o:>14e}",
                    row[0],
                    row[1],
                    row[2]
                );
            }
        }
    }
    for effect in &found.effects {
        let numbers = effect.coefficients().iter().map(|c| format!("{c:e}"));
        let numbers: Vec<String> = numbers.collect();
        line!(out, "\neffect {effect}: {}", numbers.join(", "));
        if let Some(time) = effect.nonlinear() {
            line!(out, "  time constant {time} s");
        }
    }
    if let Some(file) = &found.file {
        line!(
            out,
            "\ncalibration: {file} (without standard deviations and covariance, which the device does not store)"
        );
    }
    if let Some(file) = &found.bytes_file {
        line!(out, "\nbytes: {file}");
    }
    out
}

/// The unit and date of a calibration. `held_by`: the unit that stores it.
fn origin(of: Option<&str>, held_by: Option<&str>, created: Option<&str>) -> String {
    let unit = match (of, held_by) {
        (None, _) => "of an unknown unit".to_string(),
        (Some(of), Some(unit)) if of == unit => "of this unit".to_string(),
        (Some(of), Some(_)) => format!("of ANOTHER unit, {of}"),
        (Some(of), None) => format!("of unit {of}"),
    };
    let made = created.map_or("unknown when".to_string(), |at| format!("made {at}"));
    format!("{unit}, {made}")
}

/// Result of `mimu device self-test`.
pub fn self_test_text(result: &DeviceResult<SelfTested>) -> String {
    let found = &result.found;
    let mut out = String::new();
    line!(out, "{}: self-test", result.port);
    for row in &found.results {
        let word = match row.verdict {
            Verdict::Passed => "passed",
            Verdict::Failed => "FAILED",
            Verdict::NotShown => "not shown",
        };
        let [least, most] = row.limits;
        line!(
            out,
            "{:<14}  {word:<9}  {:>8.3} {}, limits {least:.3} to {most:.3}",
            row.name,
            row.value,
            row.unit
        );
    }
    let not_shown = found.named(Verdict::NotShown);
    if !not_shown.is_empty() {
        line!(
            out,
            "not shown in this pose: {}; the axis is perpendicular to gravity, where a stuck one reads the same; test again with it up",
            not_shown.join("; ")
        );
    }
    if let Some(moved) = &found.moved {
        line!(out, "the unit did not stand still: {moved}");
    }
    out
}

/// In the order of the message's fields.
fn counters(of: &Counters) -> [(&'static str, u32); 14] {
    [
        ("uptime_ms", of.uptime_ms),
        ("samples", of.samples),
        ("last", of.last),
        ("late", of.late),
        ("converter_overruns", of.converter_overruns),
        ("stalls", of.stalls),
        ("queue_overruns", of.queue_overruns),
        ("batches_dropped", of.batches_dropped),
        ("frames_garbled", of.frames_garbled),
        ("receiver_overruns", of.receiver_overruns),
        ("refused", of.refused),
        ("flash_corrected", of.flash_corrected),
        ("flash_uncorrectable", of.flash_uncorrectable),
        ("longest_us", of.longest_us),
    ]
}

/// Result of `mimu device counters`.
pub fn counters_text(result: &DeviceResult<Counted>) -> String {
    let mut out = String::new();
    line!(
        out,
        "{}: counted since the start, or since the last reset of the counters",
        result.port
    );
    for (name, value) in counters(&result.found.counters) {
        line!(out, "{name:<20} {value:>10}");
    }
    if result.found.reset {
        line!(out, "the counters were reset");
    }
    out
}

fn line_text(out: &mut String, count: &LineCount) {
    if count.garbled > 0 || count.not_understood > 0 {
        line!(
            out,
            "line: {} frames garbled, {} not understood, {} whole",
            count.garbled,
            count.not_understood,
            count.frames
        );
    }
}

/// Result of `mimu device stream`, without the samples.
pub fn stream_text(result: &DeviceResult<Streamed>) -> String {
    let mut out = String::new();
    let found = &result.found;
    line!(
        out,
        "{}: {} samples, {} missing, {:.2} °C",
        result.port,
        found.samples,
        found.missing,
        found.temp_c
    );
    for (sensor, moments) in [("gyro", &found.gyro), ("accel", &found.accel)] {
        for (i, axis) in AXES.iter().enumerate() {
            line!(
                out,
                "{sensor:<5} {axis}  mean {:>13.6}  deviation {:>9} {}",
                moments.mean[i],
                significant(moments.deviation[i]),
                printed(&moments.unit)
            );
        }
    }
    if !found.thermometers.is_empty() {
        let all = found.thermometers.iter();
        let all: Vec<String> = all
            .map(|t| format!("{} {:.2} °C", t.place, t.temp_c))
            .collect();
        line!(out, "thermometers: {}", all.join(", "));
    }
    line_text(&mut out, &found.line);
    warn(&mut out, found.flagged.warnings().iter());
    out
}

/// A unit in its printed form.
pub(super) fn printed(unit: &str) -> String {
    unit.replace("^2", "²")
}

/// Result of `mimu record`.
pub fn record_text(summary: &RecordSummary) -> String {
    let mut out = String::new();
    let s = &summary.state;
    line!(
        out,
        "{}: {} samples from {:.3} to {:.3} s, {} missing in {} gaps, {:.2} °C",
        summary.port,
        s.samples,
        s.first_s.unwrap_or_default(),
        s.last_s.unwrap_or_default(),
        s.missing,
        s.gaps,
        s.temp_c
    );
    if s.dwells > 0 {
        line!(out, "dwells: {}", s.dwells);
    }
    line_text(&mut out, &s.line);
    let mut warnings: Vec<String> = s
        .restarts
        .iter()
        .map(|r| format!("the device restarted before {:.3} s: {}", r.t_s, r.start))
        .collect();
    warnings.extend(s.warnings.iter().cloned());
    if s.reconnected > 0 {
        warnings.push(format!(
            "the port vanished and came back {} times: the samples in between are missing",
            s.reconnected
        ));
    }
    warnings.extend(s.flagged.warnings());
    warn(&mut out, warnings.iter());
    line!(out, "recording: {}", summary.recording);
    out
}
