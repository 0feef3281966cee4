//! Effects planted in recordings by other people. `make blind` runs the complete study.

use mimu::quantity::Sensor;
use mimu_tests::planted::{Outcome, grounds, in_two_sessions};

#[test]
fn effects_planted_in_a_real_recording_are_named_alone_and_mostly_removed() {
    let Some(ground) = grounds().into_iter().next() else {
        return;
    };
    let untouched = ground.untouched(false).expect("a diagnosis");
    assert!(untouched.said.found.is_empty(), "{:?}", untouched.said);
    for id in ["gyro_g_sensitivity", "accel_scale_quadratic"] {
        let planted = ground.plant(id, 1.0, 0, &untouched).expect("it shows");
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

/// Of two units of the array. By the biases of the session before, turns err more with the effect: 0.277 to 0.284 deg, and 0.272 to 0.287 deg.
#[test]
fn a_g_sensitivity_that_the_rates_at_rest_of_another_session_show_is_accepted() {
    // Along all axes alike it would be a rate about the vertical.
    let matrix = [0.03, -0.03, 0.0, 0.0, 0.03, -0.03, -0.03, 0.0, 0.03];
    let id = "gyro_g_sensitivity";
    for unit in [0, 4] {
        let sizes = [("matrix_dps_per_g", matrix.to_vec())];
        let Some(found) = in_two_sessions(unit, [6, 7], id, sizes.into()) else {
            return;
        };
        let found = found.expect("a diagnosis");
        let gyro = found.sensors.iter().find(|s| s.sensor == Sensor::Gyro);
        let gyro = &gyro.expect("recorded").decision;
        let accepted = gyro.accepted.iter().find(|a| a.effect.id() == id);
        let second = accepted.and_then(|a| a.second);
        assert!(second.is_some(), "unit {unit}: {:?}", gyro.rejected);
    }
}
