//! The stamps of all rows of a file.

use super::stamp::Stamp;

/// Stamps of a file, relative to the first, in its unit.
#[derive(Default)]
pub(in super::super) struct Stamps {
    pub first: Stamp,
    pub since_first: Vec<f64>,
    /// Places in `since_first` of rows that repeat the one before.
    pub repeats: Vec<usize>,
    /// Rows with the stamp of the row before, but other values.
    pub shared: u64,
    /// How often they wrapped to 0.
    pub wraps: u64,
}
