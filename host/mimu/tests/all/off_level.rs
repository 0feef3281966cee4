//! Six faces that were not level: a fit says so, and says nothing of level faces.

use mimu::fit::{Options, fit};
use mimu::signal::stillness::STILL_FACTOR;
use mimu::{Manifest, Prepared, RawUnit, Reference, Samples};
use mimu_rig::random::Random;
use nalgebra::{Matrix3, Rotation3, Vector3};

const G: f64 = 9.80665;

/// An accelerometer on six faces, three seconds each, 80 mV per m/s², misaligned by some degrees.
struct Unit {
    /// Standard deviation of the tilts of a face, rad.
    tilt: f64,
    /// Quadratic coefficient of each axis, per m/s².
    square: f64,
}

fn warnings(unit: &Unit, seed: u64) -> Vec<String> {
    let mut random = Random::new(seed, "faces");
    let matrix =
        Matrix3::from_fn(|i, j| 0.08 * (f64::from(u8::from(i == j)) + random.within(0.03)));
    let mut samples = Samples::default();
    for face in 0..6 {
        let mut known = Vector3::zeros();
        known[face / 2] = if face % 2 == 0 { G } else { -G };
        let tilt = Vector3::from_fn(|_, _| unit.tilt * random.normal());
        let force = Rotation3::new(tilt) * known;
        let seen = force.map(|f| f + unit.square * f * f);
        for _ in 0..300 {
            samples.t_s.push(samples.t_s.len() as f64 / 100.0);
            samples.step.push(face as i32);
            for axis in 0..3 {
                let raw = matrix.row(axis).transpose().dot(&seen) + 1.65 + 1e-3 * random.normal();
                samples.raw[3 + axis].push(raw);
                samples.reference[3 + axis].push(known[axis]);
            }
        }
    }
    let manifest = Manifest::new("u", 100.0, G, RawUnit::Volt, Reference::Table);
    let prepared = Prepared::of(manifest, &samples, STILL_FACTOR).unwrap();
    let fit = fit(prepared, Options::IN_SAMPLE).unwrap();
    fit.sensors[0]
        .warnings
        .iter()
        .map(ToString::to_string)
        .collect()
}

const SAYS: [&str; 2] = [
    "accel: the errors are perpendicular to the known force, as if the dwells were off level by ",
    " deg rms: level the faces, or use only the magnitude of gravity (reference = \"gravity\")",
];

/// The reported angle, deg.
fn said(warnings: &[String]) -> Option<f64> {
    let off_level = warnings.iter().find_map(|w| w.strip_prefix(SAYS[0]))?;
    off_level.strip_suffix(SAYS[1])?.parse().ok()
}

#[test]
fn faces_off_level_are_named() {
    let tilted = Unit {
        tilt: 2_f64.to_radians(),
        square: 0.0,
    };
    let mut angles = Vec::new();
    for seed in 1..=30 {
        angles.extend(said(&warnings(&tilted, seed)));
    }
    // Six faces leave three degrees of freedom, so sometimes they show hardly anything of the tilts.
    assert!(angles.len() >= 28, "{angles:?}");
    // A tilt has two components perpendicular to the force.
    let rms = (angles.iter().map(|a| a * a).sum::<f64>() / angles.len() as f64).sqrt();
    assert!((2.2..3.6).contains(&rms), "{rms}");
}

#[test]
fn level_faces_of_a_misaligned_and_of_a_nonlinear_accelerometer_are_not_said_to_be_off_level() {
    // 0 and 20 mg/g².
    for square in [0.0, 2e-3] {
        for seed in 1..=30 {
            let level = Unit { tilt: 0.0, square };
            let warnings = warnings(&level, seed);
            assert_eq!(said(&warnings), None, "{square}, {seed}: {warnings:?}");
        }
    }
}
