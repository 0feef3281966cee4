//! `samples.csv`, read row by row like any other text.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::ahead::ahead;
use super::batch::Batch;
use super::cell::{self, Refusal, shorten};
use super::columns::{Column, Layout};
use crate::error::{Error, Result};
use crate::import::broken::Unreadable;
use crate::import::comment_signs::CommentSigns;
use crate::import::head::{self, LineFormat};
use crate::import::lines::{LONGEST_LINE, Lines};
use crate::import::noticed::Noticed;
use crate::separator::Separator;

/// Rows that are handed on at a time.
pub(super) const PIECE: usize = 1 << 14;

/// A CSV file whose header has been read.
#[derive(Debug, Clone)]
pub(super) struct CsvFile {
    path: PathBuf,
    pub layout: Layout,
    names: Vec<String>,
    /// Whether what follows the last line break is left out.
    leaves_out_cut: bool,
}

impl CsvFile {
    /// Reads and checks the header.
    pub fn open(path: &Path) -> Result<CsvFile> {
        let place = path.display().to_string();
        let (head, _) = head::open(path, LONGEST_LINE)?;
        if head.is_empty() {
            return Err(Error::new(place, "the file is empty", "record it again"));
        }
        let end = memchr::memchr(b'\n', &head);
        if end.is_none() && head.len() as u64 >= LONGEST_LINE {
            let problem = "the first MiB has no line break";
            let remedy = "give a text file with one row a line";
            return Err(Error::new(place, problem, remedy));
        }
        let mut record = csv::ByteRecord::new();
        let header = head[..end.unwrap_or(head.len())].trim_ascii_end();
        Separator::Comma.split(header, &mut record);
        let names = head::texts(&record);
        Ok(CsvFile {
            path: path.to_owned(),
            layout: Layout::from_names(&names, &format!("{place}, row 1"))?,
            names,
            leaves_out_cut: false,
        })
    }

    /// The same file with its pair `number` in the places of the first.
    pub fn of_pair(&self, number: u8) -> Self {
        Self {
            layout: self.layout.of_pair(number),
            ..self.clone()
        }
    }

    /// Leaves out what follows the last line break, and returns whether there is something. In an unfinished file, which may still grow, this may be half
    /// a row, and half a number reads like a whole one.
    pub fn leave_out_cut_row(&mut self) -> Result<bool> {
        let io = |error: std::io::Error| Error::io(&self.path, &error);
        let mut file = File::open(&self.path).map_err(io)?;
        let mut last = [0];
        file.seek(SeekFrom::End(-1)).map_err(io)?;
        file.read_exact(&mut last).map_err(io)?;
        self.leaves_out_cut = true;
        Ok(last != *b"\n")
    }

    /// Hands the rows to `consume` in order, `piece` at a time, and returns their number.
    pub fn for_each_batch(
        &self,
        piece: usize,
        progress: impl Fn(f64),
        mut consume: impl FnMut(&Batch) -> Result<()>,
    ) -> Result<u64> {
        let format = LineFormat {
            separator: Separator::Comma,
            comments: CommentSigns::NONE,
        };
        let place = self.path.display().to_string();
        let opened = head::open(&self.path, LONGEST_LINE)?;
        let mut lines = Lines::new(&self.path, format, None, opened, 2)?;
        let mut rows = 0;
        let next = || match self.read(&mut lines, piece) {
            Ok(batch) if batch.is_empty() => None,
            batch => Some((batch, lines.progress())),
        };
        ahead(&place, next, |(batch, share)| {
            let batch = Batch {
                first_row: rows,
                ..batch?
            };
            rows += batch.len() as u64;
            consume(&batch)?;
            progress(share);
            Ok(())
        })?;
        progress(1.0);
        match rows {
            0 => Err(Error::new(
                place,
                "the file has no row of data",
                "record it again",
            )),
            rows => Ok(rows),
        }
    }

