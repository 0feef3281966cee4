//! The same for people.

use std::fmt::Write as _;
use std::path::Path;

use mimu_core::wire::Counters;

use super::{counters, passed, triad_name, triad_units};
use crate::report::text::warn;
use mimu::quantity::significant;
use mimu_device::record::RecordSummary;
use mimu_device::{
    Checked, Contents, Image, KalmanRun, LineCount, SelfTested, Stream, Streamed, Uploaded, Who,
    slot,
};

const AXES: [&str; 3] = ["x", "y", "z"];

/// Writing to a string does not fail.
macro_rules! line {
    ($out:expr, $($of:tt)*) => { let _ = writeln!($out, $($of)*); };
}

/// Result of `mimu device info`.
pub fn info_text(port: &str, who: &Who) -> String {
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
        "started       {}, {} since power came",
        who.start,
        starts(who.starts)
    );
    line!(
        out,
        "samples       {} Hz, {} in {}",
        who.sample_rate_hz,
        who.channels.join(", "),
        who.raw_unit
    );
    match who.stored {
        None => {
            line!(out, "calibration   none");
        }
        Some(s) => {
            line!(
                out,
                "calibration   {:016x}, {} bytes, temperature nodes: {}, effects: {}",
                s.hash,
                s.length,
                s.nodes,
                s.effects
            );
        }
    }
    for (name, of) in ["first", "second"].iter().zip(&who.slots) {
        line!(out, "{name:<6} place  {}", slot(of));
    }
    line!(out, "can           {}", who.capability_names().join(", "));
    line!(
        out,
        "room          {} temperature nodes, {} effects of a kind and triad, {} bytes",
        who.nodes_room,
        who.effects_room,
        who.stored_room
    );
    line!(out, "removes       {}", who.effect_ids().join(", "));
    warn(&mut out, who.version_warning().into_iter());
    out
}

fn starts(count: u32) -> String {
    match count {
        1 => "1 start".into(),
        n => format!("{n} starts"),
    }
}

/// Result of `mimu device upload`.
pub fn upload_text(port: &str, image: &Image, done: &Uploaded) -> String {
    let mut out = String::new();
    let hash = done.hash;
    match (done.was_there, done.before) {
        (true, _) => {
            line!(
                out,
                "{port}: holds {hash:016x} already ({} bytes, read back)",
                done.length
            );
        }
        (false, before) => {
            let before = before.map_or("none".into(), |hash| format!("{hash:016x}"));
            line!(
                out,
                "{port}: stored {hash:016x} ({} bytes, read back); before: {before}",
                done.length
            );
        }
    }
    if !image.effects.is_empty() {
        line!(out, "effects: {}", image.effects.join(", "));
    }
    if done.repeated > 0 || done.restarts > 0 {
        line!(
            out,
            "messages sent again: {}, restarts of the device: {}",
            done.repeated,
            done.restarts
        );
    }
    warn(&mut out, image.warnings.iter());
    out
}

