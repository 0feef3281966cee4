//! Labels of a calibration file: unit, operator, fixture, date, batch, or whatever a plant records.
//!
//! A folder called `fixture=B` gives the label `fixture`. Folders with other names get the names that the caller lists, from the outermost inwards. A table in CSV
//! adds columns to the files, or the units, of its first column.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use jiff::civil::Date;
use mimu::Error;

type Result<T> = std::result::Result<T, Error>;

/// Labels by name.
pub type Labels = BTreeMap<String, String>;

/// The label that names the unit.
pub const UNIT: &str = "unit";
/// The label that has the day.
pub const DATE: &str = "date";

/// Labels of the file at `path`, relative to the root of its tree. `names` are those of the folders without `=`, from the outermost; `-` skips one.
pub fn of_folders(path: &Path, names: &[String]) -> Labels {
    let mut labels = Labels::new();
    let mut names = names.iter();
    let folders = path.parent().into_iter().flat_map(Path::components);
    for folder in folders {
        let folder = folder.as_os_str().to_string_lossy();
        match folder.split_once('=') {
            Some((key, value)) => {
                labels.insert(key.to_lowercase(), value.to_owned());
            }
            None => {
                if let Some(name) = names.next().filter(|name| *name != "-") {
                    labels.insert(name.to_lowercase(), folder.into_owned());
                }
            }
        }
    }
    labels
}

/// A table of labels.
#[derive(Debug, Clone)]
pub struct LabelTable {
    place: String,
    key: String,
    rows: HashMap<String, (u64, Labels)>,
}

/// Names of the first column.
const KEYS: [&str; 2] = ["file", UNIT];

impl LabelTable {
    /// Reads a table in CSV with a header. Its first column is `file` (a path from the root of the tree) or `unit`; the others are labels.
    ///
    /// # Errors
    /// The file cannot be read, has another first column, a row with another number of cells, or names something twice.
    pub fn read(path: &Path) -> Result<Self> {
        let text = mimu_recording::read_text(path)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// As [`Self::read`]; `place` is the path of the file.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        let broken = |error: csv::Error| {
            let row = error.position().map_or(0, csv::Position::line);
            let remedy = "write as many cells in every row as the header has, separated by commas";
            Error::new(format!("{place}, row {row}"), error, remedy)
        };
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let header: Vec<String> = reader
            .headers()
            .map_err(broken)?
            .iter()
            .map(str::to_lowercase)
            .collect();
        let key = header.first().cloned().unwrap_or_default();
        if !KEYS.contains(&key.as_str()) {
            let problem = format!("the first column is {key:?}");
            let remedy = "call it `file` (paths from the folder that is searched) or `unit`";
            return Err(Error::new(format!("{place}, row 1"), problem, remedy));
        }
        let mut rows = HashMap::new();
        for record in reader.records() {
            let record = record.map_err(broken)?;
            let row = record.position().map_or(0, csv::Position::line);
            let cells = header.iter().zip(&record).skip(1);
            let labels: Labels = cells
                .filter(|(_, value)| !value.is_empty())
                .map(|(name, value)| (name.clone(), value.to_owned()))
                .collect();
            let name = record.get(0).unwrap_or_default().to_owned();
            if let Some((before, _)) = rows.insert(name.clone(), (row, labels)) {
                let problem = format!("{key} {name:?} is in row {before} too");
                return Err(Error::new(
                    format!("{place}, row {row}"),
                    problem,
                    "name each once",
                ));
            }
        }
        Ok(Self {
            place: place.to_owned(),
            key,
            rows,
        })
    }

    /// Adds the labels of a file, or of its unit; they replace those of folders. Returns whether the table has it.
    pub fn add(&self, labels: &mut Labels, file: &Path, unit: &str) -> bool {
        let found = match self.key == UNIT {
            true => self.rows.get(unit),
            false => self.rows.get(&slashes(file)),
        };
        labels.extend(found.into_iter().flat_map(|(_, own)| own.clone()));
        found.is_some()
    }

    /// Where it is from.
    pub fn place(&self) -> &str {
        &self.place
    }
}

/// A path with slashes on every system.
pub fn slashes(path: &Path) -> String {
    let parts: Vec<_> = path
        .components()
        .map(|c| c.as_os_str().to_string_lossy())
        .collect();
    parts.join("/")
}

/// The day that a label or a time stamp begins with: `2026-10-31`, `20261031`, or RFC 3339.
pub fn day(text: &str) -> Option<Date> {
    let digits = text.len() >= 8 && text.bytes().take(8).all(|b| b.is_ascii_digit());
    match digits {
        true => Date::strptime("%Y%m%d", &text[..8]).ok(),
        false => text.get(..10)?.parse().ok(),
    }
}

/// Whether a path is in a folder that a program hides.
pub(crate) fn is_hidden(path: &Path) -> bool {
    path.file_name()
        .is_some_and(|name| name.to_string_lossy().starts_with('.'))
}

/// Paths that `root` contains, in order.
pub(crate) fn children(root: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut all: Vec<PathBuf> = std::fs::read_dir(root)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<std::io::Result<_>>()?;
    all.sort();
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_give_labels_by_their_names_or_by_their_place() {
        let names = ["-".to_string(), "Operator".to_string()];
        let labels = of_folders(Path::new("line=B/plant/batch=2026-10/eva/u7.toml"), &names);
        let all: Vec<_> = labels.iter().map(|(k, v)| format!("{k} {v}")).collect();
        assert_eq!(all, ["batch 2026-10", "line B", "operator eva"]);
    }

    #[test]
    fn a_table_adds_labels_and_names_the_row_of_a_fault() {
        let table = LabelTable::parse(
            "file,fixture,day\na/u1.toml,B,\n# a remark\nu2.toml,C,3\n",
            "t.csv",
        )
        .unwrap();
        let mut labels = Labels::new();
        assert!(table.add(&mut labels, Path::new("a/u1.toml"), "u1"));
        assert_eq!(labels.get("fixture").unwrap(), "B");
        assert!(!labels.contains_key("day"));
        assert!(!table.add(&mut labels, Path::new("u9.toml"), "u9"));
        for (text, part) in [
            ("fixture\nB\n", "row 1: the first column is \"fixture\""),
            (
                "unit,fixture\nu1,B\nu1,C\n",
                "row 3: unit \"u1\" is in row 2 too",
            ),
            ("unit,fixture\nu1,B,C\n", "row 2"),
        ] {
            let error = LabelTable::parse(text, "t.csv").unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn days_are_read_from_labels_and_time_stamps() {
        let date = jiff::civil::date(2026, 10, 31);
        for text in ["2026-10-31", "20261031", "2026-10-31T12:00:00Z"] {
            assert_eq!(day(text), Some(date), "{text}");
        }
        assert_eq!(day("yesterday"), None);
        assert_eq!(day("2026-13-31"), None);
    }
}
