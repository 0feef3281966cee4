//! `mimu-device/1` and `mimu-record/1`.

use std::path::Path;

use mimu_core::wire::Counters;
use serde_json::{Value, json};

use super::{counters, passed, triad_name, triad_units};
use mimu_device::record::RecordSummary;
use mimu_device::{
    AxisEstimate, Checked, Contents, Image, KalmanRun, LineCount, SelfTested, Started, Stream,
    Streamed, Uploaded, Who, slot,
};
use mimu_recording::error::Error;

/// The keys that all have, and those of `more`.
fn with(command: &str, port: &str, more: Value) -> Value {
    let mut all = json!({
        "format": "mimu-device/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "command": command,
        "port": port,
    });
    if let (Some(all), Value::Object(more)) = (all.as_object_mut(), more) {
        all.extend(more);
    }
    all
}

/// Hashes are 64 bits, and many programs read numbers of 53.
fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}

fn line(count: &LineCount) -> Value {
    json!({
        "bytes": count.bytes,
        "frames": count.frames,
        "garbled": count.garbled,
        "not_understood": count.not_understood,
    })
}

/// Result of `mimu device info`.
pub fn info_json(port: &str, who: &Who) -> Value {
    let mut start = json!({ "reason": who.start.name() });
    match &who.start {
        Started::Panic(file, line) => {
            start["file"] = json!(file);
            start["line"] = json!(line);
        }
        Started::Fault(pc, cfsr) => {
            start["pc"] = json!(pc);
            start["cfsr"] = json!(cfsr);
        }
        _ => {}
    }
    let stored = who.stored.map(|s| {
        json!({
            "hash": hex(s.hash),
            "bytes": s.length,
            "nodes": s.nodes,
            "effects": s.effects,
        })
    });
    with(
        "info",
        port,
        json!({
            "protocol": { "major": who.protocol.major, "minor": who.protocol.minor },
            "firmware": who.firmware,
            "board": who.board,
            "unit_id": who.unit_id,
            "capabilities": who.capability_names(),
            "effects": who.effect_ids(),
            "room": {
                "effects": who.effects_room,
                "nodes": who.nodes_room,
                "bytes": who.stored_room,
            },
            "sample_rate_hz": who.sample_rate_hz,
            "channels": who.channels,
            "raw_unit": who.raw_unit,
            "start": start,
            "starts": who.starts,
            "stored": stored,
            "slots": who.slots.iter().map(slot).collect::<Vec<_>>(),
            "warnings": who.version_warning().into_iter().collect::<Vec<_>>(),
        }),
    )
}

/// Result of `mimu device upload`.
pub fn upload_json(port: &str, image: &Image, done: &Uploaded) -> Value {
    with(
        "upload",
        port,
        json!({
            "hash": hex(done.hash),
            "bytes": done.length,
            "before": done.before.map(hex),
            "was_there": done.was_there,
            "repeated": done.repeated,
            "restarts": done.restarts,
            "node_temp_c": image.node_temp_c,
            "effects": image.effects,
            "warnings": image.warnings,
        }),
    )
}

/// Result of `mimu device download`.
pub fn download_json(port: &str, path: &Path, bytes: &[u8], contents: &Contents) -> Value {
    let nodes: Vec<Value> = contents
        .nodes
        .iter()
        .map(|node| {
            json!({
                "temp_c": node.temp_c,
                "gyro": { "C": node.c[0], "o": node.o[0], "unit": "rad/s" },
                "accel": { "C": node.c[1], "o": node.o[1], "unit": "m/s^2" },
            })
        })
        .collect();
    let effects: Vec<Value> = contents
        .effects
        .iter()
        .map(|effect| {
            json!({
                "id": effect.id,
                "coefficients": effect.coefficients,
                "time_constant_s": effect.time_constant_s,
                "converter": effect.converter.as_ref().map(|c| json!({
                    "axes": c.axes,
                    "weight_of_bit_0_v": c.weight_of_bit_0_v,
                    "reading_of_code_0_v": c.reading_of_code_0_v,
                })),
            })
        })
        .collect();
    with(
        "download",
        port,
        json!({
            "file": path,
            "bytes": bytes.len(),
            "hash": hex(mimu_core::stored::hash(bytes)),
            "formula": "x = C u + o",
            "direction": "raw to SI",
            "raw_unit": "V",
            "frame": "body",
            "nodes": nodes,
            "effects": effects,
        }),
    )
}

