//! Time and peak memory of a full diagnosis: a recording of half an hour at 1 kHz, on a table in a chamber, with two effects.
//!
//! `cargo bench -p mimu-tests --bench diagnosis`. Prints figures and asserts nothing, because times vary on shared machines.

use std::time::Instant;

use mimu::diagnose::diagnose;
use mimu::fit::Options;
use mimu::plan::next_experiment::next;
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::Recording;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::{Output, write};
use mimu_rig::rig_file::RigTruth;
use mimu_tests::blind::{plan, unit};

/// Peak memory in MB, since the start or since the last [`forget_peak`].
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
    kib.map_or(f64::NAN, |k| k / 1024.0)
}

fn forget_peak() {
    // If the system does not allow this, the peak includes making the recording, and is larger.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn main() {
    let seed = 1;
    // The plan takes 23 minutes; longer dwells make it half an hour.
    let text = plan(seed)
        .replace("sample_rate_hz = 100.0", "sample_rate_hz = 1000.0")
        .replace("dwell_s = 10.0", "dwell_s = 14.2");
    let plan = Plan::parse(Source::new("plan", &text)).expect("a plan");
    let file = unit(&["gyro_g_sensitivity", "accel_scale_quadratic"], seed);
    let truth = RigTruth::resolve(&file, seed).expect("a rig");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("recording");
    write(
        &plan,
        &truth,
        seed,
        &Output::new(&path, &plan).expect("a name"),
    )
    .expect("written");

    forget_peak();
    let begun = Instant::now();
    let recording = Recording::open(&path).expect("a recording");
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable");
    let blocks = &prepared.condensed.blocks;
    let minutes = blocks.last().map_or(0.0, |b| b.last_s) / 60.0;
    let read = begun.elapsed();
    let found = diagnose(prepared.into(), Options::IN_SAMPLE).expect("a diagnosis");
    let diagnosed = begun.elapsed();
    let planned = next(&found);
    let all = begun.elapsed();
    let ids: Vec<String> = found.effects.iter().map(|e| e.candidate.id()).collect();
    println!(
        "{minutes:.1} minutes at 1 kHz: read in {:.2} s, diagnosed in {:.2} s ({}, {}), next experiment for {} effects in {:.2} s; \
         {:.2} s together, {:.0} MB",
        read.as_secs_f64(),
        (diagnosed - read).as_secs_f64(),
        ids.join(", "),
        found.verdict.name(),
        planned.targets.len(),
        (all - diagnosed).as_secs_f64(),
        all.as_secs_f64(),
        peak_mb(),
    );
}
