//! `samples.csv`: parsed by several threads, chunk by chunk, handed on in order.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use memchr::{memchr, memrchr};

use super::batch::Batch;
use super::cell::{self, Refusal, shorten};
use super::columns::{Column, Layout};
use super::in_order::{in_order, worker_count};
use crate::error::{Error, Result};
use crate::separator::Separator;

#[cfg(test)]
mod tests;

/// Bytes that a worker parses at a time: large beside a seek, small beside the memory.
pub(super) const CHUNK: u64 = 4 << 20;

/// Longest line in bytes; a file with a longer one is not a table.
const LONGEST_LINE: u64 = 1 << 20;

/// UTF-8 byte order mark, which spreadsheets put before the header.
pub(super) const BOM: &[u8] = b"\xef\xbb\xbf";

/// A CSV file whose header has been read.
#[derive(Debug, Clone)]
pub(super) struct CsvFile {
    path: PathBuf,
    pub layout: Layout,
    names: Vec<String>,
    /// Offset of the first byte after the header.
    start: u64,
    length: u64,
}

impl CsvFile {
    /// Reads and checks the header.
    pub fn open(path: &Path) -> Result<CsvFile> {
        let io = |error: std::io::Error| Error::io(path, &error);
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        let mut head = Vec::new();
        (&mut file)
            .take(LONGEST_LINE)
            .read_to_end(&mut head)
            .map_err(io)?;
        let place = path.display().to_string();
        if head.is_empty() {
            return Err(Error::new(place, "the file is empty", "record it again"));
        }
        let end = match memchr(b'\n', &head) {
            Some(end) => end + 1,
            None if (head.len() as u64) < LONGEST_LINE => head.len(),
            None => {
                return Err(Error::new(
                    place,
                    "the first MiB has no line break",
                    "give a text file with one row a line",
                ));
            }
        };
        let header = head[..end].strip_prefix(BOM).unwrap_or(&head[..end]);
        if header.contains(&0) {
            return Err(Error::new(
                place,
                "this is not text",
                "give a CSV file, or name a Parquet file samples.parquet",
            ));
        }
        let mut record = csv::ByteRecord::new();
        Separator::Comma.split(header.trim_ascii_end(), &mut record);
        let names: Vec<String> = record
            .iter()
            .map(|name| String::from_utf8_lossy(name).into_owned())
            .collect();
        let layout = Layout::from_names(&names, &format!("{place}, row 1"))?;
        // At least part of a row must follow the header.
        if head[end..].trim_ascii().is_empty() && length == head.len() as u64 {
            return Err(Error::new(
                format!("{place}, row 2"),
                "the file has a header but no row of data",
                "record it again",
            ));
        }
        Ok(CsvFile {
            path: path.to_owned(),
            layout,
            names,
            start: end as u64,
            length,
        })
    }

    /// Leaves out what follows the last line break, and returns its number of bytes. In an unfinished file this may be half a row, and half a number
    /// reads like a whole one.
    pub fn leave_out_cut_row(&mut self) -> Result<u64> {
        let io = |error: std::io::Error| Error::io(&self.path, &error);
        let mut file = File::open(&self.path).map_err(io)?;
        let from = self.start.max(self.length.saturating_sub(LONGEST_LINE));
        file.seek(SeekFrom::Start(from)).map_err(io)?;
        let mut tail = Vec::new();
        read_up_to(&mut file, self.length - from, &mut tail).map_err(io)?;
        let whole = memrchr(b'\n', &tail).map_or(0, |newline| newline + 1);
        let cut = (tail.len() - whole) as u64;
        self.length -= cut;
        Ok(cut)
    }

    /// Hands the rows to `consume` in order and returns their number. A worker parses `chunk` bytes at a time.
    pub fn for_each_batch(
        &self,
        chunk: u64,
        progress: impl Fn(f64),
        mut consume: impl FnMut(&Batch) -> Result<()>,
    ) -> Result<u64> {
        let place = self.path.display().to_string();
        let chunks = (self.length - self.start).div_ceil(chunk);
        let workers = (worker_count() as u64).min(chunks).max(1) as usize;
        let mut rows = 0;
        // The header is line 1.
        let mut lines = 1;
        in_order(
            &place,
            chunks,
            workers,
            |_| {
                let mut worker = Worker::new(self, chunk);
                move |index| worker.parse(index)
            },
            |index, parsed: std::result::Result<Parsed, Fault>| {
                let mut parsed = parsed.map_err(|fault| fault.at(&place, lines))?;
                lines += parsed.lines;
                if !parsed.batch.is_empty() {
                    parsed.batch.first_row = rows;
                    rows += parsed.batch.len() as u64;
                    consume(&parsed.batch)?;
                }
                progress((index + 1) as f64 / chunks as f64);
                Ok(())
            },
        )?;
        if rows == 0 {
            return Err(Error::new(
                place,
                "the file has no row of data",
                "record it again",
            ));
        }
        Ok(rows)
    }
}

