//! Mutated recordings, manifests, calibrations and foreign files, through the whole library.
//!
//! Every case must end in a result without a NaN, or in a one-line error with its three parts, and never in a panic or a hang. An ordinary test run
//! takes a few seconds; a longer run by hand:
//!
//! ```text
//! MIMU_FUZZ_SECONDS=600 MIMU_FUZZ_SEED=2 cargo test --release -p mimu-cli --test all fuzz -- --nocapture
//! ```
//!
//! A failure prints the number of its case; `MIMU_FUZZ_CASE` runs that one alone.

mod mutation;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use mimu::calibration::Calibration;
use mimu::calibration::verify::verify;
use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::result::fit::FitResult;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_cli::report;
use mimu_recording::error::{Error, Result};
use mimu_recording::{
    ColumnList, ImportOptions, LogOptions, RawUnit, Recording, Reference, SampleFormat, import,
};

use crate::bad_input::generator::{by_hand_at, on_table_at};
use mutation::*;

const DEFAULT_SEED: u64 = 20_260_101;
const DEFAULT_SECONDS: u64 = 12;
/// A case takes some milliseconds; after this time it counts as hanging.
const HANG: Duration = Duration::from_secs(600);

const MANIFEST: &str = r#"format = "mimu-recording/1"
device = "unit-7"
sample_rate_hz = 20.0
gravity_mps2 = 9.81
raw_unit = "count"
reference = "REFERENCE"
latitude_deg = 30.5
step_labels = ["first", "second"]
turn_steps = [25]

[rails]
gyro = [-32768.0, 32767.0]
"#;

/// A recording of the generator at 20 Hz, with steps and a temperature.
fn samples(table: bool) -> String {
    let mut samples = match table {
        true => on_table_at(&[-60.0, 0.0, 60.0], &[0, 1, 2]),
        false => by_hand_at(12, 7, Random::direction),
    };
    if !table {
        samples.names.insert(1, "step".into());
        for (row, cells) in samples.rows.iter_mut().enumerate() {
            let step = samples.dwells.iter().position(|dwell| dwell.contains(&row));
            cells.insert(1, step.map_or(-1.0, |step| step as f64));
        }
    }
    samples.names.insert(2, "temp_c".into());
    for (row, cells) in samples.rows.iter_mut().enumerate() {
        cells.insert(2, 25.0 + 0.1 * (row % 10) as f64);
    }
    samples.keep_every(5, 0);
    samples.csv()
}

/// Without the column `step`, so that dwells must be found.
fn without_steps(text: &str) -> String {
    let line = |line: &str| {
        let cells = line.split(',').enumerate().filter(|(i, _)| *i != 1);
        cells.map(|(_, cell)| cell).collect::<Vec<_>>().join(",") + "\n"
    };
    text.lines().map(line).collect()
}

