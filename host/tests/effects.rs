//! Effects in a calibration: written, read, removed on the PC and by the device alike, and shown by `mimu verify`.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use mimu::calibration::{Calibration, EffectTable, to_toml};
use mimu::device::Image;
use mimu::diagnose::candidate::{Candidate, Kind, Monomial, Variable};
use mimu::diagnose::library;
use mimu::diagnose::library::readout::{Converter, TYPICAL, first_of};
use mimu::diagnose::removal::{Removed, remove};
use mimu::dwell::Sensor;
use mimu::fit::{Fit, Method, Options, fit};
use mimu::prepared::Prepared;
use mimu::recording::Recording;
use mimu::stillness::STILL_FACTOR;
use mimu_core::compensation::Sample;
use mimu_core::effects::{Effects, State};
use nalgebra::{Matrix3, Vector3};

const DWELLS: usize = 72;
const RATE_HZ: f64 = 50.0;
const DWELL_S: f64 = 2.0;
const G: f64 = 9.80665;
/// Standard deviations of a sample, V.
const NOISE: [f64; 2] = [1e-4, 2e-4];

/// Forward model of the bench's unit, V per SI: rows are sensors.
fn forward(sensor: usize) -> (Matrix3<f64>, Vector3<f64>) {
    match sensor {
        0 => (
            Matrix3::new(0.4, 0.01, -0.02, 0.01, 0.5, 0.02, -0.01, 0.02, 0.3),
            Vector3::new(1.6, 1.7, 1.5),
        ),
        _ => (
            Matrix3::new(0.08, 0.001, 0.0, -0.001, 0.07, 0.002, 0.001, 0.0, 0.09),
            Vector3::new(1.65, 1.6, 1.7),
        ),
    }
}

/// Temperature of the bench, °C: a ramp.
fn temp_c(t: f64) -> f64 {
    22.0 + 0.15 * t
}

/// Sag of the gyros, rad/s by m/s².
const SAG: f64 = 4e-4;
/// Cubic of the accelerometer, by (m/s²)².
///
/// An effect is removed by the reading that errs: of the cubic's error, 0.03 m/s² at most, its slope of 0.9 % stays.
const CUBIC: f64 = 3e-5;
/// Thermal bias of gyro z, rad/s/K.
const THERMAL: f64 = 5e-4;

/// Weight of bit 0 of the converters, V.
const BIT_0_V: f64 = 1.6384;
/// Bits of each converter of the accelerometer that are worth more than they say, V, three times what data sheets say and less.
const WORTH_V: [[(i32, f64); 3]; 3] = {
    let one = TYPICAL * BIT_0_V;
    [
        [(0, 3.0 * one), (3, -2.0 * one), (6, one)],
        [(1, -3.0 * one), (2, 2.0 * one), (5, -one)],
        [(0, -2.0 * one), (4, 3.0 * one), (7, -one)],
    ]
};
/// Readings of code 0, V: what has been subtracted is no multiple of anything.
const ZERO_V: [f64; 3] = [-0.0713, -1.1234, -0.5061];

/// What the converters of the accelerometer add to a reading of `u` of an axis, V.
fn worth(axis: usize, u: f64) -> f64 {
    let each = WORTH_V[axis].iter().map(|(bit, worth)| {
        let code = ((u - ZERO_V[axis]) / (BIT_0_V * 0.5_f64.powi(*bit))).floor();
        if code.rem_euclid(2.0) == 1.0 {
            *worth
        } else {
            0.0
        }
    });
    each.sum()
}

/// Records the unit on a table, with its flaws or without; `temp` says whether temp_c is recorded.
fn record(folder: &Path, flawed: bool, temp: bool) {
    write_recording(folder, flawed, false, temp);
}

