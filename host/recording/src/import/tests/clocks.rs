//! Times of day and dates.

use super::*;

const ACCEL: &str = "t_s,accel_x,accel_y,accel_z";

/// Rows at 100 Hz from `from_s` after midnight on, each behind `before` the time and `after` it.
fn rows(from_s: f64, before: &str, after: &str) -> String {
    let row = |i: usize| {
        let ms = (1e3 * from_s) as u64 + 10 * i as u64;
        let (s, ms) = (ms / 1000 % 86_400, ms % 1000);
        let [h, m, s] = [s / 3600, s / 60 % 60, s % 60];
        format!(
            "{before}{h:02}:{m:02}:{s:02}.{ms:03}{after}{},3,4096\n",
            7 * i % 5
        )
    };
    (0..600).map(row).collect()
}

#[test]
fn times_of_day_go_on_across_midnight_and_dates_count_from_1970() {
    for (text, first) in [
        (rows(86_397.0, "", ","), 86_397.0),
        (rows(54_263.0, "2024-03-05T", "Z,"), 0.0),
        // What the serial monitor of a development board puts before each line.
        (rows(54_263.0, "", " -> "), 54_263.0),
    ] {
        let bench = Bench::new(&[("a.csv", &text)]);
        let (summary, batch, _) = bench.import(&bench.options(&["a.csv"], &[ACCEL])).unwrap();
        assert_eq!(summary.time[0].unit, Some(Decimal::Second));
        assert_eq!((summary.sample_rate_hz, summary.rows), (100.0, 600));
        assert!((batch.t_s[0] - first).abs() < 1e-9, "{}", batch.t_s[0]);
        assert!((batch.t_s[599] - first - 5.99).abs() < 1e-9);
        assert_eq!(batch.raw[3][..4], [0.0, 2.0, 4.0, 1.0]);
    }
}

#[test]
fn times_that_fall_and_intervals_in_place_of_times_are_named() {
    let row = |t: f64| format!("{t:.4},1,3,4096\n");
    let bench = Bench::new(&[
        (
            "falls.csv",
            &(0..300)
                .rev()
                .map(|i| row(0.01 * f64::from(i)))
                .collect::<String>(),
        ),
        (
            "intervals.csv",
            &(0..300)
                .map(|i| row(0.01 + 1e-4 * f64::from(7 * i % 5 - 2)))
                .collect::<String>(),
        ),
    ]);
    let refused = |file: &str| bench.refused(&bench.options(&[file], &[ACCEL]));
    let falls = refused("falls.csv");
    says(&falls, &["last row comes first", "sort"]);
    let intervals = refused("intervals.csv");
    says(&intervals, &["intervals from row to row"]);
}
