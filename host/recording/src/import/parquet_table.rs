//! Rows of a foreign Parquet file.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use parquet::data_type::ByteArray;

use super::assignment::{ColumnList, Role};
use super::broken::{Fault, Unreadable};
use super::row_filter::{RowFilter, RowFilters};
use super::row_limit::{MOST_ROWS, too_many_rows};
use super::text_table::Cells;
use super::time::Stamp;
use crate::cell::{is_reading, no_reading, shorten};
use crate::columns::Column;
use crate::csv_writer::write_number;
use crate::error::{Argument, Error, Result};
use crate::in_order::reader_panicked;
use crate::parquet_file::{Cursor, Leaf, ParquetFile};

/// Rows that are decoded at a time.
const SLICE: usize = 1 << 14;

/// A Parquet file, positioned at its next row.
pub(super) struct ParquetTable {
    path: PathBuf,
    rows: u64,
    columns: Vec<Source>,
    /// The columns of the filters; they may be among `columns` too.
    filtered: Vec<Source>,
    pub filters: RowFilters,
    /// Rows of the slice that were handed out, and rows in it.
    at: usize,
    filled: usize,
    row: u64,
    pub warnings: Vec<String>,
}

struct Source {
    /// `None` for a column that only filters rows.
    role: Option<Role>,
    name: String,
    leaf: Leaf,
    cursor: Cursor,
    values: Vec<f64>,
    texts: Vec<ByteArray>,
    /// Integer time stamps, which may have more digits than a double.
    wholes: Vec<Option<i64>>,
}

impl Source {
    fn new(file: &ParquetFile, role: Option<Role>, name: String, leaf: Leaf) -> Self {
        Self {
            role,
            name,
            leaf,
            cursor: Cursor::new(file, leaf),
            values: Vec::new(),
            texts: Vec::new(),
            wholes: Vec::new(),
        }
    }

    /// Decodes the next `count` rows in place of those before.
    fn fill(&mut self, path: &Path, count: usize) -> Result<()> {
        self.values.clear();
        self.texts.clear();
        self.wholes.clear();
        // The decoders panic on some damaged files; this becomes an error about the file.
        let decode = std::panic::AssertUnwindSafe(|| match self.leaf.is_text() {
            true => self.cursor.read_text(count, &mut self.texts),
            false if self.role == Some(Role::Column(Column::Time)) => {
                let (values, wholes) = (&mut self.values, &mut self.wholes);
                self.cursor.read_whole(count, values, wholes)
            }
            false => self.cursor.read(count, &mut self.values),
        });
        let decoded = std::panic::catch_unwind(decode)
            .map_err(|_| reader_panicked(&path.display().to_string()))?;
        decoded.map_err(|problem| {
            let place = format!("{}, column {}", path.display(), self.name);
            Error::new(place, problem, "make the file again from its source")
        })
    }

    /// The cell of row `at` of the slice, as text.
    fn text(&self, at: usize) -> Cow<'_, str> {
        match self.leaf.is_text() {
            true => String::from_utf8_lossy(self.texts[at].data()),
            false => Cow::Owned(self.values[at].to_string()),
        }
    }
}

impl std::fmt::Debug for ParquetTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ParquetTable")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

/// Names of all columns and the first rows, cell by cell. Columns of unsupported types stay empty.
pub(super) fn first_rows(path: &Path, most: usize) -> Result<(Vec<String>, Vec<Vec<String>>)> {
    let file = ParquetFile::open(path)?;
    let names = file.names();
    let count = file.rows().min(most as u64) as usize;
    let mut rows = vec![vec![String::new(); names.len()]; count];
    for (at, name) in names.iter().enumerate() {
        let Ok(leaf) = file.leaf(name) else { continue };
        let mut source = Source::new(&file, None, name.clone(), leaf);
        source.fill(path, count)?;
        for (k, row) in rows.iter_mut().enumerate() {
            row[at] = source.text(k).into_owned();
        }
    }
    Ok((names, rows))
}

impl ParquetTable {
    /// Name of the column with the time stamps.
    pub fn time_name(&self) -> Option<String> {
        let time = Some(Role::Column(Column::Time));
        let mut columns = self.columns.iter();
        columns.find(|c| c.role == time).map(|c| c.name.clone())
    }