fn write_recording(folder: &Path, flawed: bool, converted: bool, temp: bool) {
    std::fs::create_dir(folder).unwrap();
    let manifest = format!(
        "format = \"mimu-recording/1\"\ndevice = \"bench\"\nsample_rate_hz = {RATE_HZ:?}\n\
         gravity_mps2 = {G}\nraw_unit = \"V\"\nreference = \"table\"\n"
    );
    std::fs::write(folder.join("recording.toml"), manifest).unwrap();
    let mut out = String::from("t_s,step,");
    if temp {
        out.push_str("temp_c,");
    }
    out.push_str("gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,");
    out.push_str("ref_rate_x_dps,ref_rate_y_dps,ref_rate_z_dps,");
    out.push_str("ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2\n");
    let mut seed = 7 + u64::from(flawed);
    // Sum of twelve uniform numbers: near enough to normal.
    let mut normal = move || {
        let mut next = || {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| next()).sum::<f64>() - 6.0
    };
    let rows = (DWELL_S * RATE_HZ) as usize;
    for k in 0..DWELLS * rows {
        let (t, step) = (k as f64 / RATE_HZ, k / rows);
        let s = step as f64;
        // Directions and rates that repeat late: by the golden angle.
        let force = Vector3::new((2.4 * s).sin(), (2.4 * s).cos(), (0.9 * s).sin()).normalize() * G;
        let rate_dps = Vector3::new((1.3 * s).sin(), (1.7 * s).cos(), (2.9 * s).sin()) * 60.0;
        let mut inputs = [rate_dps.map(f64::to_radians), force];
        write!(out, "{t:.4},{step}").unwrap();
        if temp {
            write!(out, ",{:.6}", temp_c(t)).unwrap();
        }
        for (sensor, input) in inputs.iter_mut().enumerate() {
            let (p, b) = forward(sensor);
            let scale = Vector3::from_fn(|i, _| p.row(i).norm());
            let error = match (flawed, sensor) {
                (false, _) => Vector3::zeros(),
                (_, 0) => Vector3::new(SAG * force.z, SAG * force.x, THERMAL * (temp_c(t) - 25.0)),
                _ => Vector3::from_fn(|i, _| {
                    CUBIC * (p.row(i).transpose().dot(&force) / scale[i]).powi(3)
                }),
            };
            let read = p * *input + b + scale.component_mul(&error);
            for (axis, u) in read.iter().enumerate() {
                let u = u + NOISE[sensor] * normal();
                let more = if converted && sensor == 1 {
                    worth(axis, u)
                } else {
                    0.0
                };
                write!(out, ",{:.9}", u + more).unwrap();
            }
        }
        for v in rate_dps.iter().chain(force.iter()) {
            write!(out, ",{v:.9}").unwrap();
        }
        out.push('\n');
    }
    std::fs::write(folder.join("samples.csv"), out).unwrap();
}

fn prepared(folder: &Path) -> Prepared {
    let recording = Recording::open(folder).unwrap();
    Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap()
}

fn fitted(folder: &Path) -> Fit {
    let options = Options {
        method: Method::LeastSquares,
        holdout_blocks: 0,
        still_factor: STILL_FACTOR,
        only: None,
    };
    fit(prepared(folder), options).unwrap()
}

fn removed(candidate: Candidate, form: f64, values: &[f64]) -> Removed {
    let values = values.to_vec();
    Removed {
        candidate,
        form,
        values,
    }
}

fn named(id: &str, values: &[f64]) -> Removed {
    let effect = library::by_id(id).unwrap();
    removed(
        Candidate::new(effect.sensor, Kind::Effect(effect)),
        0.0,
        values,
    )
}

fn table(effect: &Removed) -> EffectTable {
    let sigmas: Vec<f64> = effect.values.iter().map(|v| 0.01 * v.abs()).collect();
    EffectTable::new(effect, &sigmas)
}

/// All that is known by name, some of it with some of its coefficients only, and three terms; ten times what data sheets say.
fn every_effect() -> Vec<Removed> {
    let mut all: Vec<Removed> = library::all()
        .filter(|effect| effect.is_error())
        .enumerate()
        .map(|(n, effect)| {
            let mut candidate = Candidate::new(effect.sensor, Kind::Effect(effect));
            if candidate.reads_code() {
                let zero = 0.123;
                let weight = BIT_0_V;
                candidate = candidate.behind_one(Converter::of(weight, zero));
            }
            if n % 2 == 1 {
                candidate.active.remove(1);
            }
            let sign = |k: usize| if (n + k).is_multiple_of(3) { -1.0 } else { 1.0 };
            let values: Vec<f64> = candidate
                .active
                .iter()
                .map(|k| sign(*k) * effect.typical[*k] * (10.0 + *k as f64))
                .collect();
            let form = effect.form.map_or(0.0, |f| 2.0 * f.from);
            removed(candidate, form, &values)
        })
        .collect();
    let term = |sensor, axis, v: &[Variable], value| {
        removed(
            Candidate::new(sensor, Kind::Term(axis, Monomial(v.to_vec()))),
            0.0,
            &[value],
        )
    };
    use Variable::{Force, Rate, Temperature, TemperatureRate, Time};
    all.push(term(Sensor::Gyro, 0, &[Rate(0), Force(1), Force(1)], 1e-4));
    all.push(term(Sensor::Gyro, 1, &[TemperatureRate, Time], 1e-4));
    all.push(term(Sensor::Accel, 2, &[Rate(2), Temperature], 1e-3));
    all
}

