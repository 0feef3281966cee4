//! Finds the calibrations of a tree, and reads them: calibration files, and Parquet tables with one in each row.

use std::path::{Path, PathBuf};

use jiff::civil::Date;
use mimu::data_sheet::{DataSheet, Part, Row};
use mimu::{Calibration, Error};
use mimu_recording::{UNNAMED, text_columns};
use rayon::prelude::*;

use crate::labels::{self, DATE, LabelTable, Labels, UNIT, slashes};
use crate::measured::OfCalibration;

/// One calibration of a unit.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// Path from the root of the tree; of a table's row, its label.
    pub file: String,
    /// Unit: its label, else the number in the file, else its name there, else the name of the file.
    pub unit: String,
    /// Labels, without the unit.
    pub labels: Labels,
    /// Day of the label `date`, else of the file's creation.
    pub day: Option<Date>,
    /// Parameters.
    pub of: OfCalibration,
    /// Properties with limits, if a part is given.
    pub properties: Vec<Row>,
}

/// A file that is left out, and why.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct LeftOut {
    /// Path from the root of the tree.
    pub file: String,
    /// The reason, in words.
    pub reason: String,
}

/// What a tree has.
#[derive(Debug, Default)]
pub struct Tree {
    /// Measurements, in the order of their paths.
    pub measurements: Vec<Measurement>,
    /// Calibrations that cannot be used.
    pub left_out: Vec<LeftOut>,
    /// Number of TOML and Parquet files that are no calibrations.
    pub others: usize,
    /// Measurements without a row in the table of labels.
    pub unlabelled: usize,
}

/// How files are found and labelled.
#[derive(Debug, Clone, Copy)]
pub struct Search<'a> {
    /// Names of folders without `=`, from the outermost.
    pub folders: &'a [String],
    /// Table of labels.
    pub table: Option<&'a LabelTable>,
    /// Part whose limits are compared.
    pub part: Option<&'a Part>,
}

/// Deepest folder: a link to a folder above it has no end.
const DEEPEST: usize = 32;

