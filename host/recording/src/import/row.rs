//! One row of a foreign file.

use super::time::Stamp;

/// One row in the recording's units.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Row {
    /// Line of a text file, number of the row in a Parquet file; from 1.
    pub number: u64,
    /// 0 where the rows are still to be looked through for the time that their stamps stand for.
    pub t_s: f64,
    /// As in the file; not a number where it has none.
    pub stamp: Stamp,
    /// -1 where the file has no steps.
    pub step: i32,
    /// In the order of the columns of its file.
    pub values: Vec<f64>,
}

impl Row {
    /// Whether it says the same as `other` but for its number.
    pub fn repeats(&self, other: &Row) -> bool {
        // Empty cells are alike, though not equal.
        let alike = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
        self.step == other.step && self.values.iter().zip(&other.values).all(alike)
    }
}
