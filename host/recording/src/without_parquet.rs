//! Parquet in a build without the feature `parquet`: all files are refused.

use std::convert::Infallible;
use std::path::Path;

use super::batch::Batch;
use super::columns::{Column, Columns, Layout};
use crate::error::{Error, Result};

/// Rows that would be decoded at a time.
pub(super) const SLICE: usize = 1 << 17;

/// The refusal of `path`.
pub(crate) fn refused(path: &Path) -> Error {
    let problem = "this program was built without Parquet";
    let remedy = "build it with the feature `parquet`, or use CSV";
    Error::new(path.display(), problem, remedy)
}

/// Never constructed.
#[derive(Debug, Clone)]
pub(super) struct ParquetFile(Infallible);

impl ParquetFile {
    pub fn open(path: &Path) -> Result<ParquetFile> {
        Err(refused(path))
    }

    pub fn rows(&self) -> u64 {
        match self.0 {}
    }

    pub fn names(&self) -> Vec<String> {
        match self.0 {}
    }

    pub fn leaf(&self, _: &str) -> Result<Leaf> {
        match self.0 {}
    }

    pub fn for_each_batch(
        &self,
        _: &Layout,
        _: usize,
        _: impl Fn(f64),
        _: impl FnMut(&Batch) -> Result<()>,
    ) -> Result<u64> {
        match self.0 {}
    }

    pub fn column(&self, _: &Layout, _: Column) -> Result<Vec<f64>> {
        match self.0 {}
    }
}

/// Never constructed.
pub(super) struct Leaf(Infallible);

impl Leaf {
    pub fn is_text(&self) -> bool {
        match self.0 {}
    }
}

/// Never constructed.
#[derive(Debug)]
pub(super) struct ParquetWriter(Infallible);

impl ParquetWriter {
    pub fn create(path: &Path, _: Columns) -> Result<ParquetWriter> {
        Err(refused(path))
    }

    pub fn write(&mut self, _: &Batch) -> Result<()> {
        match self.0 {}
    }

    pub fn finish(self) -> Result<()> {
        match self.0 {}
    }
}
