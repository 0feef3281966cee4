//! `samples.parquet`, decoded slice by slice while the slice before is used.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
use parquet::file::serialized_reader::SerializedPageReader;
use parquet::schema::types::Type;

use super::ahead::{ahead, reader_panicked};
use super::batch::{Batch, SLICE};
use super::cell::{self, Refusal, shorten};
use super::columns::{Column, Layout};
use super::strict_file::StrictFile;
use crate::error::{Error, Result};

#[cfg(test)]
mod tests;

/// Most numbers for which a column's vector is reserved in advance: half a GiB, which is used page by page as it fills.
const MOST_RESERVED: u64 = 1 << 26;

/// A Parquet file whose footer has been read.
#[derive(Debug, Clone)]
pub(super) struct ParquetFile {
    path: PathBuf,
    metadata: Arc<ParquetMetaData>,
    rows: u64,
}

/// A flat column, and how its stored values become numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    index: usize,
    unsigned: bool,
    text: bool,
}

impl Leaf {
    /// Whether it contains text instead of numbers.
    pub fn is_text(&self) -> bool {
        self.text
    }
}

impl ParquetFile {
    /// Reads the footer.
    pub fn open(path: &Path) -> Result<ParquetFile> {
        let place = path.display().to_string();
        let file = StrictFile::open(path).map_err(|error| Error::io(path, &error))?;
        // The decoder of the footer panics on some damaged files.
        let metadata = catch_unwind(AssertUnwindSafe(|| {
            ParquetMetaDataReader::new().parse_and_finish(&file)
        }))
        .map_err(|_| reader_panicked(&place))?
        .map_err(|error| damaged(&place, &error))?;
        let mut rows = 0_u64;
        for group in metadata.row_groups() {
            rows = u64::try_from(group.num_rows())
                .ok()
                .and_then(|count| rows.checked_add(count))
                .filter(|&rows| rows < 1 << 48)
                .ok_or_else(|| damaged(&place, &"its footer has an impossible number of rows"))?;
        }
        if rows == 0 {
            return Err(Error::new(
                place,
                "the file has no row of data",
                "record it again",
            ));
        }
        Ok(ParquetFile {
            path: path.to_owned(),
            metadata: Arc::new(metadata),
            rows,
        })
    }

    /// Number of rows.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Names of the columns of the table.
    pub fn names(&self) -> Vec<String> {
        let root = self.metadata.file_metadata().schema_descr().root_schema();
        let fields = root.get_fields().iter();
        fields.map(|field| field.name().to_owned()).collect()
    }

    /// Number of its columns.
    pub fn width(&self) -> usize {
        let schema = self.metadata.file_metadata().schema_descr();
        schema.root_schema().get_fields().len()
    }

    /// The schema of the columns at these positions alone.
    pub fn schema_of(&self, columns: &[usize]) -> Type {
        let root = self.metadata.file_metadata().schema_descr().root_schema();
        let mut fields = root.get_fields().to_vec();
        let mut at = 0;
        fields.retain(|_| {
            at += 1;
            columns.contains(&(at - 1))
        });
        let group = Type::group_type_builder(root.name()).with_fields(fields);
        // A part of a schema that was read is one too.
        group.build().unwrap_or_else(|_| root.clone())
    }

    /// The column called `name`, checked to be flat and of a type that becomes a number, or text.
    pub fn leaf(&self, name: &str) -> Result<Leaf> {
        let schema = self.metadata.file_metadata().schema_descr();
        let place = format!("{}, column {name}", self.path.display());
        let of_name = |index: &usize| {
            schema
                .column(*index)
                .path()
                .parts()
                .first()
                .is_some_and(|part| part == name)
        };
        let index = (0..schema.num_columns()).find(of_name);
        let index = index.ok_or_else(|| missing(&place))?;
        let column = schema.column(index);
        let info = column.self_type().get_basic_info();
        let repeated = info.has_repetition() && info.repetition() == Repetition::REPEATED;
        if column.path().parts().len() != 1 || repeated {
            let problem = "the column is nested or repeated";
            let remedy = "write it as one number in each row";
            return Err(Error::new(&place, problem, remedy));
        }
        let logical = column.logical_type_ref();
        let converted = column.converted_type().to_string();
        let plain = match logical {
            None => column.converted_type() == ConvertedType::NONE,
            Some(kind) => matches!(kind, LogicalType::Integer { .. } | LogicalType::Unknown),
        };
        let unsigned = converted.starts_with("UINT_");
        let integer = unsigned || converted.starts_with("INT_");
        let text = column.physical_type() == Physical::BYTE_ARRAY;
        let number = match column.physical_type() {
            Physical::DOUBLE | Physical::FLOAT => true,
            Physical::INT32 | Physical::INT64 => plain || integer,
            _ => false,
        };
        if !number && !text {
            let kind = logical.map_or_else(
                || column.physical_type().to_string(),
                |kind| format!("{kind:?}"),
            );
            return Err(Error::new(
                place,
                format!("a column of type {kind} does not contain plain numbers"),
                "write it as DOUBLE, FLOAT, INT32 or INT64",
            ));
        }
        let unsigned =
            unsigned || matches!(logical, Some(LogicalType::Integer(kind)) if !kind.is_signed);
        Ok(Leaf {
            index,
            unsigned,
            text,
        })
    }
}

