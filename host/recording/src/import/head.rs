//! The first lines of a text file, and how lines are cut into cells. A look at a file and its import begin with this.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::binary::{refuse_binary, without_zeros};
use super::comment_signs::{CommentSigns, TextFormat};
use super::time::calendar_time;
use crate::cell::{self, Refusal};
use crate::error::{Error, Result};
use crate::separator::Separator;

/// UTF-8 byte order mark, which spreadsheets put before the header.
const BOM: &[u8] = b"\xef\xbb\xbf";

/// Kind of a line, as far as it shows without a list of columns.
pub(crate) enum Kind {
    Blank,
    Comment,
    Other,
}

/// How the lines of a file are read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LineFormat {
    pub separator: Separator,
    pub comments: CommentSigns,
}

/// Opens a text file and reads up to `most` bytes of it, without the byte order mark.
pub(crate) fn open(path: &Path, most: u64) -> Result<(Vec<u8>, File)> {
    let io = |error: std::io::Error| Error::io(path, &error);
    let mut file = File::open(path).map_err(io)?;
    let mut head = Vec::new();
    (&mut file).take(most).read_to_end(&mut head).map_err(io)?;
    refuse_binary(path, &head)?;
    if head.starts_with(BOM) {
        head.drain(..BOM.len());
    }
    Ok((head, file))
}

/// The lines of a `head` that was read with at most `most` bytes, without the last one if it may be cut.
pub(crate) fn lines(head: &[u8], most: u64) -> Vec<&[u8]> {
    let whole = match memchr::memrchr(b'\n', head) {
        Some(end) if head.len() as u64 >= most - BOM.len() as u64 => &head[..=end],
        _ => head,
    };
    whole.split(|b| *b == b'\n').map(without_zeros).collect()
}

impl LineFormat {
    /// The given format, with the separator of `lines` if none is given.
    pub fn of(lines: &[&[u8]], given: TextFormat) -> Self {
        let mut format = Self {
            separator: Separator::Comma,
            comments: given.comments,
        };
        format.separator = given.separator.unwrap_or_else(|| {
            let shown = lines.iter().copied();
            let shown = shown.filter(|line| matches!(format.kind(line), Kind::Other));
            Separator::detect(&shown.collect::<Vec<&[u8]>>())
        });
        format
    }

    pub fn kind(self, line: &[u8]) -> Kind {
        match (line.trim_ascii().is_empty(), self.comments.begins(line)) {
            (true, _) => Kind::Blank,
            (false, Some(_)) => Kind::Comment,
            (false, None) => Kind::Other,
        }
    }

    /// Splits a line into cells, without a checksum at its end. What a serial monitor puts before it (`15:04:23.125 -> 1,2,3`) is its first cell.
    pub fn split(self, line: &[u8], cells: &mut csv::ByteRecord) {
        const ARROW: &[u8] = b" -> ";
        let line = match checksum(line) {
            Some((sentence, _)) if !self.separator.separates(b'*') => sentence,
            _ => line,
        };
        let arrow = memchr::memmem::find(line, ARROW);
        let Some(at) = arrow.filter(|at| calendar_time(&line[..*at]).is_some()) else {
            self.separator.split(line, cells);
            return;
        };
        let mut rest = csv::ByteRecord::new();
        self.separator.split(&line[at + ARROW.len()..], &mut rest);
        cells.clear();
        cells.push_field(line[..at].trim_ascii());
        cells.extend(&rest);
    }

    /// Splits a line that may have the names of columns, which many programs write after a #.
    pub fn split_header(self, line: &[u8], cells: &mut csv::ByteRecord) {
        self.separator.split(self.comments.skipped(line), cells);
    }

    /// Number in a cell. If commas do not separate cells, one comma is a decimal point.
    pub fn number(self, cell: &[u8]) -> std::result::Result<f64, Refusal> {
        if !self.separator.separates(b',')
            && !cell.contains(&b'.')
            && let Some(comma) = memchr::memchr(b',', cell)
        {
            let mut point = cell.to_vec();
            point[comma] = b'.';
            return cell::number(&point).map_err(|_| cell::no_number(cell));
        }
        cell::number(cell)
    }

    /// Whether more of the cells are numbers than are not.
    pub fn mostly_numbers<'a>(self, cells: impl Iterator<Item = &'a [u8]>) -> bool {
        let (mut right, mut wrong) = (0, 0);
        for cell in cells {
            match self.number(cell) {
                Ok(value) => right += usize::from(!value.is_nan()),
                Err(_) => wrong += 1,
            }
        }
        right > wrong
    }
}

/// A line without its checksum in the manner of NMEA, `$VNYMR,1,2*5F`, and whether that is right: the exclusive or of what is between $ and *.
pub(crate) fn checksum(line: &[u8]) -> Option<(&[u8], bool)> {
    let (sentence, sum) = line.trim_ascii().split_last_chunk::<3>()?;
    let digits = std::str::from_utf8(sum).ok()?.strip_prefix('*')?;
    let sum = u8::from_str_radix(digits, 16).ok()?;
    let bytes = sentence.strip_prefix(b"$")?;
    Some((
        sentence,
        bytes.iter().fold(0, |all, byte| all ^ byte) == sum,
    ))
}

/// The cells of a header.
pub(crate) fn texts(record: &csv::ByteRecord) -> Vec<String> {
    let text = |cell: &[u8]| String::from_utf8_lossy(cell).trim().to_owned();
    record.iter().map(text).collect()
}
