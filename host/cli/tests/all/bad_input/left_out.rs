//! Bad data that can be left out is left out and named; the result is right.

use super::answer::*;
use super::damage::*;
use super::generator::*;

#[test]
fn what_can_be_left_out_is_named_and_the_result_is_right() {
    #[rustfmt::skip]
    let cases: &[Case] = &[
        ("a few empty cells", by_hand, |s| { s.edit("accel_y", 50..53, |_| f64::NAN); s.edit("gyro_x", 100..101, |_| f64::NAN) }, &["3 samples of accel_y", "1 sample of gyro_x"]),
        ("an empty cell in a turn", by_hand, |s| s.edit("gyro_x", within(&s.turn(3), 50, 1), |_| f64::NAN), &["the turn from dwell 3 to 4", "samples are missing"]),
        ("rows twice", by_hand, |s| { s.edit("accel_y", 100..101, |_| f64::NAN); s.repeat(&[900, 500, 100]) }, &["3 rows repeat the row before"]),
        ("a rate that is one per cent off", by_hand, |s| s.set("sample_rate_hz", "99.0"), &["100.000 Hz", "99 Hz", "the stamps are used"]),
        ("a gap in a dwell", by_hand, |s| drop(s.rows.drain(within(&s.dwells[4], 100, 50))), &["1 gap, 0.500 s", "data row 1897"]),
        ("a gap in a turn", by_hand, |s| drop(s.rows.drain(within(&s.turn(4), 50, 20))), &["1 gap", "the turn from dwell 4 to 5 is not used"]),
        ("a day between two halves", by_hand, |s| s.edit("t_s", s.second_half(), |t| t + 86400.0), &["86400.000 s missing"]),
        ("accelerometer stuck in dwells", by_hand, |s| column_of_dwell(s, "accel_y", &[3, 4, 9]), &["3 dwells (3, 4, 9)", "accel_y stuck"]),
        ("gyro stuck on the table", on_table, |s| column_of_dwell(s, "gyro_y", &[3, 4, 9]), &["3 dwells (3, 4, 9)", "gyro_y stuck"]),
        ("gyro stuck in a third of a turn", by_hand, |s| s.stick("gyro_y", within(&s.turn(3), 50, 50)), &["the turn from dwell 3 to 4 is not used: gyro_y is stuck"]),
        ("gyro stuck in the second half", by_hand, |s| s.stick("gyro_y", s.second_half()), &["10 dwells", "gyro_y stuck"]),
        ("accelerometer clipped", by_hand, |s| s.edit("accel_z", s.all(), |u| u.min(14000.0)), &["accel_z: the highest value 14000", "accel_z saturated"]),
        ("half of the samples clipped", on_table, |s| s.edit("accel_z", s.all(), |u| u.min(16302.0)), &["5 dwells (20, 21, 22, 23, 24)", "accel_z saturated"]),
        ("gyro clipped in fast turns", by_hand, |s| s.edit("gyro_z", s.all(), |u| u.clamp(-6000.0, 6000.0)), &["gyro_z: the lowest value -6000", "gyro_z is at its rail"]),
        ("readings beyond a declared rail", by_hand, |s| s.set("rails.accel", "[-32768.0, 14000.0]"), &["accel_z saturated"]),
        ("vibration in one step", on_table, |s| s.shake("accel_x", 7), &["1 dwell (7) is not used: not still enough for the accel"]),
        ("one absurd sample in a turn, where a converter ends", by_hand, |s| s.edit("gyro_x", within(&s.turn(2), 70, 1), |_| 32767.0), &["gyro_x: 1 sample at 32767", "the turn from dwell 2 to 3 is not used: gyro_x is at its rail"]),
        ("one absurd sample in a turn", by_hand, |s| s.edit("gyro_x", within(&s.turn(2), 70, 1), |_| 32000.0), &["the turn from dwell 2 to 3 is not used: it ends"]),
    ];
    for (name, base, damage, words) in cases {
        println!("{name}");
        let mut samples = base();
        damage(&mut samples);
        let result = Place::with(&samples).fit(&[]).json();
        warned(&result, words);
        right(&result);
    }
}