impl ParquetFile {
    /// Hands the rows to `consume` in order. `layout` gives the meaning of the columns, `slice` the number of rows to decode at a time.
    pub fn for_each_batch(
        &self,
        layout: &Layout,
        slice: usize,
        progress: impl Fn(f64),
        mut consume: impl FnMut(&Batch) -> Result<()>,
    ) -> Result<u64> {
        let place = self.path.display().to_string();
        let mut cursors = Vec::new();
        let names = self.names();
        for (slot, name) in layout.slots.iter().zip(&names) {
            if let Some(column) = *slot {
                let cursor = Cursor::new(self, self.leaf(name)?);
                cursors.push((column, name.as_str(), cursor));
            }
        }
        let (rows, mut first) = (self.rows, 0);
        let next = || {
            (first < rows).then(|| {
                let count = (rows - first).min(slice as u64) as usize;
                first += count as u64;
                decode(&mut cursors, first - count as u64, count)
            })
        };
        ahead(&place, next, |batch| {
            let batch: Batch = batch.map_err(|fault: Fault| fault.at(&place))?;
            consume(&batch)?;
            progress((batch.first_row + batch.len() as u64) as f64 / rows as f64);
            Ok(())
        })?;
        Ok(rows)
    }

    /// One column of `layout`, steps as numbers; the bytes of the others are not read.
    pub fn column(&self, layout: &Layout, column: Column) -> Result<Vec<f64>> {
        let names = self.names();
        let at = layout.slots.iter().position(|slot| *slot == Some(column));
        let name = at.and_then(|at| names.get(at)).ok_or_else(|| {
            let place = self.path.display();
            missing(&format!("{place}, column {}", column.name()))
        })?;
        let mut cursor = Cursor::new(self, self.leaf(name)?);
        // A damaged footer may promise any number of rows.
        let mut all = Vec::with_capacity(self.rows.min(MOST_RESERVED) as usize);
        while (all.len() as u64) < self.rows {
            let first = all.len() as u64;
            let count = (self.rows - first).min(SLICE as u64) as usize;
            let decoded = decode_slice((column, name), &mut cursor, first, count)
                .map_err(|fault| fault.at(&self.path.display().to_string()))?;
            match decoded {
                Decoded::Values(values) => all.extend(values),
                Decoded::Steps(steps) => all.extend(steps.into_iter().map(f64::from)),
            }
        }
        Ok(all)
    }
}

fn missing(place: &str) -> Error {
    Error::new(place, "the column is missing", "check the name")
}

/// What is wrong with a slice of a column.
struct Fault {
    /// Number of the row from 0.
    row: u64,
    /// Name of the column in the file.
    column: String,
    refusal: Refusal,
}

impl Fault {
    fn at(self, place: &str) -> Error {
        let place = format!("{place}, row {}, column {}", self.row + 1, self.column);
        Error::new(place, self.refusal.problem, self.refusal.remedy)
    }
}

/// A slice of one column.
enum Decoded {
    Values(Vec<f64>),
    Steps(Vec<i32>),
}

/// A slice of some columns. If several fail, the earliest row is reported.
fn decode(
    cursors: &mut [(Column, &str, Cursor)],
    first: u64,
    count: usize,
) -> std::result::Result<Batch, Fault> {
    let mut batch = Batch {
        first_row: first,
        ..Batch::default()
    };
    let mut fault: Option<Fault> = None;
    for (column, name, cursor) in cursors {
        match decode_slice((*column, name), cursor, first, count) {
            Ok(Decoded::Steps(steps)) => batch.step = steps,
            Ok(Decoded::Values(values)) => {
                if let Some(target) = batch.values_mut(*column) {
                    *target = values;
                }
            }
            Err(worse) if fault.as_ref().is_none_or(|known| worse.row < known.row) => {
                fault = Some(worse);
            }
            Err(_) => {}
        }
    }
    fault.map_or(Ok(batch), Err)
}

fn decode_slice(
    (column, name): (Column, &str),
    cursor: &mut Cursor,
    first: u64,
    count: usize,
) -> std::result::Result<Decoded, Fault> {
    let fault = |row: usize, refusal| Fault {
        row: first + row as u64,
        column: name.to_owned(),
        refusal,
    };
    let mut values = Vec::new();
    cursor.read(count, &mut values).map_err(|problem| {
        let remedy = "make the file again from its source";
        fault(values.len().min(count - 1), Refusal { problem, remedy })
    })?;
    if column == Column::Step {
        let mut steps = Vec::with_capacity(count);
        for (row, &value) in values.iter().enumerate() {
            let step = cell::step_from_value(value, &|| value.to_string());
            steps.push(step.map_err(|refusal| fault(row, refusal))?);
        }
        return Ok(Decoded::Steps(steps));
    }
    let bad = |value: &f64| !cell::is_reading(*value) || (column == Column::Time && value.is_nan());
    if let Some(row) = values.iter().position(bad) {
        let refusal = match values[row].is_nan() {
            true => cell::no_time(),
            false => cell::no_reading(values[row], &format!("{:e}", values[row])),
        };
        return Err(fault(row, refusal));
    }
    Ok(Decoded::Values(values))
}

