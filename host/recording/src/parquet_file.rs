//! `samples.parquet`: decoded by several threads, each with some of the columns, slice by slice.
//!
//! The work is divided by columns, not by row groups. Files of other programs are often one big row group, which could not be divided at all. With a
//! thread for each row group, the memory would grow with the row group, whose size its writer chose.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
use parquet::file::serialized_reader::SerializedPageReader;

use super::batch::Batch;
use super::cell::{self, Refusal, shorten};
use super::columns::{Column, Layout};
use super::in_order::{in_order, reader_panicked, worker_count};
use super::strict_file::StrictFile;
use crate::error::{Error, Result};

#[cfg(test)]
mod tests;

/// Rows that are decoded at a time: 1 MiB of numbers in each column.
pub(super) const SLICE: usize = 1 << 17;

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
    /// INT64 with a sign.
    long: bool,
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

    /// The column called `name`, checked to be flat and of a type that becomes a number, or text.
    pub fn leaf(&self, name: &str) -> Result<Leaf> {
        let schema = self.metadata.file_metadata().schema_descr();
        let place = format!("{}, column {name}", self.path.display());
        let not_flat = || {
            let problem = "the column is nested or repeated";
            Error::new(&place, problem, "write it as one number in each row")
        };
        let (index, column) = (0..schema.num_columns())
            .map(|index| (index, schema.column(index)))
            .find(|(_, column)| {
                column
                    .path()
                    .parts()
                    .first()
                    .is_some_and(|part| part == name)
            })
            .ok_or_else(|| Error::new(&place, "the column is missing", "check the name"))?;
        let info = column.self_type().get_basic_info();
        let repeated = info.has_repetition() && info.repetition() == Repetition::REPEATED;
        if column.path().parts().len() != 1 || repeated {
            return Err(not_flat());
        }
        let logical = column.logical_type_ref();
        let converted = column.converted_type();
        let plain = match logical {
            None => converted == ConvertedType::NONE,
            Some(kind) => matches!(kind, LogicalType::Integer { .. } | LogicalType::Unknown),
        };
        let unsigned = matches!(
            converted,
            ConvertedType::UINT_8
                | ConvertedType::UINT_16
                | ConvertedType::UINT_32
                | ConvertedType::UINT_64
        );
        let integer = unsigned
            || matches!(
                converted,
                ConvertedType::INT_8
                    | ConvertedType::INT_16
                    | ConvertedType::INT_32
                    | ConvertedType::INT_64
            );
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
            long: !unsigned && column.physical_type() == Physical::INT64,
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
        let names = self.names();
        let mut wanted = Vec::new();
        for (slot, name) in layout.slots.iter().zip(&names) {
            if let Some(column) = *slot {
                wanted.push((column, self.leaf(name)?));
            }
        }
        let workers = worker_count().min(wanted.len()).max(1);
        let slices = self.rows.div_ceil(slice as u64);
        let mut batch = Batch::default();
        let mut fault: Option<Fault> = None;
        in_order(
            &place,
            slices * workers as u64,
            workers,
            |worker| {
                // Distributed in turn, so that neighbours, which cost the same, go to different threads.
                let mine = wanted.iter().skip(worker).step_by(workers);
                let mut cursors: Vec<(Column, Cursor)> = mine
                    .map(|&(column, leaf)| (column, Cursor::new(self, leaf)))
                    .collect();
                move |index| {
                    let first = index / workers as u64 * slice as u64;
                    let count = (self.rows - first).min(slice as u64) as usize;
                    let decode = |(column, cursor): &mut (Column, Cursor)| {
                        Ok((*column, decode_slice(*column, cursor, first, count)?))
                    };
                    cursors.iter_mut().map(decode).collect()
                }
            },
            |index, part: std::result::Result<Vec<(Column, Decoded)>, Fault>| {
                match part {
                    Err(worse) => {
                        // If several columns fail in this slice, the earliest row is reported.
                        if fault.as_ref().is_none_or(|known| worse.row < known.row) {
                            fault = Some(worse);
                        }
                    }
                    Ok(part) => {
                        for (column, decoded) in part {
                            match decoded {
                                Decoded::Steps(steps) => batch.step = steps,
                                Decoded::Values(values) => {
                                    if let Some(target) = batch.values_mut(column) {
                                        *target = values;
                                    }
                                }
                            }
                        }
                    }
                }
                if !(index + 1).is_multiple_of(workers as u64) {
                    return Ok(());
                }
                if let Some(fault) = fault.take() {
                    return Err(fault.at(&place));
                }
                consume(&batch)?;
                batch.first_row += batch.len() as u64;
                progress((index + 1) as f64 / (slices * workers as u64) as f64);
                Ok(())
            },
        )?;
        Ok(self.rows)
    }

    /// One column, steps as numbers; the bytes of the others are not read.
    pub fn column(&self, column: Column) -> Result<Vec<f64>> {
        let mut cursor = Cursor::new(self, self.leaf(column.name())?);
        // A damaged footer may promise any number of rows.
        let mut all = Vec::with_capacity(self.rows.min(MOST_RESERVED) as usize);
        while (all.len() as u64) < self.rows {
            let first = all.len() as u64;
            let count = (self.rows - first).min(SLICE as u64) as usize;
            let decoded = decode_slice(column, &mut cursor, first, count)
                .map_err(|fault| fault.at(&self.path.display().to_string()))?;
            match decoded {
                Decoded::Values(values) => all.extend(values),
                Decoded::Steps(steps) => all.extend(steps.into_iter().map(f64::from)),
            }
        }
        Ok(all)
    }
}

