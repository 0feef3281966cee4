//! A firmware on the bench that takes the low byte of a reading for a signed number: its readings are refused, and nobody else's.

use mimu::fit::{Method, Options, fit};
use mimu::stillness::STILL_FACTOR;
use mimu_rig::located::Source;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench;

const RIG: &str = include_str!("../../../rig/rigs/sign-extension.toml");

const OPTIONS: Options = Options {
    method: Method::LeastSquares,
    holdout_blocks: 0,
    still_factor: STILL_FACTOR,
    only: None,
};

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
        let refused = fit(recorded, OPTIONS).expect_err(kept).to_string();
        assert!(
            refused.contains(named) && refused.contains("low byte") && !refused.contains(sound),
            "{refused}"
        );
    }
    let mut sound = both;
    sound.effect.clear();
    assert!(fit(bench::recorded(&bench::hand_plan(20), &sound, 3), OPTIONS).is_ok());
}