#[test]
fn every_effect_comes_back_from_the_file_and_the_device_removes_what_the_pc_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, true);
    let fit = fitted(&path);
    let effects = every_effect();
    let tables: Vec<EffectTable> = effects.iter().map(table).collect();
    let text = to_toml(&fit, &tables, "2026-01-01T00:00:00Z");
    let calibration = Calibration::parse(&text, "cal.toml").unwrap();
    assert_eq!(calibration.effects().len(), effects.len());
    for (read, written) in calibration.effects().iter().zip(&effects) {
        assert_eq!(read.candidate.id(), written.candidate.id());
        assert_eq!(read.candidate.active, written.candidate.active);
        assert_eq!((read.form, &read.values), (written.form, &written.values));
        assert_eq!(read.candidate.codes, written.candidate.codes);
    }

    // Of a block the PC knows mean and scatter, from which bits follow another way.
    let effects: Vec<Removed> = every_effect()
        .into_iter()
        .filter(|e| !e.candidate.reads_code())
        .collect();
    let tables: Vec<EffectTable> = effects.iter().map(table).collect();
    let text = to_toml(&fit, &tables, "2026-01-01T00:00:00Z");
    let calibration = Calibration::parse(&text, "cal.toml").unwrap();
    let before = &fit.prepared;
    let [gyro, accel] = Sensor::BOTH.map(|s| calibration.inverse(s).unwrap());
    let after = remove(before, Some(&gyro), Some(&accel), calibration.effects()).unwrap();
    let device: Effects<f64, 8> = calibration.core_effects().unwrap();
    let mut state = State::new(10.0);
    let mut t = before.condensed.blocks[0].start_s;
    let mut moved = [0.0_f64; 2];
    for (block, clean) in before.condensed.blocks.iter().zip(&after.condensed.blocks) {
        let middle = 0.5 * (block.start_s + block.last_s);
        device.slow(&mut state, middle - t, block.temp_c.mean);
        t = middle;
        let si = |block: &mimu::blocks::Block| {
            let raw = |from: usize| Vector3::from_fn(|i, _| block.raw[from + i].mean);
            Sample {
                gyro: gyro.apply(&raw(0)),
                accel: accel.apply(&raw(3)),
            }
        };
        // No block follows the one before sample by sample: evaluated twice, as on the PC, and without an angular acceleration.
        state.gap();
        let by_device = device.remove(&mut state, &si(block));
        let (by_host, raw) = (si(clean), si(block));
        // The same formula in another order: rounding.
        assert!((by_device.gyro - by_host.gyro).norm() < 1e-12);
        assert!((by_device.accel - by_host.accel).norm() < 1e-12);
        moved[0] = moved[0].max((by_host.gyro - raw.gyro).norm());
        moved[1] = moved[1].max((by_host.accel - raw.accel).norm());
    }
    assert!(moved[0] > 0.01 && moved[1] > 0.1, "{moved:?}");
}

/// Converters of the accelerometer, as the recording is made.
fn converters() -> Removed {
    let effect = library::by_id("accel_readout_code").unwrap();
    let mut candidate = Candidate::new(Sensor::Accel, Kind::Effect(effect));
    candidate.active.clear();
    let mut values = Vec::new();
    for axis in 0..3 {
        let (weight, zero) = (BIT_0_V, ZERO_V[axis]);
        candidate.codes[axis] = Some(Converter::of(weight, zero));
        for (bit, worth) in WORTH_V[axis] {
            candidate.active.push(first_of(axis) + bit as usize);
            values.push(worth / BIT_0_V);
        }
    }
    removed(candidate, 0.0, &values)
}

