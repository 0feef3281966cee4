//! Several sessions of one unit diagnosed together: the effect of the file on another session. `blind joint` runs the complete study.

use mimu_tests::joint::{Set, case};

/// Five sessions from power-on of a unit that warms up.
#[test]
#[ignore = "nightly: a diagnosis of five sessions"]
fn a_file_with_effects_is_no_worse_on_another_session_than_one_without() {
    let case = case(&Set::of_warm_up(5, 6));
    assert!(case.as_written.is_some(), "{case:?}");
    assert!(!case.is_worse(), "{case:?}");
}