impl Tree {
    /// Reads all calibrations below the roots. A root may be a file. `progress` receives the share that is done.
    ///
    /// # Errors
    /// A root cannot be read. Faults of files below it are in [`Self::left_out`].
    pub fn read(
        roots: &[PathBuf],
        search: Search,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Self, Error> {
        let mut files = Vec::new();
        let mut tree = Self::default();
        for root in roots {
            match root.is_file() {
                true => files.push((
                    root.clone(),
                    root.file_name().map(PathBuf::from).unwrap_or_default(),
                )),
                false => find(root, root, 0, &mut files, &mut tree.left_out)
                    .map_err(|e| Error::io(root, &e))?,
            }
        }
        let count = files.len();
        let done = std::sync::atomic::AtomicUsize::new(0);
        let read: Vec<Read> = files
            .par_iter()
            .flat_map_iter(|(path, relative)| {
                let read = match is_table(path) {
                    true => read_table(path, relative, search),
                    false => vec![read(path, relative, search)],
                };
                let k = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                if k.is_multiple_of(64) {
                    progress(k as f64 / count as f64);
                }
                read
            })
            .collect();
        for one in read {
            match one {
                Read::Measurement(one, labelled) => {
                    tree.unlabelled += usize::from(!labelled);
                    tree.measurements.push(*one);
                }
                Read::LeftOut(one) => tree.left_out.push(one),
                Read::Other => tree.others += 1,
            }
        }
        Ok(tree)
    }
}

enum Read {
    /// A calibration, and whether the table of labels has it.
    Measurement(Box<Measurement>, bool),
    LeftOut(LeftOut),
    Other,
}

/// Whether it may be a table of results, as `mimu.fit_table` writes it.
fn is_table(path: &Path) -> bool {
    has_ending(path, "parquet")
}

fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Collects `*.toml` and `*.parquet` below `folder` with their paths from `root`. A folder that cannot be read is left out, unless it is the root.
fn find(
    root: &Path,
    folder: &Path,
    depth: usize,
    files: &mut Vec<(PathBuf, PathBuf)>,
    left_out: &mut Vec<LeftOut>,
) -> std::io::Result<()> {
    for path in labels::children(folder)? {
        let relative = path.strip_prefix(root).unwrap_or(&path).to_path_buf();
        if labels::is_hidden(&path) {
            continue;
        }
        if path.is_dir() {
            let within = match depth < DEEPEST {
                true => find(root, &path, depth + 1, files, left_out),
                false => Err(std::io::Error::other(format!(
                    "more than {DEEPEST} folders deep; is a link circular?"
                ))),
            };
            if let Err(error) = within {
                left_out.push(LeftOut {
                    file: slashes(&relative),
                    reason: error.to_string(),
                });
            }
        } else if has_ending(&path, "toml") || is_table(&path) {
            files.push((path, relative));
        }
    }
    Ok(())
}

/// Formats of this program's files that are no calibrations.
fn is_other(text: &str) -> bool {
    let format = text
        .lines()
        .find_map(|line| line.trim_start().strip_prefix("format"));
    let named = format.and_then(|rest| rest.trim_start().strip_prefix('='));
    match named {
        Some(name) => !name
            .trim_start()
            .trim_start_matches(['"', '\''])
            .starts_with("mimu-calibration"),
        // A calibration that was cut off before its format is a fault; another program's TOML is none of ours.
        None => !text.contains("[gyro]") && !text.contains("[accel]"),
    }
}

fn read(path: &Path, relative: &Path, search: Search) -> Read {
    let text = match mimu_recording::read_text(path) {
        Ok(text) => text,
        Err(error) => return left_out(relative, error),
    };
    if is_other(&text) {
        return Read::Other;
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    of_text(&text, relative, &stem, search)
}

/// A row with a calibration file in the column `calibration` is read like that file at the path `label`, so that folders in it are labels.
fn read_table(path: &Path, relative: &Path, search: Search) -> Vec<Read> {
    let folder = relative.parent().unwrap_or(Path::new(""));
    let mut rows = Vec::new();
    let columns = ["label", "error", "calibration"];
    let read = text_columns(path, columns, |[label, error, calibration]| {
        let relative = folder.join(label.trim_start_matches('/'));
        let name = label.rsplit('/').next().unwrap_or_default();
        rows.push(match calibration.is_empty() {
            true => left_out(&relative, error),
            false => of_text(&calibration, &relative, name, search),
        });
    });
    match read {
        Ok(true) => rows,
        Ok(false) => vec![Read::Other],
        Err(error) => vec![left_out(relative, error)],
    }
}

fn left_out(relative: &Path, reason: impl ToString) -> Read {
    Read::LeftOut(LeftOut {
        file: slashes(relative),
        reason: reason.to_string(),
    })
}

/// The calibration of `text`, at the path `relative`. `name` is the unit's, if nothing else names it.
fn of_text(text: &str, relative: &Path, name: &str, search: Search) -> Read {
    let calibration = match Calibration::parse(text, &slashes(relative)) {
        Ok(calibration) => calibration,
        Err(error) => return left_out(relative, error),
    };
    let of = match OfCalibration::of(&calibration) {
        Ok(of) => of,
        Err(reason) => return left_out(relative, reason),
    };
    let mut labels = labels::of_folders(relative, search.folders);
    let in_file = || {
        let number = calibration.unit_id.clone();
        let device =
            Some(calibration.device.clone()).filter(|name| name != UNNAMED && !name.is_empty());
        number.or(device).unwrap_or_else(|| name.to_owned())
    };
    let mut unit = labels.remove(UNIT).unwrap_or_else(in_file);
    let labelled = search
        .table
        .is_none_or(|table| table.add(&mut labels, relative, &unit));
    if let Some(of_table) = labels.remove(UNIT) {
        unit = of_table;
    }
    let created = calibration.created.as_deref().and_then(labels::day);
    let day = labels
        .get(DATE)
        .and_then(|text| labels::day(text))
        .or(created);
    let properties = search
        .part
        .map(|part| DataSheet::of(&calibration, None, part).rows);
    let measurement = Measurement {
        file: slashes(relative),
        unit,
        labels,
        day,
        of,
        properties: properties.unwrap_or_default(),
    };
    Read::Measurement(Box::new(measurement), labelled)
}
