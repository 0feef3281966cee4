//! Readings that are repeated, interleaved, or in another unit than given.

use super::*;

/// Uniform from -1 to 1, by row and channel.
fn noise(i: usize, c: usize) -> f64 {
    let mut state = (i * 6 + c + 1) as u64;
    state = state.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    state ^= state >> 32;
    state = state.wrapping_mul(0xd6e8_feb8_6659_fd93);
    (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

fn at_rest(i: usize) -> [f64; 6] {
    let n = |c: usize| 0.02 * noise(i, c);
    [n(0), n(1), n(2), 0.3 + n(3), n(4), 9.8 + n(5)]
}

#[test]
fn a_sensor_that_is_logged_faster_than_it_updates_is_said_with_its_rate() {
    let slow = log(2000, |i| {
        let [x, y, z, ..] = at_rest(i);
        let [.., a, b, c] = at_rest(i / 4);
        [x, y, z, a, b, c]
    });
    let (summary, ..) = one(&slow, BOTH).unwrap();
    warns(&summary, "accel: it repeats its reading");
    warns(&summary, "at 25.0 Hz, but the log has 100.0 Hz");
    assert!(!warned(&summary, "gyro: it repeats"), "{summary:?}");
}

#[test]
fn a_person_can_say_that_suspicious_readings_are_right() {
    let swing = |i: usize| (400.0 * (0.05 * i as f64).sin()) as i32;
    let codes = |i: usize| [swing(i) as u16, 3, 9, 4, 2, 4096].map(u32::from);
    let text = log(600, codes);
    let bench = Bench::new(&[("a.txt", &text)]);
    let mut options = bench.options(&["a.txt"], &[BOTH]);
    let refused = import(&options, &bench.path("out"), |_| ()).unwrap_err();
    assert!(
        refused
            .refused()
            .arguments
            .contains(&Argument::TrustReadings),
        "{refused}"
    );
    options.log.trust_readings = true;
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert!(warned(&summary, "unsigned codes"), "{summary:?}");
    assert_eq!(batch.len(), text.lines().count());
    assert!(manifest.trusts_readings());
}

#[test]
fn forces_in_si_that_are_not_of_the_size_of_gravity_are_said() {
    for (factor, wrong) in [
        (1.0, false),
        (0.25, true),
        (1.0 / 9.81, true),
        (101.9, true),
        (1.1, false),
    ] {
        let text = log(500, |i| at_rest(i).map(|u| factor * u));
        let bench = Bench::new(&[("a.txt", &text)]);
        let mut options = bench.options(&["a.txt"], &[BOTH]);
        options.raw_unit = RawUnit::Si;
        let (summary, ..) = bench.import(&options).unwrap();
        assert_eq!(
            warned(&summary, "times the input"),
            wrong,
            "{factor} {summary:?}"
        );
    }
}

#[test]
fn unsigned_codes_of_negative_readings_are_named_with_their_bits_and_overflows_warned_of() {
    let swing = |i: usize| (400.0 * (0.05 * i as f64).sin()) as i32;
    let codes = |i: usize| [swing(i) as u16, 3, 9, 4, 2, 4096].map(u32::from);
    let error = one_refused(&log(600, codes), BOTH);
    assert!(error.contains("gyro_x=16"), "{error}");
    let bench = Bench::new(&[("a.txt", &log(600, codes))]);
    let mut options = bench.options(&["a.txt"], &[BOTH]);
    options.log.twos_complement = vec!["gyro_x=16".parse().unwrap()];
    let (_, batch, _) = bench.import(&options).unwrap();
    assert_eq!(batch.raw[0][100], f64::from(swing(100)));
    // A turn beyond the range of the firmware's integers.
    let fast = |i: usize| (40_000.0 * (0.05 * i as f64).sin()) as i32;
    let overflowing = |i: usize| [i32::from(fast(i) as i16), 3, 9, 4, 2, 4096];
    let (summary, ..) = one(&log(600, overflowing), BOTH).unwrap();
    warns(&summary, "gyro_x: it jumps");
}

#[test]
fn readings_without_gravity_are_named_and_the_magnitude_that_is_given_is_the_median() {
    let si = |values: [f64; 3]| {
        let text = log(300, |i| {
            let [x, y, z] = values;
            [
                0.01 * (i % 5) as f64,
                0.02,
                0.01,
                x + 0.001 * (i % 7) as f64,
                y,
                z,
            ]
        });
        let bench = Bench::new(&[("a.txt", &text)]);
        let mut options = bench.options(&["a.txt"], &[BOTH]);
        options.raw_unit = RawUnit::Si;
        options.log.rate_hz = Some(100.0);
        bench.import(&options).unwrap().0
    };
    let summary = si([0.02, 0.01, 0.03]);
    warns(&summary, "a filter has removed it");
    let summary = si([0.0, 0.0, 1007.0]);
    warns(&summary, "about 103 times the input: they are in mg");
    let summary = si([0.0, 0.0, 1.0]);
    warns(&summary, "about 0.102 times the input: they are in g");
    for (z, said) in [
        (
            0.00980665,
            "they were taken for mg, and are in g: import them in g",
        ),
        (0.0961704, "they were taken for mg, and are in m/s²"),
        (9806.65, "they were taken for g, and are in mg"),
    ] {
        warns(&si([0.0, 0.0, z]), said);
    }
    assert!(!warned(&si([0.1, 0.2, 9.6]), "specific force"));
}
