//! The lines of a text file from its first row on.

use std::fs::File;
use std::io::{BufRead, BufReader, Chain, Cursor, Read};
use std::path::{Path, PathBuf};

use super::binary::without_zeros;
use super::broken::{Fault, Unreadable};
use super::head::{Kind, LineFormat, checksum};
use super::labelled::{Samples, Taken};
use super::noticed::Noticed;
use crate::cell::{Refusal, shorten};
use crate::error::{Error, Result};

/// Longest line in bytes.
pub(crate) const LONGEST_LINE: u64 = 1 << 20;

/// A text file, positioned at its next line.
#[derive(Debug)]
pub(crate) struct Lines {
    path: PathBuf,
    format: LineFormat,
    reader: BufReader<Chain<Cursor<Vec<u8>>, File>>,
    /// Puts the rows together, if labels separate their cells.
    labelled: Option<Samples>,
    line: Vec<u8>,
    number: u64,
    /// Line of the first row.
    first_row: u64,
    bytes: u64,
    length: u64,
}

impl Lines {
    /// The lines of `file`, whose `head` has been read, from line `first_row` on.
    pub fn new(
        path: &Path,
        format: LineFormat,
        labelled: Option<Samples>,
        (head, file): (Vec<u8>, File),
        first_row: u64,
    ) -> Result<Self> {
        let length = file.metadata().map_err(|error| Error::io(path, &error))?;
        Ok(Self {
            path: path.to_owned(),
            format,
            reader: BufReader::with_capacity(1 << 18, Cursor::new(head).chain(file)),
            labelled,
            line: Vec::new(),
            number: 0,
            first_row,
            bytes: 0,
            length: length.len(),
        })
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        self.bytes as f64 / self.length.max(1) as f64
    }

    /// Whether the line has more letters than digits.
    pub fn is_of_letters(&self) -> bool {
        let count = |is: fn(&u8) -> bool| self.line.iter().filter(|byte| is(byte)).count();
        count(u8::is_ascii_alphabetic) > count(u8::is_ascii_digit)
    }

    /// Whether the line ends with a wrong checksum.
    pub fn is_damaged(&self) -> bool {
        checksum(&self.line).is_some_and(|(_, right)| !right)
    }

    /// Splits the next line that is neither blank nor a comment into `cells`, or takes the next row of labelled lines. Returns its number and whether it
    /// is whole, `None` at the end.
    pub fn next(
        &mut self,
        cells: &mut csv::ByteRecord,
        noticed: &mut Noticed,
    ) -> std::result::Result<Option<(u64, bool)>, Unreadable> {
        while let Some(row) = self.next_row(noticed)? {
            self.format.split(&self.line, cells);
            if !cells.iter().all(<[u8]>::is_empty) {
                return Ok(Some(row));
            }
            // Spreadsheets end with rows of nothing but separators.
            noticed.skipped.blank += 1;
        }
        Ok(None)
    }

    /// Puts the next line that is neither blank nor a comment into [`Self::line`]; returns its number and whether it is whole.
    pub fn next_row(
        &mut self,
        noticed: &mut Noticed,
    ) -> std::result::Result<Option<(u64, bool)>, Unreadable> {
        while let Some(row) = self.next_line(noticed)? {
            match self.format.kind(&self.line) {
                Kind::Blank => noticed.skipped.blank += 1,
                Kind::Comment => noticed.skipped.comment += 1,
                Kind::Other => return Ok(Some(row)),
            }
        }
        Ok(None)
    }

    /// The line of the last row.
    pub fn line(&self) -> &[u8] {
        &self.line
    }

    /// Puts the next line, or the next row of labelled lines, into `line`.
    fn next_line(
        &mut self,
        noticed: &mut Noticed,
    ) -> std::result::Result<Option<(u64, bool)>, Unreadable> {
        loop {
            let read = self.read_line(noticed)?;
            let number = self.number;
            let Some(samples) = &mut self.labelled else {
                return Ok(read.map(|ended| (number, ended)));
            };
            let sample = match read {
                None => samples.finish(),
                Some(ended) => match samples.take(number, &self.line) {
                    Taken::Part(before) => before,
                    Taken::Words if self.line.trim_ascii().is_empty() => {
                        noticed.skipped.blank += 1;
                        None
                    }
                    Taken::Words => {
                        noticed.words(number);
                        None
                    }
                    Taken::Damaged => {
                        let fault = if ended {
                            Fault::Width
                        } else {
                            Fault::Truncated
                        };
                        let line = shorten(&self.line);
                        let refusal = Refusal {
                            problem: format!("{line} has other labels than the rows"),
                            remedy: "correct or remove the line",
                        };
                        return Err(Unreadable::row(number, fault, self.place(), refusal));
                    }
                },
            };
            match (sample, read) {
                (Some((number, sample)), _) => {
                    self.line = sample.join(",").into_bytes();
                    return Ok(Some((number, true)));
                }
                (None, None) => return Ok(None),
                (None, Some(_)) => {}
            }
        }
    }

    /// Reads the next line of the file, from the first row on. Returns whether it has an end, or `None` at the end of the file.
    fn read_line(
        &mut self,
        noticed: &mut Noticed,
    ) -> std::result::Result<Option<bool>, Unreadable> {
        loop {
            self.line.clear();
            let read = (&mut self.reader)
                .take(LONGEST_LINE)
                .read_until(b'\n', &mut self.line)
                .map_err(|error| Error::io(&self.path, &error))?;
            if read == 0 {
                return Ok(None);
            }
            self.bytes += read as u64;
            let ended = self.line.pop_if(|last| *last == b'\n').is_some();
            if memchr::memchr(0, &self.line).is_some() {
                noticed.zero_bytes += self.line.iter().filter(|byte| **byte == 0).count() as u64;
                self.line = without_zeros(&self.line).to_vec();
            }
            self.line.pop_if(|last| *last == b'\r');
            // Preallocated space has no line ends.
            if !ended && self.line.is_empty() {
                continue;
            }
            self.number += 1;
            if !ended && read as u64 == LONGEST_LINE {
                let problem = "the line is longer than 1 MiB";
                let remedy = "give a text file with one row a line";
                return Err(Error::new(self.place(), problem, remedy).into());
            }
            // Lines above were counted when the file was opened.
            if self.number >= self.first_row {
                return Ok(Some(ended));
            }
        }
    }

    fn place(&self) -> String {
        format!("{}, row {}", self.path.display(), self.number)
    }
}
