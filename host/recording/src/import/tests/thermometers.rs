//! Thermometers that are not there, or do not always answer.

use super::*;

const LIST: &str = "t_s,accel_x,accel_y,accel_z,temp_c";

fn log(temperature: impl Fn(usize) -> f64) -> String {
    let row = |i: usize| {
        let x = (7 * i % 5) as f64;
        format!("{} {x} 3 4096 {:.2}\n", 10 * i, temperature(i))
    };
    (0..300).map(row).collect()
}

#[test]
fn zeros_throughout_are_no_thermometer_whatever_the_offset() {
    let text = log(|_| 0.0);
    let bench = Bench::new(&[("a", &text)]);
    let mut options = bench.options(&["a"], &[LIST]);
    for offset in ["temp_c=0", "temp_c=36.53"] {
        options.log.offset = vec![offset.parse().unwrap()];
        let (summary, batch, _) = bench.import(&options).unwrap();
        assert!(batch.temp_c.is_empty() && batch.raw[3].len() == 300);
        warns(&summary, "0 in all of its 300 rows");
    }
    // Each file of a sequence as well.
    let bench = Bench::new(&[("a", &text), ("b", &text)]);
    let mut options = bench.options(&["a", "b"], &[LIST]);
    options.sequence = true;
    let (_, batch, _) = bench.import(&options).unwrap();
    assert!(batch.temp_c.is_empty() && batch.raw[3].len() == 600);
}

#[test]
fn zeros_far_from_all_temperatures_are_left_empty_and_those_on_the_way_are_kept() {
    let (summary, batch, _) = one(&log(|i| if i % 50 == 7 { 0.0 } else { 21.0 }), LIST).unwrap();
    assert!(batch.temp_c[7].is_nan() && batch.temp_c[8] == 21.0);
    assert_eq!(batch.temp_c.iter().filter(|c| c.is_nan()).count(), 6);
    warns(&summary, "exactly 0 in 6 rows");
    let (summary, batch, _) = one(&log(|i| 0.05 * (i as f64 - 100.0)), LIST).unwrap();
    assert_eq!(batch.temp_c[100], 0.0);
    assert!(!warned(&summary, "temp_c"), "{summary:?}");
}
