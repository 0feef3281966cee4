//! Rows of a foreign Parquet file, as cells of text. They are then read like those of any other table, and numbers written as text read back exactly.

use std::path::{Path, PathBuf};

use super::row_limit::{MOST_ROWS, too_many_rows};
use crate::ahead::reader_panicked;
use crate::error::{Error, Result};
use crate::parquet_file::{Cursor, ParquetFile};

/// Rows that are decoded at a time.
const SLICE: usize = 1 << 14;

/// A Parquet file, positioned at its next row.
pub(super) struct ParquetRows {
    path: PathBuf,
    file: ParquetFile,
    /// The columns that are read, by their position.
    columns: Vec<Option<Column>>,
    /// Rows of the slice that were handed out, and rows in it.
    at: usize,
    filled: usize,
    row: u64,
}

struct Column {
    name: String,
    cursor: Cursor,
    cells: Vec<Vec<u8>>,
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
    for (at, name) in names.iter().enumerate() {
        rows.columns[at] = rows.column(name).ok();
    }
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
            columns: file.names().iter().map(|_| None).collect(),
            file,
            at: 0,
            filled: 0,
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
        for at in positions {
            self.columns[at] = Some(self.column(&names[at])?);
        }
        Ok(())
    }

    fn column(&self, name: &str) -> Result<Column> {
        Ok(Column {
            name: name.to_owned(),
            cursor: Cursor::new(&self.file, self.file.leaf(name)?),
            cells: Vec::new(),
        })
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        self.row as f64 / self.file.rows() as f64
    }

    /// Puts the cells of the next row into `record` and returns its number from 1, or `None` at the end.
    pub fn next(&mut self, record: &mut csv::ByteRecord) -> Result<Option<u64>> {
        if self.row == self.file.rows() {
            return Ok(None);
        }
        if self.at == self.filled {
            self.filled = (self.file.rows() - self.row).min(SLICE as u64) as usize;
            self.at = 0;
            for column in self.columns.iter_mut().flatten() {
                column.fill(&self.path, self.filled)?;
            }
        }
        record.clear();
        for column in &self.columns {
            record.push_field(column.as_ref().map_or(b"", |c| &c.cells[self.at]));
        }
        self.at += 1;
        self.row += 1;
        Ok(Some(self.row))
    }
}

impl Column {
    /// Decodes the next `count` rows in place of those before.
    fn fill(&mut self, path: &Path, count: usize) -> Result<()> {
        self.cells.clear();
        // The decoders panic on some damaged files; this becomes an error about the file.
        let decode =
            std::panic::AssertUnwindSafe(|| self.cursor.read_cells(count, &mut self.cells));
        let decoded = std::panic::catch_unwind(decode)
            .map_err(|_| reader_panicked(&path.display().to_string()))?;
        decoded.map_err(|problem| {
            let place = format!("{}, column {}", path.display(), self.name);
            Error::new(place, problem, "make the file again from its source")
        })
    }
}
