//! Rows of a foreign table, of text or in Parquet.

use std::path::Path;

use super::assignment::{ColumnList, Role};
use super::broken::{Fault, Unreadable};
use super::comment_signs::TextFormat;
use super::head::{self, LineFormat};
use super::header::{HEAD, Header};
use super::labelled::Samples;
use super::lines::Lines;
use super::noticed::Noticed;
#[cfg(feature = "parquet")]
use super::parquet_rows::ParquetRows;
use super::row_filter::RowFilter;
use super::time::{Stamp, calendar_time};
use crate::cell::Refusal;
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::separator::Separator;

/// The wanted cells of a row.
#[derive(Debug, Default)]
pub(super) struct Cells {
    /// Numbers in the order of the table's roles; NaN in the place of a step.
    pub numbers: Vec<f64>,
    /// Time stamp; among the numbers it is rounded.
    pub stamp: Stamp,
    /// Text of the step.
    pub step: Vec<u8>,
}

/// A table, positioned at its next row.
#[derive(Debug)]
pub(super) struct Table {
    pub header: Header,
    source: Source,
    record: csv::ByteRecord,
    pub noticed: Noticed,
}

#[derive(Debug)]
enum Source {
    Text(Box<Lines>),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetRows>),
}

/// Whether a file is one of Parquet, by its ending.
pub(super) fn is_parquet(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("parquet"))
}

impl Table {
    /// Opens the file and finds its columns and its first row; without `list` the names of its columns must be those of a recording. Rows that do not
    /// satisfy `filters` are skipped.
    pub fn open(
        path: &Path,
        list: Option<&ColumnList>,
        format: TextFormat,
        filters: &[RowFilter],
    ) -> Result<Self> {
        let mut noticed = Noticed::default();
        let (header, source) = match is_parquet(path) {
            #[cfg(not(feature = "parquet"))]
            true => return Err(crate::writer::without_parquet(path)),
            #[cfg(feature = "parquet")]
            true => {
                let mut rows = ParquetRows::open(path)?;
                let header = Header::of_names(path, rows.names(), list, filters, &mut noticed)?;
                rows.read_columns(header.positions())?;
                (header, Source::Parquet(Box::new(rows)))
            }
            false => {
                let (header, lines) = open_text(path, list, format, filters, &mut noticed)?;
                (header, Source::Text(Box::new(lines)))
            }
        };
        Ok(Self {
            header,
            source,
            record: csv::ByteRecord::new(),
            noticed,
        })
    }

    /// Whether its cells can be copied as they are written.
    pub fn is_text(&self) -> bool {
        matches!(self.source, Source::Text(_))
    }

    /// The cells of the last row, with their columns.
    pub fn all_cells(&self) -> impl Iterator<Item = (&[u8], Option<Column>)> {
        (0..self.header.width).map(|k| (&self.record[k], self.header.column(k)))
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        match &self.source {
            Source::Text(lines) => lines.progress(),
            #[cfg(feature = "parquet")]
            Source::Parquet(rows) => rows.progress(),
        }
    }

    /// Reads the next row into `cells` and returns its number, that of its line in text; `None` at the end.
    pub fn next(&mut self, cells: &mut Cells) -> std::result::Result<Option<u64>, Unreadable> {
        loop {
            let next = match &mut self.source {
                Source::Text(lines) => lines.next(&mut self.record, &mut self.noticed)?,
                #[cfg(feature = "parquet")]
                Source::Parquet(rows) => rows.next(&mut self.record)?.map(|row| (row, true)),
            };
            let Some((number, ended)) = next else {
                return Ok(None);
            };
            if let Source::Text(lines) = &self.source
                && ended
                && lines.is_of_letters()
                && self.header.are_words(&self.record)
            {
                self.noticed.words(number);
                continue;
            }
            if !self.header.keep(&self.record) {
                continue;
            }
            let broken = |fault, refusal| {
                let place = self.header.place(number);
                Err(Unreadable::row(number, fault, place, refusal))
            };
            if let Some(refusal) = self.header.misfit(&self.record, ended) {
                let fault = match ended || self.record.len() > self.header.width {
                    true => Fault::Width,
                    false => Fault::Truncated,
                };
                return broken(fault, refusal);
            }
            if matches!(&self.source, Source::Text(lines) if lines.is_damaged()) {
                let refusal = Refusal {
                    problem: "its checksum is wrong".into(),
                    remedy: "remove the row",
                };
                return broken(Fault::Checksum, refusal);
            }
            self.parse(number, cells)?;
            return Ok(Some(number));
        }
    }

    fn parse(&mut self, row: u64, cells: &mut Cells) -> std::result::Result<(), Unreadable> {
        cells.numbers.clear();
        cells.step.clear();
        let mut nanoseconds = None;
        for &(position, role) in &self.header.wanted {
            let cell = &self.record[position];
            if role == Role::Column(Column::Step) {
                cells.step.extend_from_slice(cell);
                cells.numbers.push(f64::NAN);
                continue;
            }
            let time = role == Role::Column(Column::Time);
            if time && let Some(stamp) = calendar_time(cell) {
                cells.stamp = stamp;
                cells.numbers.push(stamp.value);
                self.noticed.calendar = true;
                continue;
            }
            let number = self.header.format.number(cell).map_err(|refusal| {
                let place = format!("{}, column {}", self.header.place(row), role.name());
                Unreadable::row(row, Fault::Reading, place, refusal)
            })?;
            if time {
                cells.stamp = Stamp::in_cell(cell, number);
            }
            if role == Role::Nanoseconds {
                nanoseconds = Some(number);
            }
            cells.numbers.push(number);
        }
        if let Some(nanoseconds) = nanoseconds {
            cells.stamp = cells.stamp.with_nanoseconds(nanoseconds);
        }
        Ok(())
    }
}

fn open_text(
    path: &Path,
    list: Option<&ColumnList>,
    format: TextFormat,
    filters: &[RowFilter],
    noticed: &mut Noticed,
) -> Result<(Header, Lines)> {
    let (head, file) = head::open(path, HEAD)?;
    let lines = head::lines(&head, HEAD);
    let format = LineFormat::of(&lines, format);
    let (labelled, rows) = match format.separator {
        Separator::Labels => {
            let (samples, rows) = labelled(path, &lines)?;
            (Some(samples), rows)
        }
        _ => (None, Vec::new()),
    };
    let lines: Vec<&[u8]> = match labelled.is_none() {
        true => lines,
        false => rows.iter().map(Vec::as_slice).collect(),
    };
    let (header, first_row) = Header::find(path, &lines, (list, format), filters, noticed)?;
    let lines = Lines::new(path, format, labelled, (head, file), first_row)?;
    Ok((header, lines))
}

/// What puts rows of labelled `lines` together, and the lines with each row in the place of its first line.
fn labelled(path: &Path, lines: &[&[u8]]) -> Result<(Samples, Vec<Vec<u8>>)> {
    let found = Samples::find(lines).ok_or_else(|| {
        let problem = "no labels come again from line to line";
        let remedy = "give the character that separates its cells";
        Error::new(path.display(), problem, remedy).about(Argument::Separator)
    })?;
    let all = found.clone().all(lines);
    let first = all.first().map_or(0, |(number, _)| *number as usize);
    let mut rows: Vec<Vec<u8>> = lines[..first].iter().map(|line| line.to_vec()).collect();
    rows.resize(lines.len(), Vec::new());
    for (number, sample) in all {
        rows[number as usize] = sample.join(",").into_bytes();
    }
    Ok((found, rows))
}
