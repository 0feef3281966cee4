//! A firmware on the bench that takes the low byte of a reading for a signed number: its readings are refused, and only those.

use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::error::Argument;
use mimu_recording::{ImportOptions, Recording, import};
use mimu_rig::located::Source;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench;

const RIG: &str = include_str!("../../../rig/rigs/sign-extension.toml");

#[test]
fn readings_whose_low_byte_was_taken_for_a_signed_number_are_refused_by_their_channels() {
    let both = RigFile::parse(&Source::new("rig", RIG)).expect("a rig file");
    for (kept, named, sound) in [
        ("gyro_sign_extension", "gyro_x, gyro_y, gyro_z:", "accel_x"),
        (
            "accel_sign_extension",
            "accel_x, accel_y, accel_z:",
            "gyro_x",
        ),
    ] {
        let mut file = both.clone();
        file.effect.retain(|effect| effect.id == kept);
        assert_eq!(file.effect.len(), 1);
        let recorded = bench::recorded(&bench::hand_plan(20), &file, 3);
        let error = fit(recorded, Options::IN_SAMPLE).expect_err(kept);
        assert_eq!(
            error.refused().arguments,
            [Argument::SignedLowByte, Argument::TrustReadings]
        );
        let refused = error.to_string();
        assert!(
            refused.contains(named) && refused.contains("low byte") && !refused.contains(sound),
            "{refused}"
        );
    }
    let mut sound = both;
    sound.effect.clear();
    assert!(
        fit(
            bench::recorded(&bench::hand_plan(20), &sound, 3),
            Options::IN_SAMPLE
        )
        .is_ok()
    );
}

#[test]
fn an_import_that_mends_the_low_byte_gives_the_calibration_of_the_same_unit_without_the_fault() {
    let faulty = RigFile::parse(&Source::new("rig", RIG)).expect("a rig file");
    let mut sound = faulty.clone();
    sound.effect.clear();
    let plan = bench::hand_plan(20);
    for seed in 1..=3 {
        // Both recordings are imported, because an import assigns times to the samples.
        let imported = |file: &RigFile, columns: &[&str]| {
            let folder = bench::written(&plan, file, seed);
            let recording = Recording::open(&folder.path().join("recording")).unwrap();
            let manifest = &recording.manifest;
            let mut options = ImportOptions::new(
                vec![recording.samples.clone()],
                manifest.gravity_mps2,
                manifest.raw_unit,
                manifest.reference,
            );
            options.log.device = Some(manifest.device.clone());
            options.log.signed_low_byte = columns.iter().map(|c| c.parse().unwrap()).collect();
            let out = folder.path().join("mended");
            import(&options, &out, |_| ()).expect("an import");
            let mended = Recording::open(&out).unwrap();
            Prepared::read(&mended, STILL_FACTOR, |_| ()).expect("readable")
        };
        let right = fit(imported(&sound, &[]), Options::IN_SAMPLE).expect("a fit");
        let found = fit(imported(&faulty, &["gyro", "accel"]), Options::IN_SAMPLE).expect("a fit");
        for (found, right) in found.sensors.iter().zip(&right.sensors) {
            let [a, b] = [found, right].map(|s| &s.estimated.triad);
            assert_eq!(
                (a.forward, a.inverse),
                (b.forward, b.inverse),
                "seed {seed}"
            );
            assert_eq!(a.forward_covariance, b.forward_covariance);
        }
        // In a sensor that is not mended, the fault remains and is refused as before.
        let refused = fit(imported(&faulty, &["gyro"]), Options::IN_SAMPLE)
            .unwrap_err()
            .to_string();
        assert!(
            refused.contains("accel_x") && !refused.contains("gyro"),
            "{refused}"
        );
    }
}
