//! Foreign Parquet files in a build without the feature `parquet`: they are refused.

use std::convert::Infallible;
use std::path::Path;

use super::assignment::{ColumnList, Role};
use super::broken::Unreadable;
use super::row_filter::{RowFilter, RowFilters};
use super::text_table::Cells;
use crate::error::Result;
use crate::without_parquet::refused;

/// Never constructed.
#[derive(Debug)]
pub(super) struct ParquetTable {
    pub filters: RowFilters,
    pub warnings: Vec<String>,
    never: Infallible,
}

impl ParquetTable {
    pub fn open(path: &Path, _: Option<&ColumnList>, _: &[RowFilter]) -> Result<ParquetTable> {
        Err(refused(path))
    }

    pub fn roles(&self) -> Vec<Role> {
        match self.never {}
    }

    pub fn time_name(&self) -> Option<String> {
        match self.never {}
    }

    pub fn progress(&self) -> f64 {
        match self.never {}
    }

    pub fn next(&mut self, _: &mut Cells) -> std::result::Result<Option<u64>, Unreadable> {
        match self.never {}
    }
}

pub(super) fn first_rows(path: &Path, _: usize) -> Result<(Vec<String>, Vec<Vec<String>>)> {
    Err(refused(path))
}
