//! One row of a foreign file.

use super::time::Stamp;

/// One row in the recording's units.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Row {
    /// Line of a text file, number of the row in a Parquet file; from 1.
    pub number: u64,
    /// 0 during the first pass, before the times behind the stamps are known.
    pub t_s: f64,
    /// As in the file; NaN if it has none.
    pub stamp: Stamp,
    /// -1 if the file has no steps.
    pub step: i32,
    /// In the order of the columns of its file.
    pub values: Vec<f64>,
    /// How many of the values, the last ones, are of further triads.
    pub further: usize,
}

impl Row {
    /// Whether its step and values equal those of `other`. Those of further triads do not count: a slower magnetometer may change while a logger writes
    /// a sample of the others again.
    pub fn repeats(&self, other: &Row) -> bool {
        // Two empty cells (NaN) count as equal.
        let alike = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
        let own = self.values.len() - self.further;
        // A file of further triads alone has nothing else to compare.
        let compared = if own == 0 { self.values.len() } else { own };
        let mut pairs = self.values.iter().zip(&other.values).take(compared);
        self.step == other.step && pairs.all(alike)
    }
}