/// Inputs that the cases mutate.
struct Seeds {
    /// Samples, with the kind of reference.
    csv: Vec<(String, &'static str)>,
    parquet: Vec<(Vec<u8>, &'static str)>,
    calibration: String,
    inputs: String,
}

const INPUTS: &str = "step,ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2,turn_x_deg,ref_rate_y_dps,ref_rate_z_dps\n\
                      0,0,0,9.81,0,0,0\n1,0,9.81,0,90,0,0\n2,9.81,0,0,,1.5,0\n3,0,0,-9.81,-360,0,0\n";

fn options(random: &mut Random) -> Options {
    Options {
        holdout_blocks: [0, 2, 4, 1000][random.below(4)],
        only: [None, None, Some(Sensor::Gyro), Some(Sensor::Accel)][random.below(4)],
    }
}

fn still_factor(random: &mut Random) -> f64 {
    [10.0, 1.0, 1e9][if random.one_in(2) { 0 } else { random.below(3) }]
}

fn write_recording(folder: &Path, manifest: &[u8], name: &str, samples: &[u8]) {
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("recording.toml"), manifest).unwrap();
    fs::write(folder.join(name), samples).unwrap();
}

fn manifest(reference: &str) -> Vec<u8> {
    MANIFEST.replace("REFERENCE", reference).into_bytes()
}

fn fit_recording(folder: &Path, still_factor: f64, options: Options) -> Result<Fit> {
    let recording = Recording::open(folder)?;
    fit(Prepared::read(&recording, still_factor, |_| {})?, options)
}

impl Seeds {
    fn new(folder: &Path) -> Self {
        let (by_table, by_hand) = (samples(true), samples(false));
        let csv = vec![
            (without_steps(&by_hand), "gravity"),
            (by_hand.clone(), "gravity"),
            (by_table.clone(), "table"),
            (without_steps(&by_table), "table"),
        ];
        let mut calibration = String::new();
        let mut parquet = Vec::new();
        for (text, reference) in &csv {
            write_recording(
                &folder.join("seed"),
                &manifest(reference),
                "samples.csv",
                text.as_bytes(),
            );
            let fitted = fit_recording(&folder.join("seed"), STILL_FACTOR, Options::default())
                .expect("the seeds are valid");
            calibration = Calibration::of(&fitted, &[], "2026-01-01T00:00:00Z")
                .unwrap()
                .to_toml();
            let files = vec![folder.join("seed/samples.csv")];
            let known = if *reference == "table" {
                Reference::Table
            } else {
                Reference::Gravity
            };
            let out = folder.join("parquet");
            let _ = fs::remove_dir_all(&out);
            import(
                &ImportOptions::new(files, 9.81, RawUnit::Count, known),
                &out,
                |_| {},
            )
            .expect("valid");
            parquet.push((fs::read(out.join("samples.parquet")).unwrap(), *reference));
        }
        Self {
            csv,
            parquet,
            calibration,
            inputs: INPUTS.into(),
        }
    }
}

/// Whether an error is one line with its three parts.
fn well_formed(error: &Error) -> std::result::Result<(), String> {
    let line = error.to_string();
    let refused = error.refused();
    let parts = [&refused.place, &refused.problem, &refused.remedy];
    if parts.iter().any(|p| p.trim().is_empty())
        || line.contains(char::is_control)
        || line.lines().count() != 1
    {
        return Err(format!("a bad message: {error:?}"));
    }
    Ok(())
}

/// Whether all numbers of a fit are finite: in memory, in the text and in the JSON.
fn numbers(fit: &Fit) -> std::result::Result<(), String> {
    let result = FitResult::of(fit);
    let json = serde_json::to_value(&result).map_err(|e| e.to_string())?;
    for sensor in json["sensors"].as_object().into_iter().flatten() {
        for parameter in sensor.1["parameters"].as_array().into_iter().flatten() {
            for key in ["value", "sigma", "lower", "upper"] {
                // JSON has no NaN: it becomes null.
                if !parameter[key].is_number() {
                    return Err(format!("{}: {parameter}", sensor.0));
                }
            }
        }
        for key in ["rms", "noise_floor"] {
            if !sensor.1[key].is_number() {
                return Err(format!("{} {key}: {}", sensor.0, sensor.1[key]));
            }
        }
    }
    report::fit_text(&result, false);
    report::fit_text(&result, true);
    report::dwell_table(&result.dwells);
    let made = Calibration::of(fit, &[], "2026-01-01T00:00:00Z")
        .map_err(|error| format!("the fit makes no calibration: {error}"))?;
    let written = made.to_toml();
    let read = Calibration::parse(&written, "written")
        .map_err(|error| format!("what was written cannot be read: {error}"))?;
    match read.to_toml() == written {
        true => Ok(()),
        false => Err(format!("what was read is not what was written: {written}")),
    }
}

/// Runs one case. Returns what is wrong with its answer.
fn run(seeds: &Seeds, folder: &Path, random: &mut Random) -> std::result::Result<bool, String> {
    let (still, options) = (still_factor(random), options(random));
    let recording = folder.join("rec");
    let answer = match random.below(8) {
        0..=3 => {
            let (text, reference) = &seeds.csv[random.below(seeds.csv.len())];
            let mut manifest = manifest(reference);
            if random.one_in(10) {
                manifest = mutate(&manifest, random);
            }
            let samples = match random.one_in(3) {
                true => mutate(text.as_bytes(), random),
                false => mutate_numbers(text, random),
            };
            write_recording(&recording, &manifest, "samples.csv", &samples);
            fit_recording(&recording, still, options).map(Some)
        }
        4 => {
            let (bytes, reference) = &seeds.parquet[random.below(seeds.parquet.len())];
            let mut bytes = bytes.clone();
            for _ in 0..1 + random.below(3) {
                if !bytes.is_empty() {
                    mutate_bytes(&mut bytes, random);
                }
            }
            write_recording(&recording, &manifest(reference), "samples.parquet", &bytes);
            fit_recording(&recording, still, options).map(Some)
        }
        5 => {
            let (text, reference) = &seeds.csv[random.below(seeds.csv.len())];
            write_recording(
                &recording,
                &mutate(&manifest(reference), random),
                "samples.csv",
                text.as_bytes(),
            );
            fit_recording(&recording, still, options).map(Some)
        }
        6 => verify_mutated(seeds, &recording, random).map(|()| None),
        _ => import_mutated(seeds, folder, random)
            .and_then(|()| fit_recording(&recording, still, options).map(Some)),
    };
    match answer {
        Ok(Some(fit)) => numbers(&fit).map(|()| true),
        Ok(None) => Ok(true),
        Err(error) => well_formed(&error).map(|()| false),
    }
}

fn verify_mutated(seeds: &Seeds, recording: &Path, random: &mut Random) -> Result<()> {
    let mut calibration = seeds.calibration.clone().into_bytes();
    if random.one_in(2) {
        calibration = mutate(&calibration, random);
    }
    let path = recording.with_file_name("cal.toml");
    fs::write(&path, calibration).unwrap();
    let calibration = Calibration::read(&path)?;
    let (text, reference) = &seeds.csv[random.below(seeds.csv.len())];
    let text = if random.one_in(2) {
        mutate(text.as_bytes(), random)
    } else {
        mutate_numbers(text, random)
    };
    write_recording(recording, &manifest(reference), "samples.csv", &text);
    let prepared = Prepared::read(&Recording::open(recording)?, 10.0, |_| {})?;
    let result = verify(&prepared, &calibration)?;
    report::verify_text(&result, true);
    serde_json::to_string(&result).expect("a result is JSON");
    Ok(())
}

fn import_mutated(seeds: &Seeds, folder: &Path, random: &mut Random) -> Result<()> {
    let _ = fs::remove_dir_all(folder.join("rec"));
    let (text, _) = &seeds.csv[1 + random.below(2)];
    let text = match random.below(4) {
        0 => text.replace(',', ";"),
        1 => text.replace(',', "\t"),
        2 => text.replace(',', "  "),
        _ => text.clone(),
    };
    let text = mutate(text.as_bytes(), random);
    let parquet = random.one_in(6);
    let file = folder.join(if parquet {
        "foreign.parquet"
    } else {
        "foreign.txt"
    });
    match parquet {
        true => {
            let mut bytes = seeds.parquet[1].0.clone();
            mutate_bytes(&mut bytes, random);
            fs::write(&file, bytes).unwrap();
        }
        false => fs::write(&file, &text).unwrap(),
    }
    let mut files = vec![file];
    let list = |random: &mut Random, text: &str| -> Result<ColumnList> {
        match random.one_in(2) {
            true => text.parse(),
            false => String::from_utf8_lossy(&mutate(text.as_bytes(), random)).parse(),
        }
    };
    let mut columns = Vec::new();
    if random.one_in(2) {
        let all = "t_s,step,-,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";
        let names = "t_s=t_s,step=step,gyro_x=gyro_x,gyro_y=gyro_y,gyro_z=gyro_z";
        let counted = "sample,step,temp_c,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";
        let chosen = random.of(&[all, names, counted]);
        columns.push(list(random, chosen)?);
    }
    if random.one_in(4) {
        // Joined by time to another file.
        let second = folder.join("second.txt");
        let (text, _) = &seeds.csv[0];
        fs::write(&second, mutate(text.as_bytes(), random)).unwrap();
        files.push(second);
        columns = vec![
            list(random, "t_s=t_s,gyro_x=gyro_x,gyro_y=gyro_y,gyro_z=gyro_z")?,
            list(
                random,
                "t_s=t_s,accel_x=accel_x,accel_y=accel_y,accel_z=accel_z",
            )?,
        ];
    }
    let mut scales = Vec::new();
    if random.one_in(2) {
        let scale = [
            "gyro=57.2958",
            "accel=1e-3",
            "t_s=0.001",
            "gyro_x=-1",
            "accel=1e29",
            "t_s=1e300",
        ];
        let chosen = mutate(random.of(&scale).as_bytes(), random);
        scales.push(String::from_utf8_lossy(&chosen).parse()?);
    }
    let mut inputs: Option<PathBuf> = None;
    if random.one_in(3) {
        let path = folder.join("inputs.csv");
        fs::write(&path, mutate(seeds.inputs.as_bytes(), random)).unwrap();
        inputs = Some(path);
    }
    let reference = if random.one_in(2) {
        Reference::Table
    } else {
        Reference::Gravity
    };
    let rates = [
        None,
        Some(20.0),
        Some(1e-300),
        Some(1e300),
        Some(0.01),
        Some(7.0),
    ];
    let options = ImportOptions {
        log: LogOptions {
            columns,
            rate_hz: rates[random.below(rates.len())],
            scale: scales,
            inputs,
            ..LogOptions::default()
        },
        format: if random.one_in(2) {
            SampleFormat::Csv
        } else {
            SampleFormat::Parquet
        },
        ..ImportOptions::new(files, 9.81, RawUnit::Count, reference)
    };
    import(&options, &folder.join("rec"), |_| {}).map(|summary| {
        report::import_text(&summary);
        serde_json::to_string(&summary).expect("a result is JSON");
    })
}

fn environment(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(
        text.parse()
            .unwrap_or_else(|_| panic!("{name}={text} is no number")),
    )
}

/// Ends the process when a case makes no progress, because a hanging thread cannot be stopped. It stops watching when the test that owns `case` ends:
/// other tests may take longer than a case.
fn watch(case: &Arc<AtomicU64>, seed: u64) {
    let case = Arc::downgrade(case);
    std::thread::spawn(move || {
        let (mut last, mut since) = (u64::MAX, Instant::now());
        loop {
            std::thread::sleep(Duration::from_millis(500));
            let Some(case) = case.upgrade() else { return };
            let now = case.load(Ordering::Relaxed);
            if now != last {
                (last, since) = (now, Instant::now());
            } else if since.elapsed() > HANG {
                eprintln!("hangs: MIMU_FUZZ_SEED={seed} MIMU_FUZZ_CASE={now}");
                std::process::abort();
            }
        }
    });
}

#[test]
fn no_mutation_ends_in_a_panic_a_hang_or_a_number_that_is_none() {
    let seed = environment("MIMU_FUZZ_SEED").unwrap_or(DEFAULT_SEED);
    let seconds = environment("MIMU_FUZZ_SECONDS").unwrap_or(DEFAULT_SECONDS);
    let only = environment("MIMU_FUZZ_CASE");
    let folder = tempfile::tempdir().unwrap();
    let seeds = Seeds::new(folder.path());
    let current = Arc::new(AtomicU64::new(0));
    watch(&current, seed);
    let default_hook = std::panic::take_hook();
    if only.is_none() {
        // Readers catch the panics of their decoders; their output would fill the screen.
        std::panic::set_hook(Box::new(|_| {}));
    }
    let (start, mut case, mut accepted) = (Instant::now(), only.unwrap_or(0), 0_u64);
    let mut failures: Vec<String> = Vec::new();
    while start.elapsed() < Duration::from_secs(seconds) && failures.len() < 10 {
        current.store(case, Ordering::Relaxed);
        let mut random = Random(seed ^ case.wrapping_mul(0x2545_f491_4f6c_dd1d));
        match catch_unwind(AssertUnwindSafe(|| run(&seeds, folder.path(), &mut random))) {
            Ok(Ok(fitted)) => accepted += u64::from(fitted),
            Ok(Err(wrong)) => failures.push(format!(
                "MIMU_FUZZ_SEED={seed} MIMU_FUZZ_CASE={case}: {wrong}"
            )),
            Err(_) => failures.push(format!(
                "MIMU_FUZZ_SEED={seed} MIMU_FUZZ_CASE={case}: panic"
            )),
        }
        case += 1;
        if only.is_some() {
            break;
        }
    }
    std::panic::set_hook(default_hook);
    println!("seed {seed}: {case} cases, {accepted} of them with a result");
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(
        only.is_some() || accepted > 0,
        "mutations that are all refused test little"
    );
}
