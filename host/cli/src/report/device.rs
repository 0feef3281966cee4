//! Results of the device's commands and recordings from it.

use maud::{Markup, html};
use mimu::{AXES, STANDARD_GRAVITY, Sensor, plural, significant};
use mimu_device::record::RecordSummary;
use mimu_device::{
    Checked, Contents, Counted, DeviceResult, Identity, KalmanRun, LineCount, SelfTested, Streamed,
    Trimmed, Uploaded, Verdict,
};

use super::page::all_warnings;
use super::table::{number, table};
use super::terminal::text;

/// Result of `mimu device info`.
pub fn info_text(result: &DeviceResult<&Identity>) -> String {
    let who = result.found;
    text(&html! {
        p { (result.port) ": " (who.board) ", firmware " (who.firmware) }
        dl class="aligned" {
            dt { "unit" } dd { (who.unit_id) }
            dt { "protocol" } dd { (who.protocol.major) "." (who.protocol.minor) }
            dt { "started" } dd { (who.start) ", " (plural(who.starts.into(), "start")) " since power-on" }
            dt { "power-on" } dd { @match who.powered_for_ms {
                Some(ms) => (format!("{:.1} s before sampling began", f64::from(ms) / 1000.0)),
                None => "unknown: a reset has lost it",
            } }
            @if let Some(level) = who.brown_out_level { dt { "brown-out" } dd { (brown_out(level)) } }
            dt { "samples" } dd {
                (who.sample_rate_hz) " Hz"
                @match (who.rate_measured, who.nominal_rate_hz) {
                    (false, _) => " nominal, not measured yet",
                    (true, Some(nominal)) if nominal != who.sample_rate_hz => { " measured, " (nominal) " nominal" }
                    _ => {}
                }
                ", 6 channels in " (who.raw_unit)
            }
            @for (sensor, triad) in who.sensors.iter() {
                dt { (sensor) } dd { (triad.part) ", range " (sensor_range(sensor, triad.range)) ", " (triad.bits) " bits, filter " (triad.filter) }
            }
            dt { "thermometers" } dd { (who.thermometers.join(", ")) }
            dt { "calibration" } dd { @match &who.stored {
                None => "none",
                Some(s) => { (s.hash) ", " (s.bytes) " bytes, temperature nodes: " (s.nodes) ", effects: " (s.effects) }
            } }
            @if let Some(s) = &who.stored { dt {} dd { (origin(s.unit_id.as_deref(), Some(&who.unit_id), s.created.as_deref())) } }
            @for (name, of) in ["first", "second"].iter().zip(&who.slots) { dt { (name) " place" } dd { (of) } }
            dt { "can" } dd { (who.capability_names().join(", ")) }
            dt { "room" } dd { (who.room.nodes) " temperature nodes, " (who.room.effects) " effects of a kind and triad, " (who.room.bytes) " bytes" }
            dt { "removes" } dd { (who.effects.join(", ")) }
        }
        (all_warnings(&who.warnings))
    })
}

/// What a level of the brown-out reset means (DS12110, table 15: falling thresholds).
fn brown_out(level: u8) -> Markup {
    let reset = ["1.62", "2.0", "2.3", "2.6"].get(usize::from(level));
    html! {
        "level " (level) @if let Some(volts) = reset { ", reset below " (volts) " V" }
        @if level <= 2 { "; set level 3 with a debugger, so that a failing supply does not tear what is being stored" }
    }
}

/// A range in the unit of data sheets.
fn sensor_range(sensor: Sensor, range: f64) -> String {
    let (value, unit) = sensor.pick(
        (range.to_degrees(), "deg/s"),
        (range / STANDARD_GRAVITY, "g"),
    );
    // Single precision of SI is no digit of a data sheet.
    format!("{} {unit}", (value * 1e3).round() / 1e3)
}

/// Result of `mimu device upload`.
pub fn upload_text(result: &DeviceResult<Uploaded>) -> String {
    let done = &result.found;
    text(&html! {
        p {
            (result.port) ": " (if done.was_there { "already stored:" } else { "stored" }) " " (done.hash) " (" (done.bytes) " bytes, read back)"
            @if !done.was_there { "; before: " @match done.before { Some(hash) => (hash), None => "none" } }
        }
        @if !done.effects.is_empty() { p { "effects: " (done.effects.join(", ")) } }
        @if done.repeated > 0 || done.restarts > 0 { p { "messages repeated: " (done.repeated) ", restarts of the device: " (done.restarts) } }
        (all_warnings(&done.warnings))
    })
}