/// Reads one column from front to back, across its row groups.
struct Cursor {
    source: ParquetFile,
    leaf: Leaf,
    file: Option<Arc<StrictFile>>,
    /// Row group that is read next.
    group: usize,
    reader: Option<ColumnReader>,
    levels: Vec<i16>,
    /// Whether an error has been returned: the decoder's state is then undefined.
    broken: bool,
}

impl Cursor {
    /// Cursor at the first row of `leaf`.
    pub fn new(source: &ParquetFile, leaf: Leaf) -> Self {
        Self {
            source: source.clone(),
            leaf,
            file: None,
            group: 0,
            reader: None,
            levels: Vec::new(),
            broken: false,
        }
    }

    /// Appends the next `count` numbers, NaN for null. Beyond 2^53 the double nearest to a whole number is used: no sensor resolves more.
    pub fn read(&mut self, count: usize, values: &mut Vec<f64>) -> std::result::Result<(), String> {
        use ColumnReader as Reader;
        values.reserve(count);
        let unsigned = self.leaf.unsigned;
        self.advance(count, |reader, levels, count| match reader {
            Reader::DoubleColumnReader(reader) => append(reader, count, levels, values, |v| v),
            Reader::FloatColumnReader(reader) => append(reader, count, levels, values, f64::from),
            Reader::Int32ColumnReader(reader) => append(reader, count, levels, values, |v| {
                if unsigned {
                    v.cast_unsigned().into()
                } else {
                    v.into()
                }
            }),
            Reader::Int64ColumnReader(reader) => append(reader, count, levels, values, |v| {
                if unsigned {
                    v.cast_unsigned() as f64
                } else {
                    v as f64
                }
            }),
            _ => Err(ParquetError::General(
                "the column contains no numbers".into(),
            )),
        })
    }

    /// Lets `decode` read `count` rows, from as many row groups as needed.
    fn advance<F>(&mut self, count: usize, mut decode: F) -> std::result::Result<(), String>
    where
        F: FnMut(&mut ColumnReader, &mut Vec<i16>, usize) -> parquet::errors::Result<usize>,
    {
        if self.broken {
            return Err("the file is damaged before this row".to_owned());
        }
        // Until this succeeds, the decoder's state is undefined.
        self.broken = true;
        let mut missing = count;
        while missing > 0 {
            let mut reader = match self.reader.take() {
                Some(reader) => reader,
                None if self.group == self.source.metadata.num_row_groups() => {
                    return Err("the file has fewer values than its footer promises".to_owned());
                }
                None => {
                    self.group += 1;
                    self.open_group(self.group - 1)
                        .map_err(|error| unreadable(&error))?
                }
            };
            self.levels.clear();
            missing -= decode(&mut reader, &mut self.levels, missing)
                .map_err(|error| unreadable(&error))?
                .min(missing);
            if missing == 0 {
                self.reader = Some(reader);
            }
        }
        self.broken = false;
        Ok(())
    }

    fn open_group(&mut self, group: usize) -> parquet::errors::Result<ColumnReader> {
        let file = match &self.file {
            Some(file) => file.clone(),
            // A separate handle: other threads would move the position of a shared one.
            None => {
                let file = Arc::new(StrictFile::open(&self.source.path)?);
                self.file.insert(file).clone()
            }
        };
        let group = self.source.metadata.row_group(group);
        let chunk = group.column(self.leaf.index);
        let rows = usize::try_from(group.num_rows()).unwrap_or(0);
        let pages = SerializedPageReader::new(file, chunk, rows, None)?;
        Ok(get_column_reader(chunk.column_descr_ptr(), Box::new(pages)))
    }
}

/// Appends rows whose values `of` converts, NaN for each null.
fn append<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    count: usize,
    levels: &mut Vec<i16>,
    values: &mut Vec<f64>,
    of: impl Fn(T::T) -> f64,
) -> parquet::errors::Result<usize> {
    let mut stored = Vec::with_capacity(count);
    let (rows, _, _) = reader.read_records(count, Some(levels), None, &mut stored)?;
    if stored.len() == rows {
        values.extend(stored.into_iter().map(of));
        return Ok(rows);
    }
    let mut stored = stored.into_iter().map(of);
    let there = (0..rows).map(|row| levels.get(row).is_some_and(|level| *level > 0));
    values.extend(there.map(|there| match there {
        true => stored.next().unwrap_or(f64::NAN),
        false => f64::NAN,
    }));
    Ok(rows)
}

fn unreadable(error: &ParquetError) -> String {
    let text = error.to_string();
    let text = text
        .split_once(": ")
        .map_or(text.as_str(), |(_, rest)| rest);
    format!("the file cannot be decoded: {}", shorten(text.as_bytes()))
}

fn damaged(place: &str, error: &dyn std::fmt::Display) -> Error {
    Error::new(
        place,
        format!("this is not a readable Parquet file: {error}"),
        "make it again from its source",
    )
}
