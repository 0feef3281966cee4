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
    let found = table_or_labelled(&lines, separator, most);
    found.ok_or_else(|| {
        let problem = "no line is a row of numbers";
        let remedy =
            "give a text file with one sample a line, Parquet, or a log with its usual ending";
        Error::new(path.display(), problem, remedy)
    })
}

/// Lines with labels can look like a table: `acc: 1,2,3 gyro: 4,5,6` cut at its commas has more numbers than words.
fn table_or_labelled(
    lines: &[&[u8]],
    separator: Option<Separator>,
    most: usize,
) -> Option<Preview> {
    let table = of_lines(lines, separator, most);
    let is_table = |t: &Preview| {
        !t.names.is_empty() || !t.rows.iter().flatten().any(|cell| begins_with_label(cell))
    };
    if separator.is_some() || table.as_ref().is_some_and(is_table) {
        return table;
    }
    labelled(lines, most).or(table)
}

/// Whether a label and more stand in the cell, as in `acc: 1`. A time of day does not begin with a letter.
fn begins_with_label(cell: &str) -> bool {
    let cell = cell.trim();
    let rest = cell.trim_start_matches(char::is_alphanumeric);
    cell.starts_with(char::is_alphabetic) && rest.starts_with([':', '='])
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
        bracketed || UNITS.contains(&cell) || ["-", ""].contains(&cell)
    };
    let filled = row.iter().filter(|cell| !cell.trim().is_empty());
    filled.clone().count() > 0
        && row.iter().all(|cell| unit(&cell))
        && filled.count() * 2 >= row.len()
}

/// Units as they stand alone in a cell.
const UNITS: [&str; 31] = [
    "s", "ms", "us", "µs", "ns", "g", "mg", "m/s^2", "m/s2", "m/s²", "mps2", "deg/s", "dps", "°/s",
    "mdps", "rad/s", "deg", "°C", "C", "degC", "uT", "µT", "Gauss", "gauss", "V", "counts",
    "count", "LSB", "raw", "Pa", "hPa",
];

/// Separators of lines with labels among the numbers: `ax:1,ay:2`, `AcX = 1 | AcY = 2`, `gx: 1 gy: 2`, `ACC: X=1,Y=2,Z=3`. Those that leave the
/// fewest empty cells come first.
const OF_LABELS: [&str; 13] = [
    ":,", ":;", "=,", "=;", "=|", ":|", ": ", "= ", ":=,", ":, ", "=, ", ":=, ", ":=,; |",
];

/// Lines of labels, the same in all lines, and numbers.
fn labelled(lines: &[&[u8]], most: usize) -> Option<Preview> {
    OF_LABELS.iter().find_map(|text| {
        let separator: Separator = text.parse().ok()?;
        let mut record = csv::ByteRecord::new();
        let mut cells = |line: &[u8]| -> Vec<String> {
            separator.split(line.trim_ascii(), &mut record);
            let text = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
            record.iter().map(text).collect()
        };
        let rows: Vec<Vec<String>> = lines
            .iter()
            .map(|line| cells(line))
            .filter(|row| names_between(row).is_some())
            .take(most)
            .collect();
        let names = names_between(rows.first()?)?;
        let alike = rows
            .iter()
            .filter(|row| names_between(row).as_ref() == Some(&names))
            .count();
        // A line of a title, or a cut one, has other labels.
        if rows.len() < 2 || 10 * alike < 9 * rows.len() {
            return None;
        }
        Some(Preview {
            names,
            separator: Some(separator),
            rows,
            ..Preview::default()
        })
    })
}

/// A number of a line, and what stands around it.
struct Labelled<'a> {
    cell: usize,
    /// The labels since the number before.
    labels: Vec<&'a str>,
    /// The unit behind it.
    unit: Option<&'a str>,
}

