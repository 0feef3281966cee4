//! Foreign Parquet files in a build without the feature `parquet`: they are refused.

use std::convert::Infallible;
use std::path::Path;

use crate::error::Result;
use crate::without_parquet::refused;

/// Never constructed.
#[derive(Debug)]
pub(super) struct ParquetRows(Infallible);

impl ParquetRows {
    pub fn open(path: &Path) -> Result<Self> {
        Err(refused(path))
    }

    pub fn names(&self) -> Vec<String> {
        match self.0 {}
    }

    pub fn read_columns(&mut self, _: impl Iterator<Item = usize>) -> Result<()> {
        match self.0 {}
    }

    pub fn progress(&self) -> f64 {
        match self.0 {}
    }

    pub fn next(&mut self, _: &mut csv::ByteRecord) -> Result<Option<u64>> {
        match self.0 {}
    }
}

pub(super) fn first_rows(path: &Path, _: usize) -> Result<(Vec<String>, Vec<Vec<String>>)> {
    Err(refused(path))
}