#[test]
fn errors_by_the_code_are_taken_out_block_by_block_and_sample_by_sample() {
    let folder = tempfile::tempdir().unwrap();
    let [clean, coded] = ["clean", "coded"].map(|name| folder.path().join(name));
    // The same noise to the last bit.
    record(&clean, false, false);
    write_recording(&coded, false, true, false);
    let fit = fitted(&clean);
    let text = to_toml(&fit, &[table(&converters())], "2026-01-01T00:00:00Z");
    let calibration = Calibration::parse(&text, "cal.toml").unwrap();
    let [gyro, accel] = Sensor::BOTH.map(|s| calibration.inverse(s).unwrap());
    let coded_blocks = prepared(&coded);
    let after = remove(
        &coded_blocks,
        Some(&gyro),
        Some(&accel),
        calibration.effects(),
    )
    .unwrap();
    let device: Effects<f64, 8> = calibration.core_effects().unwrap();
    // One to each axis, and the device has room for them.
    let image = Image::new(&calibration, "cal.toml").unwrap();
    assert_eq!(image.stored().unwrap().effect_count, 3);
    assert_eq!(image.effects, ["accel_readout_code"]);
    let text = std::fs::read_to_string(coded.join("samples.csv")).unwrap();
    let samples: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|v| v.parse().unwrap()).collect())
        .collect();
    let mean = |block: &mimu::blocks::Block| Vector3::from_fn(|i, _| block.raw[3 + i].mean);
    let blocks = |of: &Prepared| of.condensed.blocks.clone();
    // Of the truth, V: what was put in, and what is left of it by block and by sample.
    let [mut put, mut by_block, mut by_sample] = [(); 3].map(|()| Vec::new());
    let all = blocks(&fit.prepared).into_iter().zip(blocks(&coded_blocks));
    for ((truth, read), cleaned) in all.zip(blocks(&after)) {
        assert_eq!((truth.first_row, truth.rows), (read.first_row, read.rows));
        let from = read.first_row as usize;
        let rows = &samples[from..from + read.rows as usize];
        let of_device = rows.iter().map(|row| {
            let raw = |from: usize| Vector3::from_fn(|i, _| row[2 + from + i]);
            let (gyro, accel) = (raw(0), raw(3));
            device.without_code_errors(&Sample { gyro, accel }).accel
        });
        let of_device = of_device.sum::<Vector3<f64>>() / rows.len() as f64;
        put.push(mean(&read) - mean(&truth));
        by_block.push(mean(&cleaned) - mean(&truth));
        by_sample.push(of_device - mean(&truth));
    }
    let rms = |all: &[Vector3<f64>]| {
        let squares: f64 = all.iter().map(|e| e.norm_squared()).sum();
        (squares / (3 * all.len()) as f64).sqrt()
    };
    let mean = |all: &[Vector3<f64>]| all.iter().sum::<Vector3<f64>>().norm() / all.len() as f64;
    println!(
        "errors of {:.3e} V rms: by block {:.3e} left, {:.1e} on average; by sample {:.3e}, {:.1e}",
        rms(&put),
        rms(&by_block),
        mean(&by_block),
        rms(&by_sample),
        mean(&by_sample)
    );
    assert!(rms(&put) > 5e-4);
    // Where a bit that is worth too little turns, the readings of some codes before and after are the same, and of five samples
    // the share of the time is known to a fifth. One turn in the wrong place, or of the wrong sign, leaves more than all of this.
    for left in [&by_block, &by_sample] {
        assert!(rms(left) < 0.12 * rms(&put), "{}", rms(left));
        assert!(mean(left) < 0.04 * rms(&put), "{}", mean(left));
    }
}

fn mimu(arguments: &[&str]) -> (bool, String) {
    let run = Command::new(env!("CARGO_BIN_EXE_mimu"))
        .args(arguments)
        .output()
        .unwrap();
    let text = if run.status.success() {
        run.stdout
    } else {
        run.stderr
    };
    (run.status.success(), String::from_utf8(text).unwrap())
}

