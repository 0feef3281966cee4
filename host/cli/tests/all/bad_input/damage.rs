//! Ways to damage a recording.

use std::ops::Range;

use super::generator::Samples;

/// One way to damage a recording, and words that the answer must contain.
pub type Case = (
    &'static str,
    fn() -> Samples,
    fn(&mut Samples),
    &'static [&'static str],
);

pub fn column_of_dwell(samples: &mut Samples, column: &str, dwells: &[usize]) {
    for &k in dwells {
        let rows = samples.dwells[k].clone();
        samples.stick(column, rows);
    }
}

pub fn swap(samples: &mut Samples, a: &str, b: &str) {
    let (a, b) = (samples.column(a), samples.column(b));
    samples.names.swap(a, b);
}

pub fn swap_sensors(samples: &mut Samples) {
    for axis in ["x", "y", "z"] {
        swap(samples, &format!("gyro_{axis}"), &format!("accel_{axis}"));
    }
}

pub fn scale(samples: &mut Samples, prefix: &str, factor: f64) {
    samples.edit_all(prefix, |x| x * factor);
}

/// `count` rows of `rows` after the first `skip`.
pub fn within(rows: &Range<usize>, skip: usize, count: usize) -> Range<usize> {
    rows.start + skip..rows.start + skip + count
}