/// Result of `mimu device download`.
pub fn download_text(result: &DeviceResult<Contents>) -> String {
    let found = &result.found;
    text(&html! {
        p { (result.port) ": calibration " (found.hash) ", " (found.bytes) " bytes" }
        p { (origin(found.unit_id.as_deref(), None, found.created.as_deref())) }
        p {
            (found.formula) ", " (found.direction) ": u in " (found.raw_unit.unwrap_or("the device's raw unit")) " at the sensors, x in rad/s and m/s², " (found.frame) " frame"
        }
        @if let Some(at) = &found.trimmed { p { "offsets trimmed " (at) } }
        @if let Some([from, to]) = found.range_c { p { "valid for dies at " (from) " to " (to) " °C" } }
        @if let Some(lag_s) = found.lag_s {
            p { "lag of the dies behind the thermometer " (lag_s) " s" @if let Some(s) = found.accel_lag_s { ", of the accelerometer's " (s) " s" } }
        }
        @if found.nodes.len() > 1 { p { (found.between_nodes) " between the nodes" } }
        @for node in &found.nodes {
            hr;
            p { "at " (node.temp_c) " °C" }
            @for (sensor, model, is_slope) in [("gyro", &node.gyro, false), ("accel", &node.accel, false), ("gyro/K", &node.gyro_slope, true), ("accel/K", &node.accel_slope, true)] {
                @if !is_slope || model.C.as_flattened().iter().chain(&model.o).any(|x| *x != 0.0) {
                    pre { (format!("  {sensor:<6} {:>42}   {:>14}\n", "C", "o"))
                        @for (row, o) in model.C.iter().zip(model.o) { (format!("         {:>14e}{:>14e}{:>14e}   {o:>14e}\n", row[0], row[1], row[2])) } }
                }
            }
        }
        @for effect in &found.effects {
            hr;
            p { "effect " (effect) ": " (effect.coefficients().iter().map(|c| format!("{c:e}")).collect::<Vec<_>>().join(", ")) }
            @if let Some(time) = effect.nonlinear() { section { p { "time constant " (time) " s" } } }
        }
        @if let Some(file) = &found.file { hr; p { "calibration: " (file) " (without standard deviations and covariance, which the device does not store)" } }
        @if let Some(file) = &found.bytes_file { hr; p { "bytes: " (file) } }
    })
}

/// The unit and date of a calibration. `held_by`: the unit that stores it.
fn origin(of: Option<&str>, held_by: Option<&str>, created: Option<&str>) -> Markup {
    html! {
        @match (of, held_by) {
            (None, _) => "of an unknown unit",
            (Some(of), Some(unit)) if of == unit => "of this unit",
            (Some(of), Some(_)) => { "of ANOTHER unit, " (of) }
            (Some(of), None) => { "of unit " (of) }
        }
        ", " @match created { Some(at) => { "made " (at) }, None => "unknown when" }
    }
}

/// Result of `mimu device self-test`.
pub fn self_test_text(result: &DeviceResult<SelfTested>) -> String {
    let found = &result.found;
    let word = |verdict: Verdict| match verdict {
        Verdict::Passed => "passed",
        Verdict::Failed => "FAILED",
        Verdict::NotShown => "not shown",
    };
    let not_shown = found.named(Verdict::NotShown);
    text(&html! {
        p { (result.port) ": self-test" }
        @for row in &found.results {
            @let [least, most] = row.limits;
            pre { (format!("{:<14}  {:<9}  {:>8.3} {}, limits {least:.3} to {most:.3}", row.name, word(row.verdict), row.value, row.unit)) }
        }
        @if !not_shown.is_empty() {
            p { "not shown in this pose: " (not_shown.join("; ")) "; the axis is perpendicular to gravity, where a stuck one reads the same; test again with it up" }
        }
        @if let Some(moved) = &found.moved { p { "the unit did not stand still: " (moved) } }
    })
}

/// Result of `mimu device counters`, by the names of the JSON.
pub fn counters_text(result: &DeviceResult<Counted>) -> String {
    let counters = serde_json::to_value(result.found.counters).unwrap_or_default();
    text(&html! {
        p { (result.port) ": counted since the start, or since the last reset of the counters" }
        dl.aligned { @for (name, value) in counters.as_object().into_iter().flatten() { dt { (name) } dd { (value) } } }
        @if result.found.reset { p { "the counters were reset" } }
    })
}

fn line(count: &LineCount) -> Markup {
    html! { @if count.garbled > 0 || count.not_understood > 0 {
        p { "line: " (count.garbled) " frames garbled, " (count.not_understood) " not understood, " (count.frames) " whole" }
    } }
}

/// Result of `mimu device stream`, without the samples.
pub fn stream_text(result: &DeviceResult<Streamed>) -> String {
    let found = &result.found;
    text(&html! {
        p { (result.port) ": " (found.samples) " samples, " (found.missing) " missing, " (format!("{:.2} °C", found.temp_c)) }
        @for (sensor, moments) in [("gyro", &found.gyro), ("accel", &found.accel)] { @for (i, axis) in AXES.iter().enumerate() {
            pre { (format!("{sensor:<5} {axis}  mean {:>13.6}  deviation {:>9} {}", moments.mean[i], significant(moments.deviation[i]), printed(&moments.unit))) }
        } }
        @if !found.thermometers.is_empty() { p { "thermometers: " @for (k, t) in found.thermometers.iter().enumerate() { @if k > 0 { ", " } (t.place) (format!(" {:.2} °C", t.temp_c)) } } }
        (line(&found.line))
        (all_warnings(found.flagged.warnings()))
    })
}

/// A unit in its printed form.
fn printed(unit: &str) -> String {
    unit.replace("^2", "²")
}

