//! The beginning of a foreign file, shown to a person who names its columns.

use std::path::Path;

use serde::Serialize;

use super::head::{self, Kind, LineFormat};
use super::labelled::{Line, Samples, UNITS};
use super::log::is_log;
use super::table::is_parquet;
use crate::error::{Error, Result};
use crate::separator::Separator;

/// Bytes that are read at the start for each row: a longer row is rare.
const ROW: u64 = 512;

/// Rows by which cells with a label and a number are found.
const JUDGED: usize = 100;

/// The beginning of a foreign file.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Preview {
    /// Whether it is a log, whose columns are fixed; the other fields are then empty.
    pub log: bool,
    /// Names of the columns; empty if no line has them.
    pub names: Vec<String>,
    /// Units in a line of their own below the names; empty if there is none.
    pub units: Vec<String>,
    /// Samples a second, if a line above the rows says it: `// Sample rate: 50.0Hz`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// The separator, if it is one that an import does not recognise: labels among the numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub separator: Option<Separator>,
    /// The first rows, cell by cell, as they are written.
    pub rows: Vec<Vec<String>>,
}

/// Looks at the first `most` rows of a file; `separator` as in an import.
///
/// # Errors
/// The file cannot be read, is of another kind, or has no line of numbers.
pub fn preview(path: &Path, separator: Option<Separator>, most: usize) -> Result<Preview> {
    if is_log(path) {
        return Ok(Preview {
            log: true,
            ..Preview::default()
        });
    }
    if is_parquet(path) {
        return of_parquet(path, most);
    }
    let enough = (1 << 16) + ROW * most as u64;
    let (head, _) = head::open(path, enough)?;
    let lines = head::lines(&head, enough);
    let found = table_or_labelled(&lines, separator, most);
    found.ok_or_else(|| {
        let problem = "no line is a row of numbers";
        let remedy =
            "give a text file with one sample a line, Parquet, or a log with its usual ending";
        Error::new(path.display(), problem, remedy)
    })
}

#[cfg(not(feature = "parquet"))]
fn of_parquet(path: &Path, _: usize) -> Result<Preview> {
    Err(crate::writer::without_parquet(path))
}

