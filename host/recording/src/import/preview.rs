//! The beginning of a foreign file, shown to a person who names its columns.

use std::io::Read as _;
use std::path::Path;

use serde::Serialize;

use super::binary::{refuse_binary, without_zeros};
use super::comment_signs::CommentSigns;
use super::log::is_log;
use super::parquet_table;
use super::text_table::split;
use crate::cell;
use crate::csv_file::BOM;
use crate::error::{Error, Result};
use crate::separator::Separator;

/// Bytes that are read at the start for each row: a longer row is rare.
const ROW: u64 = 512;

/// The beginning of a foreign file.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Preview {
    /// Whether it is a log, whose columns are fixed; the other fields are then empty.
    pub log: bool,
    /// Names of the columns; empty if no line has them.
    pub names: Vec<String>,
    /// Units in a line of their own below the names; empty if there is none.
    pub units: Vec<String>,
    /// The separator, if it is not one that an import recognises: that of lines with a label before each number.
    #[serde(skip)]
    pub separator: Option<Separator>,
    /// The first rows, cell by cell, as they are written.
    pub rows: Vec<Vec<String>>,
}

/// Looks at the first `most` rows of a file; `separator` as in an import.
///
/// # Errors
/// The file cannot be read, is of another kind, or has no line of numbers.
pub fn preview(path: &Path, separator: Option<Separator>, most: usize) -> Result<Preview> {
    let ending = path.extension().unwrap_or_default();
    if is_log(path) {
        return Ok(Preview {
            log: true,
            ..Preview::default()
        });
    }
    if ending.eq_ignore_ascii_case("parquet") {
        let (names, rows) = parquet_table::first_rows(path, most)?;
        return Ok(Preview {
            names,
            rows,
            ..Preview::default()
        });
    }
    let io = |error: std::io::Error| Error::io(path, &error);
    let file = std::fs::File::open(path).map_err(io)?;
    let mut head = Vec::new();
    let enough = (1 << 16) + ROW * most as u64;
    file.take(enough).read_to_end(&mut head).map_err(io)?;
    refuse_binary(path, &head)?;
    let head = head.strip_prefix(BOM).unwrap_or(&head);
    let mut lines: Vec<&[u8]> = head.split(|b| *b == b'\n').map(without_zeros).collect();
    // The last one may be cut.
    if head.len() as u64 >= enough - BOM.len() as u64 {
        lines.pop();
    }
    let found = of_lines(&lines, separator, most);
    let found = found.or_else(|| match separator {
        None => labelled(&lines, most),
        Some(_) => None,
    });
    found.ok_or_else(|| {
        let problem = "no line is a row of numbers";
        let remedy =
            "give a text file with one sample a line, Parquet, or a log with its usual ending";
        Error::new(path.display(), problem, remedy)
    })
}

fn of_lines(lines: &[&[u8]], separator: Option<Separator>, most: usize) -> Option<Preview> {
    let signs = CommentSigns::default();
    let comment = |line: &[u8]| signs.begins(line).is_some();
    let shown: Vec<&[u8]> = lines
        .iter()
        .filter(|line| !line.trim_ascii().is_empty() && !comment(line))
        .copied()
        .collect();
    let separator = separator.unwrap_or_else(|| Separator::detect(&shown));
    let cells = |line: &[u8]| {
        let mut record = csv::ByteRecord::new();
        split(separator, line, &mut record);
        let text = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
        record.iter().map(text).collect::<Vec<String>>()
    };
    let number = |cell: &String| {
        let point = match separator.separates(b',') {
            true => cell.clone(),
            false => cell.replacen(',', ".", 1),
        };
        cell::number(point.as_bytes()).is_ok_and(f64::is_finite)
    };
    let numbers = |row: &[String]| row.iter().filter(|cell| number(cell)).count();
    let is_row = |line: &&[u8]| {
        let row = cells(line);
        !comment(line) && row.len() > 1 && 2 * numbers(&row) > row.len()
    };
    let first = lines.iter().position(is_row)?;
    let width = cells(lines[first]).len();
    let above = lines[..first]
        .iter()
        .rev()
        .map(|line| cells(signs.skipped(line)));
    let mut headers = above.filter(|row| row.len() == width && numbers(row) == 0);
    let nearest = headers.next().unwrap_or_default();
    let (names, units) = match headers.next() {
        Some(names) if is_units(&nearest) => (names, nearest),
        _ => (nearest, Vec::new()),
    };
    let rows = lines[first..].iter().filter(|line| is_row(line));
    Some(Preview {
        names,
        units,
        rows: rows.take(most).map(|line| cells(line)).collect(),
        ..Preview::default()
    })
}

