//! Effects planted in recordings by other people. `make blind` runs the complete study.

use mimu_tests::planted::{Outcome, grounds};

#[test]
fn effects_planted_in_a_real_recording_are_named_alone_and_mostly_removed() {
    let Some(ground) = grounds().into_iter().next() else {
        return;
    };
    let untouched = ground.untouched(false).expect("a diagnosis");
    assert!(untouched.found.is_empty(), "{:?}", untouched.found);
    for id in ["gyro_g_sensitivity", "accel_scale_quadratic"] {
        let planted = ground.plant(id, 1.0, 0, &untouched).expect("it shows");
        println!("{planted:?}");
        assert_eq!(planted.outcome(), Outcome::Named, "{planted:?}");
        assert_eq!(planted.not_there().count(), 0, "{planted:?}");
        let [_, affine, with_effects] = planted.errors;
        assert!(with_effects < 0.3 * affine, "{planted:?}");
    }
}

/// At the size of its data sheet, a quadratic of 0.3 deg/s at 300 deg/s is a hundredth of a degree per second at the rates of a hand.
#[test]
fn an_effect_below_what_a_real_recording_can_carry_is_named_by_nobody() {
    let Some(ground) = grounds().into_iter().next() else {
        return;
    };
    let untouched = ground.untouched(false).expect("a diagnosis");
    let planted = ground.plant("gyro_scale_quadratic", 1.0, 0, &untouched);
    let planted = planted.expect("it changes readings");
    assert!(planted.strength < 1.0, "{planted:?}");
    assert_eq!(planted.outcome(), Outcome::Missed, "{planted:?}");
    assert_eq!(planted.not_there().count(), 0, "{planted:?}");
}
