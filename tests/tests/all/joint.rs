//! Several sessions of one unit diagnosed together: the effect of the file on another session. `blind joint` runs the complete study.

use mimu_tests::by_hand::Grade;
use mimu_tests::joint::{Set, case};

/// Five sessions from power-on of a unit that warms up.
#[test]
#[ignore = "nightly: a diagnosis of five sessions"]
fn a_file_with_effects_is_no_worse_on_another_session_than_one_without() {
    let case = case(&Set::of_warm_up(5, 6));
    assert!(case.as_written.is_some(), "{case:?}");
    assert!(!case.is_worse(), "{case:?}");
}

/// In poses near the faces the rows determine a cubic poorly. Without y, x came out as 21.9 ± 2.0 mg/g³; without z, y as 21.0 ± 3.0.
#[test]
fn the_axes_of_a_cubic_by_hand_stay_together_and_their_intervals_hold_the_truth() {
    for seed in [0, 10] {
        let size = "mg_per_g3 = [12.0, 12.0, 12.0]";
        let case = case(&Set::of_cubic(size, Some(15.0), Grade::Analog, seed));
        let [cubic] = &case.effects[..] else {
            panic!("{case:?}");
        };
        assert_eq!(cubic.id(), "accel_scale_cubic");
        assert_eq!(cubic.candidate.active, [0, 1, 2]);
        for (value, sigma) in cubic.values.iter().zip(&cubic.sigmas) {
            let [value, sigma] = [value, sigma].map(|v| v * 1e3 * 9.806_65 * 9.806_65);
            assert!(
                (value - 12.0).abs() < 3.0 * sigma && sigma < 6.0,
                "{case:?}"
            );
        }
        let judged = case.as_written.expect("judged").of_files;
        let directions = case.directions.expect("judged");
        assert!(judged[1][1] < 0.7 * judged[0][1], "{case:?}");
        assert!(directions[1] < directions[0], "{case:?}");
    }
}
