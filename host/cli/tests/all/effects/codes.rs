//! Converter nonlinearity: removed from blocks and from samples, and refused if the converters make no sense.

use mimu::calibration::Calibration;
use mimu::effects;
use mimu::effects::candidate::{Candidate, CandidateKind};
use mimu::effects::fitted::FittedEffect;
use mimu::effects::removal::remove;
use mimu::effects::{converter::Converter, readout::first_of};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu_core::compensation::Sample;
use mimu_core::effects::Effects;
use mimu_device::Image;
use nalgebra::Vector3;

use super::unit::{
    BIT_0_V, WORTH_V, ZERO_V, fitted, fitted_effect, prepared, record, write_recording,
};

/// Converters of the accelerometer, as in the recording.
fn converters() -> FittedEffect {
    let effect = effects::by_id("accel_readout_code").unwrap();
    let mut candidate = Candidate::new(Sensor::Accel, CandidateKind::Effect(effect));
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
    fitted_effect(candidate, 0.0, &values)
}

#[test]
fn errors_by_the_code_are_taken_out_block_by_block_and_sample_by_sample() {
    let folder = tempfile::tempdir().unwrap();
    let [clean, coded] = ["clean", "coded"].map(|name| folder.path().join(name));
    // The same noise, bit by bit.
    record(&clean, false, false);
    write_recording(&coded, false, true, false);
    let fit = fitted(&clean);
    let text = Calibration::of(&fit, &[converters()], "2026-01-01T00:00:00Z")
        .unwrap()
        .to_toml();
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
    // One for each axis, and the device has room for them.
    let image = Image::new(&calibration, "cal.toml").unwrap();
    assert_eq!(image.stored().unwrap().effect_count, 3);
    assert_eq!(image.effects, ["accel_readout_code"]);
    let text = std::fs::read_to_string(coded.join("samples.csv")).unwrap();
    let samples: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|v| v.parse().unwrap()).collect())
        .collect();
    let mean = |block: &mimu::signal::blocks::Block| Vector3::from_fn(|i, _| block.raw[3 + i].mean);
    let blocks = |of: &Prepared| of.condensed.blocks.clone();
    // Error against the truth, V: the error added, and the errors remaining by block and by sample.
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
    // Around the transition of a bit that is worth too little, some codes before and after have the same reading, and from five samples the fraction
    // of time is known to a fifth. One transition in the wrong place, or of the wrong sign, would leave more than all of this.
    for left in [&by_block, &by_sample] {
        assert!(rms(left) < 0.12 * rms(&put), "{}", rms(left));
        assert!(mean(left) < 0.04 * rms(&put), "{}", mean(left));
    }
}

#[test]
fn converters_that_make_no_sense_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, false);
    let fit = fitted(&path);
    let text = Calibration::of(&fit, &[converters()], "2026-01-01T00:00:00Z")
        .unwrap()
        .to_toml();
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
            "reading_of_code_0_within_raw = 0.0",
            "reading_of_code_0_within_raw = -1.0",
            "reading_of_code_0_within_raw is -1.0",
        ),
        (
            "formula = \"x = C (u - S e)",
            "nonlinear_parameter = { name = \"time_constant_s\", value = 3.0 }\nformula = \"x = C (u - S e)",
            "has no nonlinear parameter",
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