/// Result of `mimu record`.
pub fn record_text(summary: &RecordSummary) -> String {
    let s = &summary.state;
    text(&html! {
        p {
            (summary.port) (format!(": {} samples from {:.3} to {:.3} s", s.samples, s.first_s.unwrap_or_default(), s.last_s.unwrap_or_default()))
            (format!(", {} missing in {} gaps, {:.2} °C", s.missing, s.gaps, s.temp_c))
        }
        @if s.dwells > 0 { p { "dwells: " (s.dwells) } }
        (line(&s.line))
        ul.lines data-head="warning: " {
            @for r in &s.restarts { li { (format!("the device restarted before {:.3} s: {}", r.t_s, r.start)) } }
            @for warning in &s.warnings { li { (warning) } }
            @if s.reconnected > 0 { li { "the port vanished and came back " (s.reconnected) " times: the samples in between are missing" } }
            @for warning in s.flagged.warnings() { li { (warning) } }
        }
        p { "recording: " (summary.recording) }
    })
}

/// Result of `mimu device check`.
pub fn check_text(result: &DeviceResult<Checked>) -> String {
    let found = &result.found;
    text(&html! {
        p { (result.port) ": " (found.samples) " samples compared, " (found.unpaired) " without a counterpart" }
        p { "largest difference, device minus PC:" }
        @for (sensor, d) in [("gyro", &found.gyro), ("accel", &found.accel)] {
            ul class="lines" data-head={ (format!("{sensor:<6} ")) } { li {
                "same precision " (d.ulps) " ulps (" (significant(d.single)) " " (printed(d.unit)) "), double precision " (significant(d.double)) " " (printed(d.unit))
                (format!(", {:.0} % of the limit of rounding", 100.0 * d.rounding_share))
            } }
        }
        @if let Some([low, high]) = found.die_range_c { p { (format!("temperature of the dies during the comparison: {low:.2} to {high:.2} °C")) } }
        @if let Some(off) = found.die_temperature_k { p { "lagged temperature of the dies: difference " (significant(off)) " K" } }
        @if found.holds { p { "device and PC agree to rounding" } }
        @else if !found.not_judged_for.is_empty() { p { "not judged: " (found.not_judged_for.join(", ")) " depends on temperatures before the comparison" } }
        @else { p { "device and PC DIFFER" } }
    })
}

/// Result of `mimu device kalman`.
pub fn kalman_text(result: &DeviceResult<KalmanRun>) -> String {
    let run = &result.found;
    text(&html! {
        p { (result.port) ": Kalman bank of the " (run.triad) ", forward model u = P x + b, " (run.direction) }
        @for applied in &run.inputs {
            @let [x, y, z] = applied.input;
            p { (format!("input {x:>9} {y:>9} {z:>9} {}   samples {} to {}", run.input_unit, applied.first, applied.last)) }
        }
        (table("Estimates of the device and of the PC", &html! { th {} th.n { "device" } th.n { "sigma" } th.n { "PC" } th.n { "difference / sigma" } th { "unit" } }, &html! {
            @for (i, axis) in AXES.iter().enumerate() { @for (k, (name, unit)) in run.parameters.iter().zip(&run.units).enumerate() { tr {
                td { (axis) " " (name) } td.n { (format!("{:.7}", run.device[i].mean[k])) } (number(run.device[i].sigma[k], 1.0))
                td.n { (format!("{:.7}", run.host[i].mean[k])) } (number(run.distance_sigma[i][k], 1.0)) td { (unit) }
            } } }
        }))
        p { "largest difference " (significant(run.largest_distance_sigma)) " sigma; samples rejected: " (run.rejected) }
    })
}

/// Result of `mimu device trim`.
pub fn trim_text(result: &DeviceResult<Trimmed>) -> String {
    let found = &result.found;
    // rad/s is shown as deg/s, m/s² as mg.
    let (deg, mg) = (1_f64.to_degrees(), 1e3 / STANDARD_GRAVITY);
    text(&html! {
        p { (result.port) (format!(": trimmed at {:.1} °C: stored {} (read back); before: {}", found.temp_c, found.hash, found.before)) }
        (table("", &html! { th {} th.n { "before" } th.n { "after" } th { (format!("means of {:.0} s and their standard deviations", found.averaged_s)) } }, &html! {
            @for (name, triad, factor, unit) in [("gyro", &found.triads.gyro, deg, "deg/s"), ("accel", &found.triads.accel, mg, "mg")] {
                @for (i, axis) in AXES.iter().enumerate() { tr {
                    td { (name) " " (axis) }
                    @for (mean, sigma) in [(&triad.before, &triad.sigma_before), (&triad.after, &triad.sigma_after)] {
                        td.n { @if triad.trimmed { (format!("{:+.4} ± {:.4} {unit}", mean[i] * factor, sigma[i] * factor)) } @else { "kept" } }
                    }
                } }
            }
        }))
        @if !found.triads.accel.trimmed { p { "the accelerometer's offsets are unchanged, because its pose was not given (--up +z --gravity 9.81)" } }
        (all_warnings(&found.warnings))
    })
}
