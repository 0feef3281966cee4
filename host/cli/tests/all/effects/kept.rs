//! The calibration stored by a device, fetched back, as input of every command.

use mimu::calibration::Calibration;
use mimu_device::{Image, calibration};

use super::unit::{calibrated, fitted, flaws, record};
use super::{every_effect, mimu};

const CREATED: &str = "2026-01-01T00:00:00Z";

/// The file fetched from a device that stores this calibration.
fn fetched(calibration_file: &Calibration) -> (Image, Calibration) {
    let image = Image::new(calibration_file, "cal.toml").unwrap();
    let kept = calibration(&image.bytes, None, &calibration_file.device, "port").unwrap();
    let text = kept.to_toml();
    (image, Calibration::parse(&text, "kept.toml").unwrap())
}

#[test]
fn every_effect_is_fetched_as_it_was_sent() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    record(&path, false, true);
    let fit = fitted(&path);
    let made = Calibration::of(&fit, &every_effect(), CREATED).unwrap();
    let (sent, kept) = fetched(&made);
    let again = Image::new(&kept, "kept.toml").unwrap();
    assert!(again.bytes == sent.bytes, "to the last bit");
    let ids =
        |c: &Calibration| -> Vec<String> { c.effects().iter().map(|e| e.candidate.id()).collect() };
    assert_eq!(ids(&kept), ids(&made));
    assert_eq!(kept.recording.sha256, made.recording.sha256);
    assert_eq!(kept.created.as_deref(), Some(CREATED));
}

#[test]
fn the_other_commands_take_what_was_fetched_and_say_what_they_lack() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let text = |name: &str| path(name).display().to_string();
    let [sag, _, cubic] = flaws();
    let made = calibrated(folder.path(), &[sag, cubic]);
    let (_, kept) = fetched(&made);
    assert!(made.is_uncertain() && !kept.is_uncertain());
    std::fs::write(path("kept.toml"), kept.to_toml()).unwrap();
    let run = |command: &[&str], file: &str| {
        let calibration = text(file);
        let all = [command, &["--calibration", &calibration, "--json", "-"]].concat();
        let (done, said) = mimu(&all);
        assert!(done, "{all:?}: {said}");
        serde_json::from_str::<serde_json::Value>(&said).unwrap()
    };
    let flawed = text("flawed");
    for sensor in ["gyro", "accel"] {
        let [before, after] = ["cal.toml", "kept.toml"].map(|file| {
            let judged = run(&["verify", &flawed], file);
            judged["sensors"][sensor]["rms"].as_f64().unwrap()
        });
        // Single precision is 6e-8 of some volts, and of gravity.
        let most = 1e-4 * before + 6e-8 * 9.8;
        assert!((before - after).abs() < most, "{before} {after}");
    }
    let out = text("compensated");
    let applied = run(&["apply", &flawed, "-o", &out], "kept.toml");
    assert_eq!(applied["effects"].as_array().unwrap().len(), 2);

    let lacks = |found: &serde_json::Value| {
        let warnings = found["warnings"].to_string();
        warnings.contains("has no uncertainty")
    };
    assert!(lacks(&run(&["diagnose", &flawed], "kept.toml")));
    assert!(!lacks(&run(&["diagnose", &flawed], "cal.toml")));
}