#[test]
fn converters_that_make_no_sense_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, false);
    let fit = fitted(&path);
    let text = to_toml(&fit, &[table(&converters())], "2026-01-01T00:00:00Z");
    let of_y = "{ axes = \"y\", ";
    for (from, to, says) in [
        (
            "converters = [",
            "converters = []\nothers = [",
            "unknown field",
        ),
        ("{ axes = \"x\", ", "{ axes = \"w\", ", "x, y, z or xyz"),
        (of_y, "{ axes = \"x\", ", "two converters of x"),
        (of_y, "{ axes = \"xyz\", ", "two converters of x"),
        (
            "weight_of_bit_0_raw = 1.6384",
            "weight_of_bit_0_raw = 0.0",
            "converter of x: weight_of_bit_0_raw is 0.0",
        ),
        (
            "reading_of_code_0_raw = -0.0713",
            "reading_of_code_0_raw = nan",
            "reading_of_code_0_raw is NaN",
        ),
        (
            "reading_of_code_0_raw = -0.0713",
            "reading_of_code_0_raw = 1e17",
            "reading_of_code_0_raw is 1e17",
        ),
        (
            "within_raw = 0.0",
            "within_raw = -1.0",
            "within_raw is -1.0",
        ),
        (
            "formula = \"x = C (u - S e)",
            "form = { name = \"time_constant_s\", value = 3.0 }\nformula = \"x = C (u - S e)",
            "this effect has none",
        ),
    ] {
        assert!(text.contains(from), "{from} is not in {text}");
        let edited = text.replacen(from, to, 1);
        let refusal = Calibration::parse(&edited, "cal.toml")
            .unwrap_err()
            .to_string();
        assert!(refusal.contains(says), "{refusal}");
    }
    let line = text.lines().find(|l| l.contains(of_y)).unwrap();
    for (edited, says) in [
        (
            text.replacen(line, "", 1),
            "y has coefficients and no converter",
        ),
        (
            text.lines()
                .filter(|l| !l.contains("weight_of_bit_0_raw"))
                .collect::<Vec<_>>()
                .join("\n"),
            "it has no converters",
        ),
    ] {
        let refusal = Calibration::parse(&edited, "cal.toml")
            .unwrap_err()
            .to_string();
        assert!(refusal.contains(says), "{refusal}");
        assert!(!refusal.contains('\n'), "{refusal}");
    }
}

#[test]
fn verifying_shows_the_error_with_the_effects_removed_and_left() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let text = |name: &str| path(name).to_str().unwrap().to_string();
    record(&path("clean"), false, true);
    record(&path("flawed"), true, true);
    record(&path("cold"), true, false);
    let effects = [
        named(
            "gyro_g_sensitivity",
            &[0.0, 0.0, SAG, SAG, 0.0, 0.0, 0.0, 0.0, 0.0],
        ),
        named("gyro_thermal_bias", &[0.0, 0.0, THERMAL, 0.0, 0.0, 0.0]),
        named("accel_scale_cubic", &[CUBIC; 3]),
    ];
    // The affine part is that of the unit without flaws, and the effects are its flaws: only noise can be left.
    let fit = fitted(&path("clean"));
    let tables = effects.each_ref().map(table);
    std::fs::write(
        path("cal.toml"),
        to_toml(&fit, &tables, "2026-01-01T00:00:00Z"),
    )
    .unwrap();
    let calibration = text("cal.toml");
    let arguments = |recording: &str| {
        let recording = text(recording);
        [
            "verify".into(),
            recording,
            "--calibration".into(),
            calibration.clone(),
        ]
    };
    let run = |recording: &str, more: &[&str]| {
        let all = arguments(recording);
        mimu(
            &all.iter()
                .map(String::as_str)
                .chain(more.iter().copied())
                .collect::<Vec<_>>(),
        )
    };
    let (done, json) = run("flawed", &["--json", "-"]);
    assert!(done, "{json}");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    for sensor in ["gyro", "accel"] {
        let figure = |key: &str| json["sensors"][sensor][key].as_f64().unwrap();
        let floor = figure("noise_floor");
        assert!(
            figure("rms") < 1.5 * floor,
            "{sensor}: {} {floor}",
            figure("rms")
        );
        assert!(
            figure("rms_affine") > 10.0 * floor,
            "{sensor}: {}",
            figure("rms_affine")
        );
        assert!(figure("rms_raw") > figure("rms_affine"), "{sensor}");
    }
    let (_, shown) = run("flawed", &[]);
    assert_eq!(shown.matches("effects left").count(), 2, "{shown}");

    let (done, refusal) = run("cold", &[]);
    assert!(!done);
    assert!(
        refusal.contains("gyro_thermal_bias") && refusal.contains("temp_c is missing"),
        "{refusal}"
    );

    // Without effects nothing is said of them.
    std::fs::write(path("cal.toml"), to_toml(&fit, &[], "2026-01-01T00:00:00Z")).unwrap();
    let (done, json) = run("cold", &["--json", "-"]);
    assert!(done && !json.contains("rms_affine"), "{json}");
}