/// Whether a line of words is one of units, below the names: short words, or brackets.
fn is_units(row: &[String]) -> bool {
    let unit = |cell: &&String| {
        let cell = cell.trim();
        let bracketed = cell.starts_with(['(', '[']) && cell.ends_with([')', ']']);
        let known = [
            "s", "ms", "us", "µs", "ns", "g", "mg", "m/s^2", "m/s2", "m/s²", "mps2", "deg/s",
            "dps", "°/s", "mdps", "rad/s", "deg", "°C", "C", "degC", "uT", "µT", "Gauss", "gauss",
            "V", "counts", "count", "LSB", "raw", "Pa", "hPa", "-", "",
        ];
        bracketed || known.contains(&cell)
    };
    let filled = row.iter().filter(|cell| !cell.trim().is_empty());
    filled.clone().count() > 0
        && row.iter().all(|cell| unit(&cell))
        && filled.count() * 2 >= row.len()
}

/// Separators of lines with a label before each number: `ax:1,ay:2`, `AcX = 1 | AcY = 2`, `gx: 1 gy: 2`.
const OF_LABELS: [&str; 8] = [":,", ":;", "=,", "=;", "=|", ":|", ": ", "= "];

/// Lines whose cells alternate between a label, the same in all lines, and a number.
fn labelled(lines: &[&[u8]], most: usize) -> Option<Preview> {
    OF_LABELS.iter().find_map(|text| {
        let separator: Separator = text.parse().ok()?;
        let mut record = csv::ByteRecord::new();
        let mut cells = |line: &[u8]| -> Vec<String> {
            separator.split(line.trim_ascii(), &mut record);
            let text = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
            record.iter().map(text).collect()
        };
        let number = |cell: &String| cell::number(cell.as_bytes()).is_ok_and(f64::is_finite);
        let is_row = |row: &[String]| {
            let (pairs, rest) = row.as_chunks::<2>();
            !pairs.is_empty()
                && rest.is_empty()
                && pairs
                    .iter()
                    .all(|[label, value]| !number(label) && number(value))
        };
        let rows: Vec<Vec<String>> = lines
            .iter()
            .map(|line| cells(line))
            .filter(|row| is_row(row))
            .take(most)
            .collect();
        let first = rows.first()?;
        let labels = |row: &[String]| row.iter().step_by(2).cloned().collect::<Vec<String>>();
        let alike = rows
            .iter()
            .filter(|row| labels(row) == labels(first))
            .count();
        // A line of a title, or a cut one, has other labels.
        if rows.len() < 2 || first.len() < 4 || 10 * alike < 9 * rows.len() {
            return None;
        }
        let names = first
            .chunks(2)
            .flat_map(|pair| [String::new(), pair[0].clone()]);
        Some(Preview {
            names: names.collect(),
            separator: Some(separator),
            rows,
            ..Preview::default()
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Preview {
        let lines: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        of_lines(&lines, None, 10).unwrap()
    }

    #[test]
    fn names_stand_in_the_last_line_of_words_above_the_first_row() {
        let preview = of("log of today\nt;wx;ax\n0,01;2;3\n0,02;4;5\n");
        assert_eq!(preview.names, ["t", "wx", "ax"]);
        assert_eq!(preview.rows, [["0,01", "2", "3"], ["0,02", "4", "5"]]);
        assert_eq!(of("# t wx ax\n0 1 2\n1 1 2\n").names, ["t", "wx", "ax"]);
        assert!(of("1\t2\n3\t4\n").names.is_empty());
    }

    #[test]
    fn a_file_without_numbers_is_refused_in_a_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("letter.txt");
        std::fs::write(&path, "Dear Sir,\nyours, faithfully\n").unwrap();
        let line = preview(&path, None, 10).unwrap_err().to_string();
        assert!(
            line.contains("letter.txt: no line is a row of numbers"),
            "{line}"
        );
    }
}
