//! What becomes of the time stamps of foreign files.

use super::*;

#[test]
fn times_that_go_back_for_good_are_refused_with_file_and_row_and_repeated_rows_are_left_out() {
    let good = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
    let bad = [10.0, 10.1, 10.2, 0.3, 0.4, 0.5];
    let error = join(&good, &bad).unwrap_err().to_string();
    assert!(error.contains("g, data row 4, column t_s"), "{error}");
    let error = one(&timed(&bad), GYR).unwrap_err().to_string();
    assert!(error.contains("data row 4, column t_s"), "{error}");
    let twice = [0.0, 0.1, 0.1, 0.2, 0.3, 0.3, 0.4];
    let (summary, batch, _) = one(&timed(&twice), GYR).unwrap();
    assert_eq!(summary.time[0].repeated_rows, 2);
    assert_eq!(batch.t_s, good[..5]);
    assert_eq!(batch.raw[0], [0.0, 0.2, 0.4, 0.6, 0.8]);
}

#[test]
fn a_file_with_nanoseconds_since_1970_has_the_rate_to_all_its_digits() {
    let row = |i: u64| format!("{},1,2,3\n", 1_403_636_579_763_555_584 + i * 5_000_000);
    let text: String = (0..2000).map(row).collect();
    let bench = Bench::new(&[("a", &text)]);
    let (summary, batch, manifest) = bench.import(&bench.options(&["a"], &[GYR])).unwrap();
    assert_eq!(manifest.sample_rate_hz, 200.0);
    assert_eq!(summary.time[0].unit, Some(Decimal::Nanosecond));
    assert_eq!(summary.time[0].origin_s, 1_403_636_579);
    assert_eq!(batch.t_s[0], 0.763_555_584);
    assert!((batch.t_s[1999] - batch.t_s[0] - 9.995).abs() < 1e-12);
    // The same where somebody has said it, and in seconds with nine decimals.
    let mut options = bench.options(&["a"], &[GYR]);
    options.scales = vec!["t_s=1e-9".parse().unwrap()];
    assert_eq!(bench.import(&options).unwrap().1, batch);
    let last = batch.t_s[1999];
    let seconds = |line: &str| format!("{}.{}\n", &line[..10], &line[10..]);
    let text: String = text.lines().map(seconds).collect();
    std::fs::write(bench.path("a"), text).unwrap();
    let (summary, batch, manifest) = bench.import(&bench.options(&["a"], &[GYR])).unwrap();
    assert_eq!(manifest.sample_rate_hz, 200.0);
    assert_eq!(summary.time[0].unit, Some(Decimal::Second));
    assert!((batch.t_s[1999] - last).abs() < 1e-12);
}

#[test]
fn two_sensors_with_clocks_of_their_own_are_joined_in_regular_time() {
    let mut seed = 1_u32;
    let mut late = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed >> 8) / f64::from(1 << 24)
    };
    // The value is the true time of the sample; the stamps are up to 4 ms late, the rates 100 and 104 Hz.
    let mut file = |rate: f64| -> String {
        let row = |i: i32| {
            let t = f64::from(i) / rate;
            format!("{:.0} {t} 0 1\n", 1.7e12 + 1e3 * t + 4.0 * late())
        };
        (0..2000).map(row).collect()
    };
    let bench = Bench::new(&[("a", &file(100.0)), ("g", &file(104.0))]);
    let (summary, batch, _) = bench
        .import(&bench.options(&["a", "g"], &[ACC, GYR]))
        .unwrap();
    let rates: Vec<f64> = summary.time.iter().map(|time| time.rate_hz).collect();
    assert!(
        (rates[0] - 100.0).abs() < 2e-3 && (rates[1] - 104.0).abs() < 2e-3,
        "{rates:?}"
    );
    assert_eq!(summary.time[0].gaps + summary.time[1].gaps, 0);
    for (accel, gyro) in batch.raw[3].iter().zip(&batch.raw[0]) {
        assert!((accel - gyro).abs() < 1e-3, "{accel} {gyro}");
    }
    for (i, t) in batch.t_s.iter().enumerate() {
        let regular = batch.t_s[0] + i as f64 / rates[0];
        assert!((t - regular).abs() < 1e-6);
    }
}
