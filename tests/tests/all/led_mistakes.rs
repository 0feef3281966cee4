//! Boards with which no session can succeed: the wizard ends it as soon as the data show why, and says so.

use mimu_tests::spinner::Spinner;
use mimu_tests::text_board::{GRAVITY, TextBoard, rotation};
use mimu_wizard::event::Event;
use mimu_wizard::relay::Arrival;

use crate::led_whole_turns::begin;
use mimu_tests::says;

/// Why the session of a person with this board is refused, and when, s. The board is exchanged for `other` after so many dwells.
fn refused(mut person: Spinner, more: &str, mut other: Option<(i32, TextBoard)>) -> (String, f64) {
    let folder = tempfile::tempdir().unwrap();
    let mut led = begin(&folder.path().join("out"), &person, more);
    let mut said = Vec::new();
    loop {
        let at = other.as_ref().map(|(at, _)| *at);
        let stop =
            |event: &Event| matches!(event, Event::Dwell { number, .. } if Some(number + 1) == at);
        if let Some((_, refused)) = led.lead(&mut person, &mut said, stop) {
            return (
                refused.unwrap_or_else(|| panic!("{}", said.join("\n"))),
                person.now_s,
            );
        }
        let lost = Arrival::Lost("unplugged".into());
        for (later_s, arrival) in [(0.0, lost), (1.0, Arrival::Opened)] {
            let _ = led.arrivals.send((person.now_s + later_s, arrival));
        }
        person.now_s += 1.0;
        person.board = other.take().expect("another board").1;
    }
}

#[test]
fn a_gyro_that_leaves_its_range_in_every_turn_is_named_after_four_of_them() {
    let mut board = TextBoard::new(2);
    // 20 deg/s.
    board.largest[0] = 3754.9 * 20_f64.to_radians();
    let (why, at_s) = refused(Spinner::new(board, 1, &[]), "", None);
    says(
        &why,
        &["the gyro is at the end of its range in 4 of 4 turns"],
    );
    assert!(
        why.contains("larger range") && at_s < 60.0,
        "{at_s} s: {why}"
    );
}

#[test]
fn an_accelerometer_whose_range_ends_at_gravity_is_named_at_the_first_pose_that_shows_it() {
    let mut board = TextBoard::new(3);
    board.truth.triads[1].bias = [0.0; 3];
    board.largest[1] = 1.007 * 1670.1 * GRAVITY;
    for row in 0..3 {
        // 2 % above nominal.
        board.truth.triads[1].matrix[row][row] = 1.02 * 1670.1;
    }
    let (why, at_s) = refused(Spinner::new(board, 1, &[]), "", None);
    says(&why, &["is at the end of its range where the unit rests"]);
    assert!(why.contains("accel_") && at_s < 60.0, "{at_s} s: {why}");
}

#[test]
fn rates_in_degrees_per_second_in_a_hand_that_shakes_are_named_at_the_first_turn() {
    let mut board = TextBoard::new(5);
    for (triad, per_si) in board
        .truth
        .triads
        .iter_mut()
        .zip([57.295_779_5 / 3754.9, 1.0 / 1670.1])
    {
        triad.matrix = triad.matrix.map(|row| row.map(|m| m * per_si));
        triad.bias = triad.bias.map(|b| b * per_si);
    }
    board.noise = [0.08, 0.03];
    board.steps = [0.0; 2];
    let mut person = Spinner::new(board, 1, &[]);
    person.tremor = 0.03;
    // On its side.
    person.attitude = rotation([1.5, 0.0, 0.0]);
    let (why, at_s) = refused(person, "--raw-unit SI --fixture hands", None);
    assert!(why.contains("as if it were in deg/s"), "{why}");
    assert!(at_s < 40.0, "{at_s} s: {why}");
}

#[test]
fn another_board_that_is_plugged_in_on_the_way_is_named() {
    let other = Some((7, TextBoard::new(77)));
    let (why, at_s) = refused(Spinner::new(TextBoard::new(6), 1, &[]), "", other);
    says(&why, &["after dwell 7", "another unit"]);
    assert!(at_s < 200.0, "{at_s} s: {why}");
}