/// Result of `mimu device download`.
pub fn download_text(port: &str, path: &Path, bytes: &[u8], contents: &Contents) -> String {
    let mut out = String::new();
    let hash = mimu_core::stored::hash(bytes);
    line!(
        out,
        "{port}: calibration {hash:016x}, {} bytes",
        bytes.len()
    );
    line!(
        out,
        "x = C u + o, raw to SI: u in V at the sensors, x in rad/s and m/s², body frame"
    );
    for node in &contents.nodes {
        line!(out, "\nat {} °C", node.temp_c);
        for (i, sensor) in ["gyro", "accel"].iter().enumerate() {
            line!(out, "  {sensor:<6} {:>42}   {:>14}", "C", "o");
            for (row, o) in node.c[i].iter().zip(node.o[i]) {
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
    for effect in &contents.effects {
        let numbers: Vec<String> = effect
            .coefficients
            .iter()
            .map(|c| format!("{c:e}"))
            .collect();
        line!(out, "\neffect {}: {}", effect.id, numbers.join(", "));
        if let Some(time) = effect.time_constant_s {
            line!(out, "  time constant {time} s");
        }
        if let Some(converter) = &effect.converter {
            line!(
                out,
                "  converter of {}: bit 0 is worth {} V, code 0 reads {} V",
                converter.axes,
                converter.weight_of_bit_0_v,
                converter.reading_of_code_0_v
            );
        }
    }
    line!(out, "\nimage: {}", path.display());
    out
}

/// Result of `mimu device self-test`.
pub fn self_test_text(port: &str, found: &SelfTested) -> String {
    let test = &found.test;
    let mut out = String::new();
    line!(out, "{port}: self-test");
    let passed = passed(test);
    let word = |ok: bool| if ok { "passed" } else { "FAILED" };
    for i in 0..3 {
        line!(
            out,
            "gyro {}   {}   ST1 {:+.3} V, ST2 {:+.3} V",
            AXES[i],
            word(passed[i]),
            test.gyro_st1_v[i],
            test.gyro_st2_v[i]
        );
    }
    let volts = |v: &[f32; 3]| format!("{:.3}, {:.3}, {:.3} V", v[0], v[1], v[2]);
    line!(
        out,
        "accel    {}   finest range {}, coarsest {}",
        word(passed[3]),
        volts(&test.accel_fine_v),
        volts(&test.accel_coarse_v)
    );
    if let Some(moved) = &found.moved {
        line!(out, "the unit did not stand still: {moved}");
    }
    out
}

/// Result of `mimu device counters`.
pub fn counters_text(port: &str, of: &Counters, reset: bool) -> String {
    let mut out = String::new();
    line!(
        out,
        "{port}: counted since the start, or since they were reset"
    );
    for (name, value) in counters(of) {
        line!(out, "{name:<20} {value:>10}");
    }
    if reset {
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

/// Result of `mimu device stream`, beside the samples.
pub fn stream_text(port: &str, which: Stream, found: &Streamed) -> String {
    let mut out = String::new();
    let units = match which {
        Stream::Raw => ["V", "V"],
        Stream::Compensated => ["rad/s", "m/s²"],
    };
    line!(
        out,
        "{port}: {} samples, {} missing, {:.2} °C",
        found.samples,
        found.missing,
        found.temp_c
    );
    for i in 0..6 {
        line!(
            out,
            "{:<5} {}  mean {:>13.6}  deviation {:>9} {}",
            ["gyro", "accel"][i / 3],
            AXES[i % 3],
            found.mean[i],
            significant(found.deviation[i]),
            units[i / 3]
        );
    }
    line_text(&mut out, &found.line);
    out
}

/// Result of `mimu device check`.
pub fn check_text(port: &str, found: &Checked) -> String {
    let mut out = String::new();
    line!(
        out,
        "{port}: {} samples compared, {} without a counterpart",
        found.samples,
        found.unpaired
    );
    line!(out, "largest difference, device less PC:");
    for (i, (sensor, unit)) in [("gyro", "rad/s"), ("accel", "m/s²")].iter().enumerate() {
        let d = &found.differences[i];
        line!(
            out,
            "{sensor:<6} same precision {} ulps ({} {unit}), double precision {} {unit}, {:.0} % of what rounding allows",
            d.ulps,
            significant(d.single),
            significant(d.double),
            100.0 * d.share
        );
    }
    match (found.holds(), found.remembering.is_empty()) {
        (true, _) => {
            line!(out, "device and PC agree to rounding");
        }
        (false, false) => {
            line!(
                out,
                "not judged: {} goes by temperatures before the comparison",
                found.remembering.join(", ")
            );
        }
        (false, true) => {
            line!(out, "device and PC DIFFER");
        }
    }
    out
}

/// Result of `mimu device kalman`.
pub fn kalman_text(port: &str, run: &KalmanRun) -> String {
    let mut out = String::new();
    let (scale, unit) = triad_units(run.triad);
    line!(
        out,
        "{port}: Kalman bank of the {}, forward model u = P x + b, SI to raw",
        triad_name(run.triad)
    );
    for (input, first, last) in &run.inputs {
        line!(
            out,
            "input {:>9} {:>9} {:>9} {unit}   samples {first} to {last}",
            input[0],
            input[1],
            input[2]
        );
    }
    line!(
        out,
        "              device          sigma            PC   difference / sigma"
    );
    let distances = run.distances();
    for i in 0..3 {
        for (k, name) in ["b", "P1", "P2", "P3"].iter().enumerate() {
            line!(
                out,
                "{} {name:<3} {:>14.7} {:>14} {:>13.7}   {:>10}   {}",
                AXES[i],
                run.device[i].mean[k],
                significant(run.device[i].sigma[k]),
                run.host[i].mean[k],
                significant(distances[i][k]),
                if k == 0 { "V" } else { scale }
            );
        }
    }
    line!(
        out,
        "largest difference {} sigma; samples rejected: {}",
        significant(run.largest()),
        run.rejected
    );
    out
}

/// Result of `mimu record`.
pub fn record_text(port: &str, directory: &Path, summary: &RecordSummary) -> String {
    let mut out = String::new();
    let s = &summary.standing;
    let (first, last) = s.span_s.unwrap_or_default();
    line!(
        out,
        "{port}: {} samples from {first:.3} to {last:.3} s, {} missing in {} gaps, {:.2} °C",
        s.samples,
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
    for (count, what) in [
        (
            s.saturated,
            "in batches with a reading at the end of the converter's range",
        ),
        (
            s.without_reference,
            "without the gyros' reference: their drift with the supply is in them",
        ),
        (s.self_test, "while the self-test deflected the sensors"),
    ] {
        if count > 0 {
            warnings.push(format!("{count} samples {what}"));
        }
    }
    warn(&mut out, warnings.iter());
    line!(out, "recording: {}", directory.display());
    out
}