/// What is wrong with a slice of a column.
struct Fault {
    /// Number of the row from 0.
    row: u64,
    column: &'static str,
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

fn decode_slice(
    column: Column,
    cursor: &mut Cursor,
    first: u64,
    count: usize,
) -> std::result::Result<Decoded, Fault> {
    let fault = |row: usize, refusal| Fault {
        row: first + row as u64,
        column: column.name(),
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
pub(super) struct Cursor {
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

    /// Appends the next `count` values, NaN for null.
    pub fn read(&mut self, count: usize, values: &mut Vec<f64>) -> std::result::Result<(), String> {
        values.reserve(count);
        let unsigned = self.leaf.unsigned;
        self.advance(count, |reader, levels, count| match reader {
            ColumnReader::DoubleColumnReader(reader) => {
                let start = values.len();
                let (rows, _, _) = reader.read_records(count, Some(levels), None, values)?;
                spread(values, start, rows, levels, f64::NAN);
                Ok(rows)
            }
            ColumnReader::FloatColumnReader(reader) => {
                append(reader, count, levels, values, f64::from)
            }
            ColumnReader::Int32ColumnReader(reader) => {
                append(reader, count, levels, values, |value| match unsigned {
                    true => f64::from(value.cast_unsigned()),
                    false => f64::from(value),
                })
            }
            // Beyond 2^53 the nearest double is used: no sensor resolves more.
            ColumnReader::Int64ColumnReader(reader) => {
                append(reader, count, levels, values, |value| match unsigned {
                    true => value.cast_unsigned() as f64,
                    false => value as f64,
                })
            }
            _ => Err(ParquetError::General(
                "the column does not contain numbers".into(),
            )),
        })
    }

    /// Appends the next `count` values. A column of signed INT64 is also appended to `wholes` without rounding, `None` for null.
    pub fn read_whole(
        &mut self,
        count: usize,
        values: &mut Vec<f64>,
        wholes: &mut Vec<Option<i64>>,
    ) -> std::result::Result<(), String> {
        if !self.leaf.long {
            return self.read(count, values);
        }
        self.advance(count, |reader, levels, count| {
            let ColumnReader::Int64ColumnReader(reader) = reader else {
                return Err(ParquetError::General(
                    "the column does not contain INT64".into(),
                ));
            };
            let (start, mut stored) = (wholes.len(), Vec::with_capacity(count));
            let (rows, _, _) = reader.read_records(count, Some(levels), None, &mut stored)?;
            wholes.extend(stored.into_iter().map(Some));
            spread(wholes, start, rows, levels, None);
            values.extend(
                wholes[start..]
                    .iter()
                    .map(|v| v.map_or(f64::NAN, |v| v as f64)),
            );
            Ok(rows)
        })
    }

    /// Appends the next `count` texts, empty for null.
    pub fn read_text(
        &mut self,
        count: usize,
        texts: &mut Vec<ByteArray>,
    ) -> std::result::Result<(), String> {
        self.advance(count, |reader, levels, count| {
            let ColumnReader::ByteArrayColumnReader(reader) = reader else {
                return Err(ParquetError::General(
                    "the column does not contain text".into(),
                ));
            };
            let start = texts.len();
            let (rows, _, _) = reader.read_records(count, Some(levels), None, texts)?;
            spread(texts, start, rows, levels, ByteArray::from(Vec::new()));
            Ok(rows)
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

/// Appends rows whose values `number` turns into doubles.
fn append<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    count: usize,
    levels: &mut Vec<i16>,
    values: &mut Vec<f64>,
    number: impl Fn(T::T) -> f64,
) -> parquet::errors::Result<usize> {
    let start = values.len();
    let mut stored = Vec::with_capacity(count);
    let (rows, _, _) = reader.read_records(count, Some(levels), None, &mut stored)?;
    values.extend(stored.into_iter().map(number));
    spread(values, start, rows, levels, f64::NAN);
    Ok(rows)
}

/// Spreads the values from `start` on so that every null among `rows` rows has its place.
fn spread<T: Clone>(values: &mut Vec<T>, start: usize, rows: usize, levels: &[i16], null: T) {
    let mut from = values.len();
    if from - start == rows {
        return;
    }
    values.resize(start + rows, null.clone());
    // From the back, so that nothing is overwritten before it has moved.
    for row in (0..rows.min(levels.len())).rev() {
        if levels[row] > 0 && from > start {
            from -= 1;
            values.swap(start + row, from);
        } else {
            values[start + row] = null.clone();
        }
    }
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