/// Result of `mimu device self-test`.
pub fn self_test_json(port: &str, found: &SelfTested) -> Value {
    let test = &found.test;
    let [x, y, z, accel] = passed(test);
    with(
        "self-test",
        port,
        json!({
            "passed": { "gyro_x": x, "gyro_y": y, "gyro_z": z, "accel": accel },
            "gyro_st1_v": test.gyro_st1_v,
            "gyro_st2_v": test.gyro_st2_v,
            "accel_fine_v": test.accel_fine_v,
            "accel_coarse_v": test.accel_coarse_v,
            "moved": found.moved,
        }),
    )
}

/// Result of `mimu device counters`.
pub fn counters_json(port: &str, of: &Counters, reset: bool) -> Value {
    let all: serde_json::Map<String, Value> = counters(of)
        .into_iter()
        .map(|(name, value)| (name.to_owned(), json!(value)))
        .collect();
    with("counters", port, json!({ "counters": all, "reset": reset }))
}

/// Result of `mimu device stream`.
pub fn stream_json(port: &str, which: Stream, found: &Streamed) -> Value {
    let (stream, units) = match which {
        Stream::Raw => ("raw", ["V", "V"]),
        Stream::Compensated => ("compensated", ["rad/s", "m/s^2"]),
    };
    with(
        "stream",
        port,
        json!({
            "stream": stream,
            "samples": found.samples,
            "missing": found.missing,
            "first": found.first,
            "temp_c": found.temp_c,
            "gyro": { "unit": units[0], "mean": &found.mean[..3], "deviation": &found.deviation[..3] },
            "accel": { "unit": units[1], "mean": &found.mean[3..], "deviation": &found.deviation[3..] },
            "line": line(&found.line),
        }),
    )
}

/// Result of `mimu device check`.
pub fn check_json(port: &str, found: &Checked) -> Value {
    let difference = |i: usize, unit: &str| {
        let d = &found.differences[i];
        json!({
            "ulps": d.ulps,
            "single": d.single,
            "double": d.double,
            "rounding_share": d.share,
            "unit": unit,
        })
    };
    with(
        "check",
        port,
        json!({
            "samples": found.samples,
            "unpaired": found.unpaired,
            "gyro": difference(0, "rad/s"),
            "accel": difference(1, "m/s^2"),
            "not_judged_for": found.remembering,
            "holds": found.holds(),
        }),
    )
}

fn axes(all: &[AxisEstimate; 3]) -> Vec<Value> {
    let axis = |a: &AxisEstimate| json!({ "mean": a.mean, "sigma": a.sigma });
    all.iter().map(axis).collect()
}

/// Result of `mimu device kalman`.
pub fn kalman_json(port: &str, run: &KalmanRun) -> Value {
    let (scale, unit) = triad_units(run.triad);
    let inputs: Vec<Value> = run
        .inputs
        .iter()
        .map(|(input, first, last)| json!({ "input": input, "first": first, "last": last }))
        .collect();
    let history: Vec<Value> = run
        .history
        .iter()
        .map(|(updates, all)| json!({ "updates": updates, "axes": axes(all) }))
        .collect();
    with(
        "kalman",
        port,
        json!({
            "triad": triad_name(run.triad),
            "parameters": ["b", "P1", "P2", "P3"],
            "direction": "SI to raw",
            "units": ["V", scale, scale, scale],
            "input_unit": unit,
            "noise_v2": run.noise,
            "inputs": inputs,
            "rejected": run.rejected,
            "device": axes(&run.device),
            "host": axes(&run.host),
            "distance_sigma": run.distances(),
            "largest_distance_sigma": run.largest(),
            "history": history,
        }),
    )
}

/// Result of `mimu record`.
pub fn record_json(port: &str, directory: &Path, summary: &RecordSummary) -> Value {
    let s = &summary.standing;
    let restarts: Vec<Value> = s
        .restarts
        .iter()
        .map(|r| json!({ "t_s": r.t_s, "start": r.start }))
        .collect();
    json!({
        "format": "mimu-record/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "port": port,
        "recording": directory,
        "samples": s.samples,
        "missing": s.missing,
        "gaps": s.gaps,
        "first_s": s.span_s.map(|(first, _)| first),
        "last_s": s.span_s.map(|(_, last)| last),
        "dwells": s.dwells,
        "restarts": restarts,
        "resumed": s.resumed,
        "saturated": s.saturated,
        "without_reference": s.without_reference,
        "self_test": s.self_test,
        "line": line(&s.line),
        "broken_off": summary.broken_off.as_ref().map(Error::to_string),
    })
}
