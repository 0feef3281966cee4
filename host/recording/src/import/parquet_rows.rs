//! Rows of a foreign Parquet file, as cells of text. They are then read like those of any other table, and numbers written as text read back exactly.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::record::reader::RowIter;

use super::row_limit::{MOST_ROWS, too_many_rows};
use crate::ahead::reader_panicked;
use crate::csv_writer::write_number;
use crate::error::{Error, Result};
use crate::parquet_file::ParquetFile;
use crate::strict_file::StrictFile;

/// A Parquet file, positioned at its next row.
pub(super) struct ParquetRows {
    path: PathBuf,
    file: ParquetFile,
    rows: Option<RowIter<'static>>,
    /// Position of each column that is read.
    columns: Vec<usize>,
    row: u64,
}

impl std::fmt::Debug for ParquetRows {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ParquetRows")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

/// Names of all columns and the first rows, cell by cell. Columns of unsupported types stay empty.
pub(super) fn first_rows(path: &Path, most: usize) -> Result<(Vec<String>, Vec<Vec<String>>)> {
    let mut rows = ParquetRows::open(path)?;
    let names = rows.names();
    let known = |at: &usize| rows.file.leaf(&names[*at]).is_ok();
    let known: Vec<usize> = (0..names.len()).filter(known).collect();
    rows.read_columns(known.into_iter())?;
    let (mut first, mut record) = (Vec::new(), csv::ByteRecord::new());
    while first.len() < most && rows.next(&mut record)?.is_some() {
        let text = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
        first.push(record.iter().map(text).collect());
    }
    Ok((names, first))
}

impl ParquetRows {
    /// Opens the file; no column is read yet.
    pub fn open(path: &Path) -> Result<Self> {
        let file = ParquetFile::open(path)?;
        if file.rows() > MOST_ROWS {
            return Err(too_many_rows(path, &file.rows().to_string()));
        }
        Ok(Self {
            path: path.to_owned(),
            rows: None,
            columns: Vec::new(),
            file,
            row: 0,
        })
    }

    /// Names of all columns.
    pub fn names(&self) -> Vec<String> {
        self.file.names()
    }

    /// Reads the columns at these positions; the cells of the others are empty.
    pub fn read_columns(&mut self, positions: impl Iterator<Item = usize>) -> Result<()> {
        let names = self.names();
        self.columns = positions.collect();
        self.columns.sort_unstable();
        self.columns.dedup();
        for at in &self.columns {
            self.file.leaf(&names[*at])?;
        }
        let schema = self.file.schema_of(&self.columns);
        let rows = StrictFile::open(&self.path)
            .map_err(|error| Error::io(&self.path, &error))
            .and_then(|file| SerializedFileReader::new(file).map_err(|e| self.damaged(&e)))
            .and_then(|reader| {
                let reader: Box<dyn FileReader> = Box::new(reader);
                let rows = RowIter::from_file_into(reader).project(Some(schema));
                rows.map_err(|e| self.damaged(&e))
            });
        self.rows = Some(rows?);
        Ok(())
    }

    fn damaged(&self, error: &dyn std::fmt::Display) -> Error {
        let problem = format!("the file cannot be decoded: {error}");
        Error::new(
            self.path.display(),
            problem,
            "make the file again from its source",
        )
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        self.row as f64 / self.file.rows() as f64
    }

    /// Puts the cells of the next row into `record` and returns its number from 1, or `None` at the end.
    pub fn next(&mut self, record: &mut csv::ByteRecord) -> Result<Option<u64>> {
        let Some(rows) = self.rows.as_mut().filter(|_| self.row < self.file.rows()) else {
            return Ok(None);
        };
        // The decoders panic on some damaged files; this becomes an error about the file.
        let row = catch_unwind(AssertUnwindSafe(|| rows.next()))
            .map_err(|_| reader_panicked(&self.path.display().to_string()))?;
        let row = row
            .ok_or_else(|| self.damaged(&"it has fewer rows than its footer promises"))?
            .map_err(|error| self.damaged(&error))?;
        record.clear();
        let mut cells = row.get_column_iter().map(|(_, field)| text_of(field));
        for at in 0..self.file.width() {
            let cell = match self.columns.binary_search(&at) {
                Ok(_) => cells.next().unwrap_or_default(),
                Err(_) => Vec::new(),
            };
            record.push_field(&cell);
        }
        self.row += 1;
        Ok(Some(self.row))
    }
}

fn text_of(field: &Field) -> Vec<u8> {
    let mut text = Vec::new();
    match field {
        Field::Null => {}
        Field::Float(value) => write_number(f64::from(*value), &mut text),
        Field::Double(value) => write_number(*value, &mut text),
        Field::Str(value) => text.extend_from_slice(value.as_bytes()),
        Field::Bytes(value) => text.extend_from_slice(value.data()),
        other => text.extend_from_slice(other.to_string().as_bytes()),
    }
    text
}
