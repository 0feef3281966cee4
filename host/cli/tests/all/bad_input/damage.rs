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
        stick(samples, column, rows);
    }
}

/// The channel keeps its first value.
pub fn stick(samples: &mut Samples, column: &str, rows: Range<usize>) {
    let value = samples.rows[rows.start][samples.column(column)];
    samples.edit(column, rows, |_| value);
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
    for name in samples.names.clone() {
        if name.starts_with(prefix) {
            let all = samples.all();
            samples.edit(&name, all, |x| x * factor);
        }
    }
}

pub fn keep_every(samples: &mut Samples, nth: usize, from: usize) {
    let mut row = 0;
    samples.rows.retain(|_| {
        row += 1;
        row <= from || row % nth == 0
    });
}