    /// The next `piece` rows, fewer at the end.
    fn read(&self, lines: &mut Lines, piece: usize) -> Result<Batch> {
        let (mut record, mut noticed) = (csv::ByteRecord::new(), Noticed::default());
        let mut batch = Batch::default();
        let mut numbers = Vec::with_capacity(self.names.len());
        while batch.len() < piece {
            let next = lines.next_row(&mut noticed);
            let next = next.map_err(Unreadable::into_error)?;
            let row = next.filter(|(_, ended)| *ended || !self.leaves_out_cut);
            let Some((number, ended)) = row else { break };
            if self.plain(lines.line(), &mut numbers) {
                self.push_numbers(&numbers, &mut batch);
                continue;
            }
            Separator::Comma.split(lines.line(), &mut record);
            if !record.iter().all(<[u8]>::is_empty) {
                self.push(&record, &mut batch)
                    .map_err(|fault| self.refused(fault, &record, number, ended))?;
            }
        }
        Ok(batch)
    }

    /// Parses a line of plain cells in place, without looking for their ends first, which takes half the time of [`Self::push`]. False if a cell is
    /// anything else: then `push` decides.
    fn plain(&self, line: &[u8], numbers: &mut Vec<f64>) -> bool {
        numbers.clear();
        let mut rest = Some(line).filter(|line| memchr::memchr(b'"', line).is_none());
        for slot in &self.layout.slots {
            let Some(text) = rest else { return false };
            let end = || memchr::memchr(b',', text).unwrap_or(text.len());
            let (number, used) = match slot {
                None => (f64::NAN, end()),
                Some(Column::Step) => match cell::step(&text[..end()]) {
                    Ok(step) => (f64::from(step), end()),
                    Err(_) => return false,
                },
                Some(column) => match fast_float2::parse_partial::<f64, _>(text) {
                    Ok((number, used)) if !number.is_nan() && cell::is_reading(number) => {
                        (number, used)
                    }
                    Err(_) if text.starts_with(b",") && *column != Column::Time => (f64::NAN, 0),
                    _ => return false,
                },
            };
            if !matches!(text.get(used), None | Some(b',')) {
                return false;
            }
            numbers.push(number);
            rest = text.get(used + 1..);
        }
        rest.is_none()
    }

    fn push_numbers(&self, numbers: &[f64], batch: &mut Batch) {
        for (number, slot) in numbers.iter().zip(&self.layout.slots) {
            let Some(column) = *slot else { continue };
            match batch.values_mut(column) {
                Some(values) => values.push(*number),
                None => batch.step.push(*number as i32),
            }
        }
    }

    fn push(&self, record: &csv::ByteRecord, batch: &mut Batch) -> std::result::Result<(), Fault> {
        let slots = &self.layout.slots;
        if record.len() != slots.len() {
            return Err(Fault::Width);
        }
        for (position, (cell, slot)) in record.iter().zip(slots).enumerate() {
            let Some(column) = *slot else { continue };
            let fault = |refusal| Fault::Cell(position, refusal);
            match batch.values_mut(column) {
                Some(values) => values.push(number(column, cell).map_err(fault)?),
                None => batch.step.push(cell::step(cell).map_err(fault)?),
            }
        }
        Ok(())
    }

    fn refused(&self, fault: Fault, record: &csv::ByteRecord, row: u64, ended: bool) -> Error {
        let place = format!("{}, row {row}", self.path.display());
        let (cells, expected) = (record.len(), self.names.len());
        match fault {
            Fault::Cell(position, refusal) => {
                let place = format!("{place}, column {}", self.names[position]);
                Error::new(place, refusal.problem, refusal.remedy)
            }
            Fault::Width if !ended && cells < expected => Error::new(
                place,
                format!("the file is truncated: its last row has {cells} of {expected} cells"),
                "copy the file again, or remove the last row",
            ),
            Fault::Width => Error::new(
                place,
                format!("the row has {cells} cells, the header {expected}"),
                "correct the row",
            ),
        }
    }
}

/// What is wrong with a row.
enum Fault {
    /// The cell in this position.
    Cell(usize, Refusal),
    /// The number of cells.
    Width,
}

fn number(column: Column, cell: &[u8]) -> std::result::Result<f64, Refusal> {
    let value = cell::number(cell)?;
    match cell.trim_ascii() {
        _ if column != Column::Time || !value.is_nan() => Ok(value),
        b"" => Err(cell::no_time()),
        text => Err(Refusal {
            problem: format!("the time is {}", shorten(text)),
            remedy: cell::no_time().remedy,
        }),
    }
}

#[cfg(test)]
mod tests;