#[cfg(feature = "parquet")]
fn of_parquet(path: &Path, most: usize) -> Result<Preview> {
    let (names, rows) = super::parquet_rows::first_rows(path, most)?;
    Ok(Preview {
        names,
        rows,
        ..Preview::default()
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
    match separator {
        Some(Separator::Labels) => labelled(lines, most),
        Some(_) => table,
        None if table.as_ref().is_some_and(is_table) => table,
        None => {
            // Without names, labels are as good as words in cells of their own, but not with a number in the same cell.
            let glued =
                |cell: &String| Line::parse(cell).is_some_and(|line| !line.labels().is_empty());
            let table = table.filter(|table| !table.rows.iter().take(JUDGED).flatten().any(glued));
            let found = labelled(lines, most);
            let named = found.as_ref().is_some_and(|found| !found.names.is_empty());
            if named { found } else { table.or(found) }
        }
    }
}

/// Whether a label and more stand in the cell, as in `acc: 1`. A time of day does not begin with a letter.
fn begins_with_label(cell: &str) -> bool {
    let cell = cell.trim();
    let part = |c: char| c.is_alphanumeric() || "/_. ()".contains(c);
    let rest = cell.trim_start_matches(part);
    cell.starts_with(char::is_alphabetic) && rest.starts_with([':', '='])
}

fn of_lines(lines: &[&[u8]], separator: Option<Separator>, most: usize) -> Option<Preview> {
    let format = LineFormat::of(lines, separator.into());
    let cells = |line: &[u8]| {
        let mut record = csv::ByteRecord::new();
        format.split(line, &mut record);
        let text = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
        record.iter().map(text).collect::<Vec<String>>()
    };
    let number = |cell: &&String| format.number(cell.as_bytes()).is_ok_and(f64::is_finite);
    let numbers = |row: &[String]| row.iter().filter(number).count();
    let is_row = |line: &&[u8]| {
        let row = cells(line);
        matches!(format.kind(line), Kind::Other) && row.len() > 1 && 2 * numbers(&row) > row.len()
    };
    let first = lines.iter().position(is_row)?;
    let row = cells(lines[first]);
    // A separator may end the rows and not the names.
    let ends = row.last().is_some_and(|last| last.trim().is_empty());
    let is_header = |names: &Vec<String>| {
        numbers(names) == 0 && (names.len() == row.len() || ends && names.len() + 1 == row.len())
    };
    let above = lines[..first]
        .iter()
        .rev()
        .map(|line| cells(format.comments.skipped(line)));
    let mut headers = above.filter(is_header);
    let nearest = headers.next().unwrap_or_default();
    let (mut names, units) = match headers.next() {
        Some(names) if is_units(&nearest) => (names, nearest),
        _ => (nearest, Vec::new()),
    };
    let fixed = fixed_fields(&row);
    let known = fixed.is_some();
    if let Some(fields) = fixed {
        names = fields.split(',').map(str::to_owned).collect();
    }
    let rows = lines[first..].iter().filter(|line| is_row(line));
    Some(Preview {
        names,
        units,
        rate_hz: lines[..first].iter().find_map(|line| stated_rate(line)),
        rows: rows.take(most).map(|line| cells(line)).collect(),
        separator: known.then_some(format.separator),
        ..Preview::default()
    })
}

/// Fields of messages that have no header, by what a line begins with: those of VectorNav's units by the manual of the VN-100 (asynchronous output,
/// ASCII).
const SENTENCES: [(&str, &str); 4] = [
    (
        "$VNYMR",
        "-,yaw,pitch,roll,mag_x [gauss],mag_y [gauss],mag_z [gauss],accel_x [m/s²],accel_y [m/s²],accel_z [m/s²],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]",
    ),
    (
        "$VNQMR",
        "-,qx,qy,qz,qw,mag_x [gauss],mag_y [gauss],mag_z [gauss],accel_x [m/s²],accel_y [m/s²],accel_z [m/s²],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]",
    ),
    (
        "$VNMAR",
        "-,mag_x [gauss],mag_y [gauss],mag_z [gauss],accel_x [m/s²],accel_y [m/s²],accel_z [m/s²],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]",
    ),
    (
        "$VNIMU",
        "-,mag_x [gauss],mag_y [gauss],mag_z [gauss],accel_x [m/s²],accel_y [m/s²],accel_z [m/s²],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],temp_c,pressure",
    ),
];
/// Names of the cells of a row of a format without a header.
fn fixed_fields(row: &[String]) -> Option<&'static str> {
    let sentence = SENTENCES.iter().find(|(sentence, _)| *sentence == row[0]);
    sentence.map(|(_, fields)| *fields)
}

/// Samples a second that a line says, behind the word rate: `data_rate = 2000.0 Hz`.
fn stated_rate(line: &[u8]) -> Option<f64> {
    let line = String::from_utf8_lossy(line).to_lowercase();
    let (_, behind) = line.split_once("rate")?;
    let (number, _) = behind.split_once("hz")?;
    let number = number.trim_start_matches(|c: char| !c.is_ascii_digit());
    number.trim_end().parse().ok()
}

/// Whether a line of words is one of units, below the names: brackets and short words, some of which may be unknown.
fn is_units(row: &[String]) -> bool {
    let unit = |cell: &&String| {
        let cell = cell.trim();
        let bracketed = cell.starts_with(['(', '[']) && cell.ends_with([')', ']']);
        bracketed || UNITS.contains(&cell) || ["-", ""].contains(&cell)
    };
    let filled = row.iter().filter(|cell| !cell.trim().is_empty());
    let known = filled.clone().filter(unit).count();
    known > 0 && 2 * known >= filled.clone().count() && filled.count() * 2 >= row.len()
}

/// Lines of labels, the same in all samples, and numbers.
fn labelled(lines: &[&[u8]], most: usize) -> Option<Preview> {
    let samples = Samples::find(lines)?;
    let names = match samples.are_named() {
        true => samples.names.clone(),
        false => Vec::new(),
    };
    let all = samples.all(lines).into_iter().map(|(_, sample)| sample);
    Some(Preview {
        names,
        separator: Some(Separator::Labels),
        rows: all.take(most).collect(),
        ..Preview::default()
    })
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
    fn units_below_the_names_may_be_unknown_and_a_line_may_say_the_rate() {
        // As Consensys and an older Xsens program write them.
        let table = of(
            "\"sep=;\"\nTime;LN_X;GSR;Gyro_X;Mag;Cell\nms;m/(s^2);kOhms;deg/s;local_flux;mV;\n1.5;9.8;401.1;0.1;2;4139;\n2;9.8;401;0.2;2;4139;\n",
        );
        assert_eq!(table.names[..2], ["Time", "LN_X"]);
        assert_eq!(table.units[..4], ["ms", "m/(s^2)", "kOhms", "deg/s"]);
        let table =
            of("// Sample rate: 50.0Hz\nCounter\tAcc_X\tGyr_X\n 1\t4.3\t0.1\t\n 2\t4.4\t0.1\t\n");
        assert_eq!(table.names, ["Counter", "Acc_X", "Gyr_X"]);
        assert_eq!(table.rate_hz, Some(50.0));
        for no_rate in ["# rate 1 kHz", "rate,Hz", "# range = 4 g, 50 Hz"] {
            assert_eq!(stated_rate(no_rate.as_bytes()), None, "{no_rate}");
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
