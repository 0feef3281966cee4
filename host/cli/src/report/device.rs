//! What the device says, and what was recorded from it.

mod json;
mod text;

pub use json::{
    check_json, counters_json, download_json, info_json, kalman_json, record_json, self_test_json,
    stream_json, upload_json,
};
pub use text::{
    check_text, counters_text, download_text, info_text, kalman_text, record_text, self_test_text,
    stream_text, upload_text,
};

use mimu_core::wire::{Counters, SelfTest, Triad};

/// Names of the counters with their units, in the order of the table of messages.
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

/// Whether gyro x, y, z and the accelerometer answered as their datasheets state.
fn passed(test: &SelfTest) -> [bool; 4] {
    [0, 1, 2, 3].map(|bit| test.passed >> bit & 1 == 1)
}

fn triad_name(triad: Triad) -> &'static str {
    match triad {
        Triad::Gyro => "gyro",
        Triad::Accel => "accel",
    }
}

/// Units of `[b, P1, P2, P3]`, of the input, and of the input where a person reads.
fn triad_units(triad: Triad) -> (&'static str, &'static str) {
    match triad {
        Triad::Gyro => ("V/(rad/s)", "rad/s"),
        Triad::Accel => ("V/(m/s²)", "m/s²"),
    }
}