/// Rows of one chunk.
struct Parsed {
    batch: Batch,
    /// Lines of text, blank ones included.
    lines: u64,
}

/// What is wrong with a chunk. Only the consumer knows how many lines came before.
enum Fault {
    /// The file could not be read.
    File(Error),
    Row {
        /// Lines before it in its chunk.
        line: u64,
        column: Option<String>,
        refusal: Refusal,
    },
}

impl Fault {
    fn at(self, place: &str, lines_before: u64) -> Error {
        match self {
            Fault::File(error) => error,
            Fault::Row {
                line,
                column,
                refusal,
            } => {
                let row = lines_before + line + 1;
                let place = match column {
                    Some(column) => format!("{place}, row {row}, column {column}"),
                    None => format!("{place}, row {row}"),
                };
                Error::new(place, refusal.problem, refusal.remedy)
            }
        }
    }
}

/// Reads and parses chunks; one for each thread.
struct Worker<'a> {
    source: &'a CsvFile,
    chunk: u64,
    file: Option<File>,
    text: Vec<u8>,
    /// Number of rows to allocate for, guessed from the chunk before.
    expected_rows: usize,
    record: csv::ByteRecord,
}

impl<'a> Worker<'a> {
    fn new(source: &'a CsvFile, chunk: u64) -> Self {
        Self {
            source,
            chunk,
            file: None,
            text: Vec::new(),
            expected_rows: 0,
            record: csv::ByteRecord::new(),
        }
    }

    fn parse(&mut self, index: u64) -> std::result::Result<Parsed, Fault> {
        let mut text = std::mem::take(&mut self.text);
        let owned = self
            .read(index, &mut text)
            .map_err(|error| Fault::File(Error::io(&self.source.path, &error)))?;
        let parsed = self.parse_lines(owned);
        self.text = text;
        parsed
    }

    /// Reads the lines that *begin* inside chunk `index`, so that each line belongs to one chunk.
    fn read<'t>(&mut self, index: u64, text: &'t mut Vec<u8>) -> std::io::Result<Owned<'t>> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(File::open(&self.source.path)?),
        };
        let length = self.source.length;
        let begin = self.source.start + index * self.chunk;
        let end = (begin + self.chunk).min(length);
        // One byte more in front shows whether a line begins right at `begin`.
        let from = if index == 0 { begin } else { begin - 1 };
        file.seek(SeekFrom::Start(from))?;
        text.clear();
        if (read_up_to(file, end - from, text)? as u64) < end - from {
            let kind = std::io::ErrorKind::UnexpectedEof;
            let problem = "the file became shorter while it was being read";
            return Err(std::io::Error::new(kind, problem));
        }
        let first = match index {
            0 => 0,
            _ => memchr(b'\n', text).map_or(text.len(), |newline| newline + 1),
        };
        let mut too_long = false;
        if first < text.len() && text.last() != Some(&b'\n') && end < length {
            // The last line runs into the next chunk, which skips it.
            const STEP: u64 = 1 << 16;
            let whole = text.len();
            loop {
                let before = text.len();
                if read_up_to(file, STEP, text)? == 0 {
                    break;
                }
                if let Some(newline) = memchr(b'\n', &text[before..]) {
                    text.truncate(before + newline + 1);
                    break;
                }
                let line = memrchr(b'\n', &text[first..whole]).map_or(first, |n| first + n + 1);
                if (text.len() - line) as u64 > LONGEST_LINE {
                    too_long = true;
                    break;
                }
            }
        }
        Ok(Owned {
            text: &text[first..],
            too_long,
        })
    }

    fn parse_lines(&mut self, owned: Owned<'_>) -> std::result::Result<Parsed, Fault> {
        let slots = &self.source.layout.slots;
        let mut values: Vec<Vec<f64>> = slots
            .iter()
            .map(|slot| match slot {
                None | Some(Column::Step) => Vec::new(),
                Some(_) => Vec::with_capacity(self.expected_rows),
            })
            .collect();
        let mut steps = Vec::new();
        let quotes = memchr(b'"', owned.text).is_some();
        let mut rest = owned.text;
        let mut lines = 0;
        while !rest.is_empty() {
            let (line, ended) = match memchr(b'\n', rest) {
                Some(newline) => {
                    let line = &rest[..newline];
                    rest = &rest[newline + 1..];
                    (line, true)
                }
                None => (std::mem::take(&mut rest), false),
            };
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            lines += 1;
            if line.trim_ascii().is_empty() {
                continue;
            }
            if !ended && owned.too_long {
                return Err(self.fault(
                    lines,
                    None,
                    Refusal {
                        problem: "the line is longer than 1 MiB".to_owned(),
                        remedy: "give a text file with one row a line",
                    },
                ));
            }
            let row = if quotes && memchr(b'"', line).is_some() {
                Separator::Comma.split(line, &mut self.record);
                parse_cells(slots, self.record.iter(), &mut values, &mut steps)
            } else {
                parse_plain(slots, line, &mut values, &mut steps)
            };
            match row {
                Ok(()) => {}
                Err(fault) => {
                    Separator::Comma.split(line, &mut self.record);
                    let cells = self.record.len();
                    return Err(match fault {
                        // A missing or doubled cell shifts the others: the width is then the cause.
                        RowFault::Cell(column, refusal) if cells == slots.len() => {
                            self.fault(lines, Some(column), refusal)
                        }
                        _ => self.fault(lines, None, self.wrong_width(cells, ended)),
                    });
                }
            }
        }
        let mut batch = Batch::default();
        for (slot, values) in slots.iter().zip(values) {
            if let Some(target) = slot.and_then(|column| batch.values_mut(column)) {
                *target = values;
            }
        }
        batch.step = steps;
        self.expected_rows = batch.len() + batch.len() / 16 + 16;
        Ok(Parsed { batch, lines })
    }

    fn fault(&self, lines: u64, column: Option<usize>, refusal: Refusal) -> Fault {
        Fault::Row {
            line: lines - 1,
            column: column.map(|i| self.source.names[i].clone()),
            refusal,
        }
    }

    fn wrong_width(&self, cells: usize, ended: bool) -> Refusal {
        let expected = self.source.names.len();
        if !ended && cells < expected {
            Refusal {
                problem: format!(
                    "the file is truncated: its last row has {cells} of {expected} cells"
                ),
                remedy: "copy the file again, or remove the last row",
            }
        } else {
            Refusal {
                problem: format!("the row has {cells} cells, the header {expected}"),
                remedy: "correct the row",
            }
        }
    }
}

