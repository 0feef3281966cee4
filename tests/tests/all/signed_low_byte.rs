//! A firmware on the bench that takes the low byte of a reading for a signed number: its readings are refused, and only those.

use mimu::fit::{Options, fit};
use mimu_recording::error::Argument;
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
