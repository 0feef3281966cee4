//! Implausible readings.

use super::*;

/// Readings of a sensor at rest, with noise of up to two counts.
fn at_rest(i: usize) -> [i32; 6] {
    let noise = |k: usize| (7 * i + 13 * k * i) as i32 % 5 - 2;
    [
        noise(1),
        2 + noise(2),
        noise(3),
        30 + noise(4),
        noise(5),
        4096 + noise(6),
    ]
}

#[test]
fn rows_of_zeros_are_padding_and_left_out_counted_wherever_they_are() {
    let padded = |i: usize| (0..7).contains(&i) || (90..92).contains(&i) || i >= 180;
    let text = log(200, |i| if padded(i) { [0; 6] } else { at_rest(i) });
    let (summary, batch, _) = one(&text, BOTH).unwrap();
    assert_eq!((summary.padding, summary.rows), (29, 171));
    warns(
        &summary,
        "all readings are 0, in 29 rows: left out as padding",
    );
    assert!((batch.t_s[0] - 0.07).abs() < 1e-9 && (batch.t_s[170] - 1.79).abs() < 1e-9);
    // The two in the middle are a gap.
    assert_eq!((summary.time[0].gaps, summary.time[0].missing), (1, 2));
    // A buffer that was never filled has no times either.
    let text = text + &"0 0 0 0 0 0 0\n".repeat(50);
    assert_eq!(one(&text, BOTH).unwrap().0.padding, 79);
    let error = one_refused(&log(50, |_| [0; 6]), BOTH);
    assert!(error.contains("all readings are 0, in 50 rows"), "{error}");
}

#[test]
fn rows_of_a_bus_that_did_not_answer_are_left_out_counted() {
    let text = log(200, |i| match i {
        20 | 50 => [-1; 6],
        90..93 => [32767; 6],
        _ => at_rest(i),
    });
    let (summary, batch, _) = one(&text, BOTH).unwrap();
    assert_eq!((summary.padding, summary.rows), (0, 195));
    warns(
        &summary,
        "all six readings are the same number, in 5 rows: the sensor's bus did not answer: left out",
    );
    assert!(batch.raw.iter().flatten().all(|v| *v != 32767.0));
    let error = one_refused(&log(50, |_| [-1; 6]), BOTH);
    assert!(error.contains("in 50 rows"), "{error}");
}

#[test]
fn a_sensor_that_was_not_connected_is_left_out_and_a_dead_axis_is_named() {
    let text = log(100, |i| {
        let [.., x, y, z] = at_rest(i);
        [0, 0, 0, x, y, z]
    });
    let (summary, batch, _) = one(&text, BOTH).unwrap();
    assert!(batch.raw[0].is_empty() && batch.raw[5].len() == 100);
    warns(&summary, "gyro: it is exactly 0 on all axes");
    let text = log(100, |i| {
        let [a, b, c, ..] = at_rest(i);
        [a, b, c, 0, 0, 0]
    });
    let (summary, batch, _) = one(&text, BOTH).unwrap();
    assert!(batch.raw[3].is_empty() && batch.raw[1].len() == 100);
    warns(&summary, "accel: it is exactly 0 on all axes");
    let text = log(100, |i| {
        let [a, b, _, x, y, z] = at_rest(i);
        [a, b, 0, x, y, z]
    });
    let (summary, batch, _) = one(&text, BOTH).unwrap();
    assert_eq!(batch.raw[2].len(), 100);
    warns(&summary, "gyro_z: the channel is stuck at 0 throughout");
    // A gyro at rest may read 0 now and then; an accelerometer does not.
    let text = log(100, |i| {
        let [a, b, c, x, y, z] = at_rest(i);
        match i {
            10..40 => [0, 0, 0, x, y, z],
            60..65 => [a, b, c, 0, 0, 0],
            _ => [a, b, c, x, y, z],
        }
    });
    let (summary, batch, _) = one(&text, BOTH).unwrap();
    assert_eq!((summary.padding, summary.empty_cells), (0, 15));
    assert_eq!(batch.raw[0][20], 0.0);
    assert!(batch.raw[4][62].is_nan());
}

#[test]
fn counts_taken_for_degrees_are_refused_unless_a_factor_and_an_offset_make_them_degrees() {
    let row = |i: usize| format!("{} 1 {} 3 {}\n", 10 * i, i % 3, -7049 + (i as i32 % 5));
    let text: String = (0..100).map(row).collect();
    let list = "t_s,gyro_x,gyro_y,gyro_z,temp_c";
    let error = one_refused(&text, list);
    says(
        &error,
        &[
            "column temp_c",
            "100 of 100",
            "-7049 in row 1",
            "or skip the column",
        ],
    );
    let bench = Bench::new(&[("a", &text)]);
    let mut options = bench.options(&["a"], &[list]);
    options.log.scale = vec!["temp_c=0.00294118".parse().unwrap()];
    options.log.offset = vec!["temp_c=36.53".parse().unwrap()];
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    // -7049 / 340 + 36.53, by the data sheet.
    assert!(
        (batch.temp_c[0] - 15.798).abs() < 1e-3,
        "{}",
        batch.temp_c[0]
    );
    assert!(!summary.warnings.iter().any(|w| w.contains("temp_c")));
    assert!(
        manifest
            .imported_with
            .windows(2)
            .any(|w| w == ["--offset", "temp_c=36.53"])
    );
    for text in ["temp_c", "temp_c=x", "t_s=1", "step=1", "gyro=1"] {
        assert!(text.parse::<Offset>().is_err(), "{text}");
    }
}

#[test]
fn a_few_impossible_temperatures_are_left_empty_and_kelvins_are_warned_of() {
    let log = |temperature: &dyn Fn(usize) -> f64| -> String {
        let row = |i: usize| format!("{} 1 {} 3 {}\n", 10 * i, i % 3, temperature(i));
        (0..100).map(row).collect()
    };
    let list = "t_s,gyro_x,gyro_y,gyro_z,temp_c";
    let text = log(&|i| if i % 40 == 7 { -7049.0 } else { 21.0 });
    let (summary, batch, _) = one(&text, list).unwrap();
    assert_eq!(batch.temp_c.iter().filter(|c| c.is_nan()).count(), 3);
    warns(&summary, "3 of 100 values cannot be temperatures");
    let (summary, _, _) = one(&log(&|_| 294.0), list).unwrap();
    warns(&summary, "offset of -273.15");
    let (summary, _, _) = one(&log(&|i| -40.0 + i as f64), list).unwrap();
    assert!(!warned(&summary, "temp_c"), "{summary:?}");
}