/// The lines that belong to a chunk.
struct Owned<'t> {
    text: &'t [u8],
    /// Whether reading stopped within the last line because it was too long.
    too_long: bool,
}

/// Appends up to `count` bytes, fewer only at the end of the file.
fn read_up_to(file: &mut File, count: u64, text: &mut Vec<u8>) -> std::io::Result<usize> {
    file.take(count).read_to_end(text)
}

/// What is wrong with a row.
enum RowFault {
    /// The cell in this position.
    Cell(usize, Refusal),
    /// The number of cells.
    Width,
}

/// Parses a line without quotes.
///
/// The numbers are parsed in place, without looking for the end of the cell first. This takes half the time of splitting first and then parsing with
/// the standard library (12 instead of 25 ns a cell).
fn parse_plain(
    slots: &[Option<Column>],
    line: &[u8],
    values: &mut [Vec<f64>],
    steps: &mut Vec<i32>,
) -> std::result::Result<(), RowFault> {
    let mut rest = Some(line);
    for (position, slot) in slots.iter().enumerate() {
        let text = rest.ok_or(RowFault::Width)?;
        if !matches!(slot, None | Some(Column::Step))
            && let Ok((value, used)) = fast_float2::parse_partial::<f64, _>(text)
            // NaN takes the long way too, where it is refused in the column of the time.
            && !value.is_nan()
            && cell::is_reading(value)
            && (used == text.len() || text[used] == b',')
        {
            values[position].push(value);
            rest = text.get(used + 1..);
            continue;
        }
        let end = memchr(b',', text).unwrap_or(text.len());
        rest = text.get(end + 1..);
        parse_cell(*slot, &text[..end], &mut values[position], steps)
            .map_err(|refusal| RowFault::Cell(position, refusal))?;
    }
    match rest {
        None => Ok(()),
        Some(_) => Err(RowFault::Width),
    }
}

/// Parses the cells of a line that is already split.
fn parse_cells<'c>(
    slots: &[Option<Column>],
    cells: impl ExactSizeIterator<Item = &'c [u8]>,
    values: &mut [Vec<f64>],
    steps: &mut Vec<i32>,
) -> std::result::Result<(), RowFault> {
    if cells.len() != slots.len() {
        return Err(RowFault::Width);
    }
    for (position, (cell, slot)) in cells.zip(slots).enumerate() {
        parse_cell(*slot, cell, &mut values[position], steps)
            .map_err(|refusal| RowFault::Cell(position, refusal))?;
    }
    Ok(())
}

fn parse_cell(
    slot: Option<Column>,
    cell: &[u8],
    values: &mut Vec<f64>,
    steps: &mut Vec<i32>,
) -> std::result::Result<(), Refusal> {
    match slot {
        None => {}
        Some(Column::Step) => steps.push(cell::step(cell)?),
        Some(column) => {
            let value = cell::number(cell)?;
            if column == Column::Time && value.is_nan() {
                return Err(match cell.trim_ascii() {
                    b"" => cell::no_time(),
                    text => Refusal {
                        problem: format!("the time is {}", shorten(text)),
                        remedy: cell::no_time().remedy,
                    },
                });
            }
            values.push(value);
        }
    }
    Ok(())
}