#[test]
fn an_effect_that_was_edited_or_that_nobody_knows_is_refused_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, true);
    let fit = fitted(&path);
    let effect = library::by_id("gyro_warm_up").unwrap();
    let candidate = Candidate::new(Sensor::Gyro, Kind::Effect(effect));
    let warm_up = table(&removed(candidate, 90.0, &[1e-3, 2e-3, 3e-3]));
    let sag = table(&named("gyro_g_sensitivity", &[1e-5; 9]));
    let text = to_toml(&fit, &[warm_up, sag], "2026-01-01T00:00:00Z");
    let calibration = Calibration::parse(&text, "cal.toml").unwrap();
    let device = calibration.core_effects::<f32, 8>();
    assert!(device.is_ok());

    let edits = [
        (
            "id = \"gyro_warm_up\"",
            "id = \"gyro_magnetic\"",
            "gyro_magnetic",
            "knows no effect",
        ),
        (
            "id = \"gyro_warm_up\"",
            "id = \"accel_warm_up\"",
            "accel_warm_up",
            "sensor is",
        ),
        (
            "id = \"gyro_warm_up\"",
            "id = \"gyro_g_sensitivity\"",
            "gyro_g_sensitivity",
            "has none",
        ),
        (
            "{ name = \"y\", value",
            "{ name = \"w\", value",
            "gyro_warm_up",
            "is none of its: x, y, z",
        ),
        (
            "{ name = \"y\", value",
            "{ name = \"x\", value",
            "gyro_warm_up",
            "twice",
        ),
        (
            "unit = \"rad/s\" }",
            "unit = \"deg/s\" }",
            "gyro_warm_up",
            "unit of",
        ),
        (
            "value = 0.002",
            "value = nan",
            "gyro_warm_up",
            "not a number",
        ),
        (
            "sigma = 2.000e-5",
            "sigma = -1.0",
            "gyro_warm_up",
            "not a number",
        ),
        (
            "value = 90.0",
            "value = 0.0",
            "gyro_warm_up",
            "time_constant_s",
        ),
        ("form = {", "# form = {", "gyro_warm_up", "time_constant_s"),
        (
            "x = C (u - S e) + o",
            "x = C (u + S e) + o",
            "gyro_warm_up",
            "can be applied",
        ),
    ];
    for (from, to, id, says) in edits {
        assert!(text.contains(from), "{from}");
        let at = text.find("[[effect]]").unwrap();
        let (triads, effects) = text.split_at(at);
        let edited = format!("{triads}{}", effects.replacen(from, to, 1));
        let refusal = Calibration::parse(&edited, "cal.toml")
            .unwrap_err()
            .to_string();
        assert!(refusal.contains(id) && refusal.contains(says), "{refusal}");
        assert!(!refusal.contains('\n'), "{refusal}");
    }
    let (first, rest) = text.split_once("\n[[effect]]").unwrap();
    let twice = format!(
        "{first}\n[[effect]]{rest}\n[[effect]]{}",
        rest.split("\n[[effect]]").next().unwrap()
    );
    let refusal = Calibration::parse(&twice, "cal.toml")
        .unwrap_err()
        .to_string();
    assert!(refusal.contains("there twice"), "{refusal}");
    // The sag is by the force.
    let from = text.find("\n[accel]").unwrap();
    let gyro_only = format!("{}\n[[effect]]{rest}", &text[..from]);
    let refusal = Calibration::parse(&gyro_only, "cal.toml")
        .unwrap_err()
        .to_string();
    assert!(
        refusal.contains("gyro_g_sensitivity") && refusal.contains("[accel]"),
        "{refusal}"
    );
}

#[test]
fn more_effects_than_the_device_has_room_for_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, true);
    let effects = ["gyro_bias_drift", "accel_bias_drift", "gyro_thermal_scale"]
        .map(|id| table(&named(id, &[1e-7; 3])));
    let text = to_toml(&fitted(&path), &effects, "2026-01-01T00:00:00Z");
    let calibration = Calibration::parse(&text, "cal.toml").unwrap();
    assert!(calibration.core_effects::<f32, 2>().is_ok());
    let refusal = calibration
        .core_effects::<f32, 1>()
        .unwrap_err()
        .to_string();
    assert!(
        refusal.contains("gyro_thermal_scale") && refusal.contains("at most 1"),
        "{refusal}"
    );
}