    /// Opens the file; without `list` its columns must have the names of a recording's. Rows that do not satisfy `filters` are skipped.
    pub fn open(
        path: &Path,
        list: Option<&ColumnList>,
        filters: &[RowFilter],
    ) -> Result<ParquetTable> {
        let file = ParquetFile::open(path)?;
        if file.rows() > MOST_ROWS {
            return Err(too_many_rows(path, &file.rows().to_string()));
        }
        let names = file.names();
        let mut warnings = Vec::new();
        let wanted: Vec<(Role, String)> = match list {
            Some(ColumnList::ByName(wanted)) => wanted.clone(),
            Some(ColumnList::ByPosition(items)) => {
                if items.len() != names.len() {
                    return Err(Error::new(
                        path.display(),
                        format!(
                            "the file has {} columns, the list of columns has {}",
                            names.len(),
                            items.len()
                        ),
                        "name every column, - for one to skip, or choose by name: gyro_x=wx",
                    )
                    .about(Argument::Columns));
                }
                let both = items.iter().zip(&names);
                both.filter_map(|(role, name)| Some(((*role)?, name.clone())))
                    .collect()
            }
            None => {
                let (known, unknown): (Vec<Role>, Vec<&String>) = (
                    Role::all()
                        .filter(|role| names.iter().any(|n| n == role.name()))
                        .collect(),
                    names
                        .iter()
                        .filter(|n| Role::all().all(|role| role.name() != *n))
                        .collect(),
                );
                for name in unknown {
                    warnings.push(format!("{}: column {name} is ignored", path.display()));
                }
                known
                    .into_iter()
                    .map(|role| (role, role.name().to_owned()))
                    .collect()
            }
        };
        let mut columns = Vec::new();
        for (role, name) in wanted {
            let leaf = file.leaf(&name)?;
            if leaf.is_text() && role != Role::Column(Column::Step) {
                return Err(Error::new(
                    format!("{}, column {name}", path.display()),
                    format!("it contains text, but {} is a number", role.name()),
                    "write it as DOUBLE, FLOAT, INT32 or INT64",
                ));
            }
            columns.push(Source::new(&file, Some(role), name, leaf));
        }
        if columns.is_empty() {
            return Err(Error::new(
                path.display(),
                "no column has the name of a recording's column",
                "name the columns, like gyro_x=wx,gyro_y=wy,gyro_z=wz",
            )
            .about(Argument::Columns));
        }
        let filtered = filters.iter().map(|filter| {
            let at = filter.position(&names).or(filter.number());
            let name = at.and_then(|at| names.get(at)).ok_or_else(|| {
                let name = shorten(filter.column().as_bytes());
                let problem = format!("the file has no column {name}");
                let remedy = format!("choose one of {}", names.join(", "));
                Error::new(path.display(), problem, remedy).about(Argument::Where)
            })?;
            let leaf = file.leaf(name)?;
            Ok(Source::new(&file, None, name.clone(), leaf))
        });
        let filtered = filtered.collect::<Result<_>>()?;
        Ok(ParquetTable {
            path: path.to_owned(),
            rows: file.rows(),
            columns,
            filtered,
            filters: RowFilters::new(filters),
            at: 0,
            filled: 0,
            row: 0,
            warnings,
        })
    }

    /// Roles in the order of [`Cells::numbers`].
    pub fn roles(&self) -> Vec<Role> {
        self.columns
            .iter()
            .filter_map(|column| column.role)
            .collect()
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        self.row as f64 / self.rows.max(1) as f64
    }

    /// Reads the next row into `cells` and returns its number from 1, or `None` at the end.
    pub fn next(&mut self, cells: &mut Cells) -> std::result::Result<Option<u64>, Unreadable> {
        let at = loop {
            if self.row == self.rows {
                return Ok(None);
            }
            if self.at == self.filled {
                self.fill()?;
            }
            let at = self.at;
            self.at += 1;
            self.row += 1;
            let chosen = self.filtered.iter().map(|column| column.text(at));
            if self.filtered.is_empty() || self.filters.keep_cells(chosen) {
                break at;
            }
        };
        cells.numbers.clear();
        cells.step.clear();
        for column in &self.columns {
            let step = column.role == Some(Role::Column(Column::Step));
            if column.leaf.is_text() {
                cells.step.extend_from_slice(column.texts[at].data());
                cells.numbers.push(f64::NAN);
                continue;
            }
            let value = column.values[at];
            if !is_reading(value) {
                let (path, row) = (self.path.display(), self.row);
                let place = format!("{path}, row {row}, column {}", column.name);
                let refusal = no_reading(value, &format!("{value:e}"));
                return Err(Unreadable::row(row, Fault::Reading, place, refusal));
            }
            if column.role == Some(Role::Column(Column::Time)) {
                let whole = column.wholes.get(at).copied().flatten();
                cells.stamp = whole.map_or_else(|| Stamp::from(value), Stamp::from);
            }
            if step {
                write_number(value, &mut cells.step);
            }
            cells.numbers.push(value);
        }
        Ok(Some(self.row))
    }

    fn fill(&mut self) -> Result<()> {
        let count = (self.rows - self.row).min(SLICE as u64) as usize;
        for column in self.columns.iter_mut().chain(&mut self.filtered) {
            column.fill(&self.path, count)?;
        }
        self.at = 0;
        self.filled = count;
        Ok(())
    }
}
