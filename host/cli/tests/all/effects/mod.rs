//! Effects in a calibration: written, read, removed by the PC and the device alike, and shown by `mimu verify`.

pub mod applied;
mod core_program;
mod gaps;
mod kept;
mod law;
mod refused;
pub mod unit;

use std::path::Path;

use mimu::calibration::Calibration;
use mimu::effects;
use mimu::effects::candidate::{Candidate, CandidateKind};
use mimu::effects::effect::OnDevice;
use mimu::effects::fitted::FittedEffect;
use mimu::effects::quantity::Quantity;
use mimu::effects::regressor::Product;
use mimu::effects::removal::remove;
use mimu::quantity::Sensor;
use mimu_core::compensation::Sample;
use mimu_core::effects::{Effects, State};
use nalgebra::Vector3;

use crate::command::run as command;
use unit::{fitted, fitted_effect, record};

/// All named effects, some with only part of their coefficients, and three terms; at ten times data-sheet size.
fn every_effect() -> Vec<FittedEffect> {
    let mut all: Vec<FittedEffect> = effects::all()
        .filter(|effect| effect.on_device() != OnDevice::Never)
        .enumerate()
        .map(|(n, effect)| {
            let mut candidate = Candidate::new(effect.sensor, CandidateKind::Effect(effect));
            if n % 2 == 1 {
                candidate.active.remove(1);
            }
            let sign = |k: usize| if (n + k).is_multiple_of(3) { -1.0 } else { 1.0 };
            let values: Vec<f64> = candidate
                .active
                .iter()
                .map(|k| {
                    sign(*k) * effect.coefficients[*k].typical * (10.0 + 3.0 * (*k as f64).sqrt())
                })
                .collect();
            let form = effect.parameter.map_or(0.0, |p| 2.0 * p.from);
            fitted_effect(candidate, form, &values)
        })
        .collect();
    let term = |sensor, axis, v: &[Quantity], value| {
        fitted_effect(
            Candidate::new(sensor, CandidateKind::Term(axis, Product::term(v).unwrap())),
            0.0,
            &[value],
        )
    };
    use Quantity::{Force, Rate, Temperature, TemperatureRate, Time};
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
    let text = Calibration::of(&fit, &effects, "2026-01-01T00:00:00Z")
        .unwrap()
        .to_toml();
    let calibration = Calibration::parse(&text, "cal.toml").unwrap();
    assert_eq!(calibration.effects().len(), effects.len());
    for (read, written) in calibration.effects().iter().zip(&effects) {
        assert_eq!(read.candidate.id(), written.candidate.id());
        assert_eq!(read.candidate.active, written.candidate.active);
        assert_eq!(
            (read.parameter, &read.values),
            (written.parameter, &written.values)
        );
    }

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
        let si = |block: &mimu::signal::blocks::Block| {
            let raw = |from: usize| Vector3::from_fn(|i, _| block.raw[from + i].mean);
            Sample {
                gyro: gyro.apply(&raw(0)),
                accel: accel.apply(&raw(3)),
            }
        };
        // Blocks are not successive samples: like the PC, evaluate twice and without an angular acceleration.
        state.gap();
        let by_device = device.remove(&mut state, &si(block));
        let (by_host, raw) = (si(clean), si(block));
        // The same formula in another order: rounding only.
        assert!((by_device.gyro - by_host.gyro).norm() < 1e-12);
        assert!((by_device.accel - by_host.accel).norm() < 1e-12);
        moved[0] = moved[0].max((by_host.gyro - raw.gyro).norm());
        moved[1] = moved[1].max((by_host.accel - raw.accel).norm());
    }
    assert!(moved[0] > 0.01 && moved[1] > 0.1, "{moved:?}");
}

/// Whether the command succeeds, and what it prints then or why it fails.
pub fn mimu(arguments: &[&str]) -> (bool, String) {
    let ran = command(Path::new("."), arguments);
    match ran.status {
        Some(0) => (true, ran.stdout),
        _ => (false, ran.stderr),
    }
}
