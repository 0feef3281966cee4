//! Writing a recording: whole or not at all.

use std::path::{Path, PathBuf};

use super::batch::Batch;
use super::cell::is_reading;
use super::columns::{Column, Columns};
use super::csv_writer::CsvWriter;
use super::manifest::{MANIFEST_FILE, Manifest};
#[cfg(feature = "parquet")]
use super::parquet_writer::ParquetWriter;
use super::staging::Staging;
use crate::error::{Error, Result};

/// File format of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SampleFormat {
    /// `samples.parquet`: a third of the size of CSV, and read several times as fast.
    #[cfg_attr(feature = "parquet", default)]
    Parquet,
    /// `samples.csv`: for people and for small recordings.
    #[cfg_attr(not(feature = "parquet"), default)]
    Csv,
}

impl SampleFormat {
    /// Name of the samples file.
    pub fn file_name(self) -> &'static str {
        match self {
            SampleFormat::Parquet => "samples.parquet",
            SampleFormat::Csv => "samples.csv",
        }
    }
}

impl std::str::FromStr for SampleFormat {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "csv" => Ok(SampleFormat::Csv),
            "parquet" => Ok(SampleFormat::Parquet),
            _ => Err(Error::new(
                "format of the samples",
                format!("{} is unknown", super::cell::shorten(text.as_bytes())),
                "write csv or parquet",
            )),
        }
    }
}

/// Writes a recording into a directory beside its target, which is renamed to the target at the end. If dropped before [`Writer::finish`], it leaves
/// nothing behind.
#[derive(Debug)]
pub struct Writer {
    staging: Staging,
    samples: Samples,
    columns: Columns,
    rows: u64,
}

#[derive(Debug)]
enum Samples {
    Csv(CsvWriter),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetWriter>),
}

impl Writer {
    /// Starts a recording at `target` with the given columns. An existing recording is refused, or with `replace` replaced at the end. Anything else
    /// at `target` is always refused.
    pub fn create(
        target: &Path,
        columns: Columns,
        format: SampleFormat,
        replace: bool,
    ) -> Result<Writer> {
        if !columns.gyro && !columns.accel {
            return Err(Error::new(
                target.display(),
                "the recording would have no sensor",
                "give the three columns of at least one sensor",
            ));
        }
        let staging = Staging::create(target, replace)?;
        let path = staging.path().join(format.file_name());
        let samples = match format {
            SampleFormat::Csv => Samples::Csv(CsvWriter::create(&path, columns)?),
            #[cfg(not(feature = "parquet"))]
            SampleFormat::Parquet => return Err(without_parquet(&path)),
            #[cfg(feature = "parquet")]
            SampleFormat::Parquet => {
                Samples::Parquet(Box::new(ParquetWriter::create(&path, columns)?))
            }
        };
        Ok(Writer {
            staging,
            samples,
            columns,
            rows: 0,
        })
    }

    /// Appends rows. `batch.first_row` is ignored: rows are numbered as they come.
    pub fn write(&mut self, batch: &Batch) -> Result<()> {
        let at = |row: usize| {
            let row = self.rows + row as u64 + 1;
            format!("{}, row {row}", self.staging.target().display())
        };
        if let Some(column) = batch.ragged(&self.columns) {
            return Err(Error::new(
                format!("{}, column {}", at(0), column.name()),
                "the rows to be written do not have the announced columns",
                "report this error: it is a mistake in the program",
            ));
        }
        // What the reader refuses is not written either.
        for column in self.columns.present() {
            let values = batch.values(column).unwrap_or_default();
            let bad = |v: &f64| !is_reading(*v) || (column == Column::Time && v.is_nan());
            if let Some(row) = values.iter().position(bad) {
                return Err(Error::new(
                    format!("{}, column {}", at(row), column.name()),
                    format!("{:e} is not a reading", values[row]),
                    "leave the cell empty if nothing was measured; every row needs its time",
                ));
            }
        }
        if let Some(row) = batch.step.iter().position(|&step| step < -1) {
            return Err(Error::new(
                format!("{}, column step", at(row)),
                format!("{} is not the number of a dwell", batch.step[row]),
                "number the dwells 0, 1, 2 …; -1 is in transit",
            ));
        }
        match &mut self.samples {
            Samples::Csv(writer) => writer.write(batch)?,
            #[cfg(feature = "parquet")]
            Samples::Parquet(writer) => writer.write(batch)?,
        }
        self.rows += batch.len() as u64;
        Ok(())
    }

    /// Rows written so far.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Writes the manifest, makes everything durable and gives the directory its name. Returns the
    /// path of the recording.
    pub fn finish(self, manifest: &Manifest) -> Result<PathBuf> {
        let target = self.staging.target().to_owned();
        manifest.check(&target.join(MANIFEST_FILE).display().to_string())?;
        if self.rows == 0 {
            return Err(Error::new(
                target.display(),
                "there are no rows to be written",
                "a recording needs at least one row",
            ));
        }
        match self.samples {
            Samples::Csv(writer) => writer.finish()?,
            #[cfg(feature = "parquet")]
            Samples::Parquet(writer) => writer.finish()?,
        }
        self.staging
            .write_file(MANIFEST_FILE, manifest.to_toml()?.as_bytes())?;
        self.staging.publish()?;
        Ok(target)
    }
}

/// The refusal of a Parquet file in a build without the feature.
#[cfg(not(feature = "parquet"))]
pub(crate) fn without_parquet(path: &Path) -> Error {
    let problem = "this program was built without Parquet";
    let remedy = "build it with the feature `parquet`, or use CSV";
    Error::new(path.display(), problem, remedy)
}