/// The names of the cells of a line of labels and numbers: that of a number consists of the labels before it, that of a label is empty. A label
/// before several axes, as in `ACC: X=1,Y=2,Z=3`, or before three numbers, as in `acc 1 2 3`, belongs to each of them; a unit behind a
/// number belongs to it. `None` for fewer than two numbers, and if labels do not tell them apart.
fn names_between(row: &[String]) -> Option<Vec<String>> {
    let is_axis = |label: &str| ["x", "y", "z"].contains(&label.to_lowercase().as_str());
    let mut numbers: Vec<Labelled> = Vec::new();
    let mut labels: Vec<&str> = Vec::new();
    let is_number = |text: &str| cell::number(text.as_bytes()).is_ok_and(f64::is_finite);
    for (cell, text) in row.iter().enumerate() {
        // Another separator cuts these.
        let several = text.contains([',', ';', '|']) || text.split([' ', ':', '=']).any(is_number);
        if !is_number(text) && several {
            return None;
        }
        if is_number(text) {
            numbers.push(Labelled {
                cell,
                labels: std::mem::take(&mut labels),
                unit: None,
            });
            continue;
        }
        match numbers.last_mut() {
            Some(number) if labels.is_empty() && UNITS.contains(&text.as_str()) => {
                number.unit = Some(text);
            }
            _ if text.is_empty() => {}
            // `ACC: X` behind a separator that is not the colon.
            _ => match text.rsplit_once([':', ' ']) {
                Some((of, axis)) if is_axis(axis) => {
                    labels.extend([of.trim_end_matches([':', ' ']), axis]);
                }
                _ => labels.push(text),
            },
        }
    }
    if numbers.len() < 2 || numbers[0].labels.is_empty() || !labels.is_empty() {
        return None;
    }
    let mut names = vec![String::new(); row.len()];
    let mut group = String::new();
    // A number with labels, and those without any behind it.
    for run in numbers.chunk_by(|_, next| next.labels.is_empty()) {
        let (last, of) = run[0].labels.split_last()?;
        let each: Vec<String> = match run.len() {
            1 if of.is_empty() && is_axis(last) => vec![format!("{group} {last}")],
            1 => {
                group = of.join(" ");
                vec![run[0].labels.join(" ")]
            }
            3 => ["x", "y", "z"]
                .map(|axis| format!("{} {axis}", run[0].labels.join(" ")))
                .to_vec(),
            _ => return None,
        };
        for (number, name) in run.iter().zip(each) {
            let unit = number.unit.map(|unit| format!(" [{unit}]"));
            names[number.cell] = name.trim().to_owned() + &unit.unwrap_or_default();
        }
    }
    Some(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Preview {
        let lines: Vec<&[u8]> = text.lines().map(str::as_bytes).collect();
        table_or_labelled(&lines, None, 10).unwrap()
    }

    #[test]
    fn labels_before_three_numbers_are_no_cells_of_a_table() {
        let line = "t: 0.1 acc: 1,2,3 gyro: 4,5,6";
        let names = of(&[line; 3].join("\n")).names;
        let named: Vec<&String> = names.iter().filter(|n| !n.is_empty()).collect();
        assert_eq!(
            named,
            ["t", "acc x", "acc y", "acc z", "gyro x", "gyro y", "gyro z"]
        );
        // A state and a time of day in a table.
        let table = of("T:ok,12:30:01,1,2,3,4\nT:ok,12:30:02,1,2,3,4\n");
        assert_eq!(table.rows[0].len(), 6);
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
    fn labels_among_the_numbers_are_their_names() {
        for (line, names) in [
            ("t:1,ax:2,ay:-3", "t|ax|ay"),
            ("AcX = 1 | AcY = 2", "AcX|AcY"),
            (
                "GYRO: X=1.5,Y=-2,Z=3,ACC: X=4,Y=5,Z=6",
                "GYRO X|GYRO Y|GYRO Z|ACC X|ACC Y|ACC Z",
            ),
            (
                "Gyro: 1, 2, 3 Accel: 4, 5, 6",
                "Gyro x|Gyro y|Gyro z|Accel x|Accel y|Accel z",
            ),
            ("ax: 1.0 m/s^2, ay: 2.0 m/s^2", "ax [m/s^2]|ay [m/s^2]"),
            ("t=12 gyro x=1 y=2 z=3", "t|gyro x|gyro y|gyro z"),
        ] {
            let lines = [line.as_bytes(); 3];
            let preview = labelled(&lines, 10).expect(line);
            let named: Vec<String> = preview
                .names
                .into_iter()
                .filter(|n| !n.is_empty())
                .collect();
            assert_eq!(named.join("|"), names, "{line}");
        }
        for line in ["a:1,2", "1:a,2:b", "hello", "v: 1 2 3 4"] {
            assert!(labelled(&[line.as_bytes(); 3], 10).is_none(), "{line}");
        }
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
