//! Tables of means: one row for each pose or rate instead of its samples.

use std::path::{Path, PathBuf};

use super::assignment::Role;
use super::broken::Unreadable;
use super::log::is_log;
use super::log_options::LogOptions;
use super::options::{ImportOptions, source};
use super::source::HowToRead;
use super::table::{Cells, Table, is_parquet};
use super::{ImportSummary, SkippedLines};
use crate::columns::{Column, Columns, Layout};
use crate::declared::Reference;
use crate::digest;
use crate::error::{Argument, Error, Result};
use crate::health::impossible_temperature;
use crate::manifest::{MANIFEST_FILE, Manifest};
use crate::separator::Separator;
use crate::staging::Staging;
use crate::triads::Triads;

/// File of the means in a recording's directory, beside its manifest.
pub const MEANS_FILE: &str = "means.csv";

/// Largest number of averaged samples. Nobody averages more, and a double counts exactly up to here.
const MOST_AVERAGED: f64 = 1e15;

/// The means of one pose, or of one step of a rate table.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseMean {
    /// Its label in the table; empty if it has none.
    pub label: String,
    /// Mean readings: gyro x, y, z, accelerometer x, y, z, in the raw unit. NaN if there is none.
    pub raw: [f64; 6],
    /// Standard deviations of one sample, raw units; NaN if unknown.
    pub deviation: [f64; 6],
    /// Samples averaged; `None` if unknown.
    pub averaged: [Option<u64>; 6],
    /// Known input: rates (deg/s), specific forces (m/s²). NaN if unknown.
    pub reference: [f64; 6],
    /// Temperature, °C, or NaN.
    pub temp_c: f64,
}

/// A table of means with its manifest.
#[derive(Debug, Clone)]
pub struct PoseMeans {
    /// The manifest; its sample rate is NaN if unknown.
    pub manifest: Manifest,
    /// Where it is, for messages.
    pub place: String,
    /// SHA-256 of the file of the means, hexadecimal.
    pub sha256: String,
    /// In the order of the table.
    pub poses: Vec<PoseMean>,
    /// Which readings and inputs it has.
    pub columns: Columns,
}

impl PoseMeans {
    /// The file of the means of `directory`, if it is a recording of means.
    pub fn file(directory: &Path) -> Option<PathBuf> {
        let path = directory.join(MEANS_FILE);
        path.is_file().then_some(path)
    }

    /// Reads the recording of means at `directory`.
    pub fn open(directory: &Path) -> Result<PoseMeans> {
        let mut manifest = Manifest::read(&directory.join(MANIFEST_FILE))?;
        if !manifest.means {
            return Err(Error::new(
                directory.join(MANIFEST_FILE).display(),
                format!("it contains {MEANS_FILE}, but the key means is not true"),
                "import the table again",
            ));
        }
        let path = directory.join(MEANS_FILE);
        let log = LogOptions {
            separator: Some(Separator::Comma),
            ..LogOptions::default()
        };
        let table = Means::read(&path, &HowToRead::of(&log))?;
        if table.poses.iter().any(|pose| !pose.label.is_empty()) {
            manifest.step_labels = table.poses.iter().map(|p| p.label.clone()).collect();
        }
        Ok(PoseMeans {
            manifest,
            place: path.display().to_string(),
            sha256: digest::sha256(&path)?,
            poses: table.poses,
            columns: table.columns,
        })
    }
}

/// A table as it was read.
struct Means {
    poses: Vec<PoseMean>,
    columns: Columns,
    skipped: SkippedLines,
    warnings: Vec<String>,
}

impl Means {
    fn read(path: &Path, how: &HowToRead<'_>) -> Result<Means> {
        let refuse = |problem: String, remedy: &str| {
            Err(Error::new(path.display(), problem, remedy).about(Argument::Columns))
        };
        let mut table = Table::open(path, how.list, how.log.text_format(), &[])?;
        let roles = table.header.roles();
        let has = |role: Role| roles.contains(&role);
        let timed = [Role::Column(Column::Time), Role::Sample];
        if let Some(role) = timed.into_iter().find(|role| has(*role)) {
            return refuse(
                format!(
                    "the table has the column {}, but means have no time",
                    role.name()
                ),
                "skip the column, or import the rows as samples",
            );
        }
        for c in 0..6 {
            let counted = has(Role::Averaged(None)) || has(Role::Averaged(Some(c)));
            if has(Role::Deviation(c)) && !counted {
                return refuse(
                    format!(
                        "the table has the column {}, but not the number of samples",
                        Role::Deviation(c).name()
                    ),
                    "add the column averaged; write 1 if the deviations are those of the means themselves",
                );
            }
        }
        // The same rules as for a recording's header, except for the time.
        let names = roles.iter().filter_map(|role| match role {
            Role::Column(column) => Some(column.name()),
            _ => None,
        });
        let names: Vec<&str> = [Column::Time.name()].into_iter().chain(names).collect();
        let mut columns = Layout::from_names(&names, &path.display().to_string())?.columns;
        let further: Vec<String> = columns.more.iter().map(|t| t.to_string()).collect();
        columns.more = Triads::default();
        let mut cells = Cells::default();
        let mut poses = Vec::new();
        while let Some(row) = table.next(&mut cells).map_err(Unreadable::into_error)? {
            let place = table.header.place(row);
            poses.push(pose(how, &roles, &cells, &columns, &place)?);
        }
        let mut warnings = table.noticed.warnings;
        if !further.is_empty() {
            warnings.push(format!(
                "{}: {} left out: a table of means has one gyro and one accelerometer",
                path.display(),
                further.join(", ")
            ));
        }
        Ok(Means {
            poses,
            columns,
            skipped: table.noticed.skipped,
            warnings,
        })
    }
}

fn pose(
    how: &HowToRead<'_>,
    roles: &[Role],
    cells: &Cells,
    columns: &Columns,
    place: &str,
) -> Result<PoseMean> {
    let mut pose = PoseMean {
        label: String::from_utf8_lossy(&cells.step).trim().to_owned(),
        raw: [f64::NAN; 6],
        deviation: [f64::NAN; 6],
        averaged: [None; 6],
        reference: [f64::NAN; 6],
        temp_c: f64::NAN,
    };
    let refusal = |role: Role, problem: String, remedy: &str| {
        Error::new(format!("{place}, column {}", role.name()), problem, remedy)
    };
    let refuse = |role, problem, remedy| Err(refusal(role, problem, remedy));
    for (&role, &number) in roles.iter().zip(&cells.numbers) {
        let reading = |column| {
            let reading = how.conversion(column).reading(number);
            reading.map_err(|refused| refusal(role, refused.problem, refused.remedy))
        };
        match role {
            Role::Column(column @ Column::Raw(c)) => pose.raw[c] = reading(column)?,
            Role::Column(column @ Column::Reference(c)) => pose.reference[c] = reading(column)?,
            Role::Column(column @ Column::Temperature) => {
                pose.temp_c = reading(column)?;
                if let Some(found) = impossible_temperature(pose.temp_c, None) {
                    return Err(found.refusal(place));
                }
            }
            Role::Deviation(_) if number < 0.0 => {
                let remedy = "a standard deviation is 0 or more; correct the cell";
                return refuse(role, format!("{number} is negative"), remedy);
            }
            Role::Deviation(c) => {
                pose.deviation[c] = (number * how.conversion(Column::Raw(c)).factor).abs();
            }
            Role::Averaged(_) if number.is_nan() => {}
            Role::Averaged(which) => {
                if number.fract() != 0.0 || !(1.0..=MOST_AVERAGED).contains(&number) {
                    let problem = format!("{number} is not a number of samples");
                    return refuse(role, problem, "write a whole number from 1");
                }
                // A count for the channel overrides the count of the row.
                let own = |c: usize| roles.contains(&Role::Averaged(Some(c)));
                let holds = |c: &usize| which == Some(*c) || which.is_none() && !own(*c);
                for c in (0..6).filter(holds) {
                    pose.averaged[c] = Some(number as u64);
                }
            }
            Role::Column(_) | Role::Sample | Role::Nanoseconds => {}
        }
    }
    for c in (0..6).filter(|&c| columns.has(Column::Raw(c)) && !pose.raw[c].is_nan()) {
        let counts = [Role::Averaged(Some(c)), Role::Averaged(None)];
        let counted = counts.into_iter().find(|role| roles.contains(role));
        let missing = match (roles.contains(&Role::Deviation(c)), counted) {
            (true, _) if pose.deviation[c].is_nan() => Some(Role::Deviation(c)),
            (_, Some(role)) if pose.averaged[c].is_none() => Some(role),
            _ => None,
        };
        if let Some(role) = missing {
            let problem = format!("it is empty, but {} is not", Column::Raw(c).name());
            return refuse(role, problem, "fill the cell in, or skip the column");
        }
    }
    Ok(pose)
}

/// Imports a table of means as a recording of means at `out`.
pub(super) fn import_means(options: &ImportOptions, out: &Path) -> Result<ImportSummary> {
    let path = &options.files[0];
    let refuse = |problem: &str, remedy: &str| Err(Error::new(path.display(), problem, remedy));
    if options.files.len() > 1 {
        return refuse(
            "several files of means are given",
            "put them into one table",
        );
    }
    if options.log.inputs.is_some() {
        let remedy = "write the known inputs into the table: ref_rate_x_dps, ref_force_x_mps2 and the others";
        return refuse(
            "a table of inputs is given in addition to a table of means",
            remedy,
        );
    }
    if is_log(path) || is_parquet(path) {
        return refuse("a table of means is read from text", "write it as CSV");
    }
    let table = Means::read(path, &options.how(0))?;
    if options.reference == Reference::Table && table.columns.reference == [false; 6] {
        return Err(Error::new(
            path.display(),
            "reference is \"table\", but no column is a ref_ column",
            "add the ref_ columns, or set the reference to gravity",
        )
        .about(Argument::Reference));
    }
    let mut manifest = Manifest::new(
        options.unit(),
        options.log.rate_hz.unwrap_or(f64::NAN),
        options.gravity_mps2,
        options.raw_unit,
        options.reference,
    );
    manifest.means = true;
    manifest.latitude_deg = options.log.latitude_deg;
    manifest.imported_with = options.arguments();
    manifest.sources.push(source(path)?);
    manifest.check("import")?;
    let staging = Staging::create(out, options.replace)?;
    staging.write_file(MEANS_FILE, &to_csv(&table))?;
    staging.write_file(MANIFEST_FILE, manifest.to_toml()?.as_bytes())?;
    staging.publish()?;
    let raw = (0..6).filter(|&c| table.columns.has(Column::Raw(c)));
    let empty = |c: usize| table.poses.iter().filter(move |pose| pose.raw[c].is_nan());
    let mut warnings = options.preset_warnings.clone();
    warnings.extend(table.warnings);
    Ok(ImportSummary {
        format: "mimu-import/1",
        recording: out.display().to_string(),
        rows: table.poses.len() as u64,
        means: true,
        preset: options.preset.clone(),
        sample_rate_hz: manifest.sample_rate_hz,
        skipped: table.skipped,
        empty_cells: raw.map(|c| empty(c).count() as u64).sum(),
        warnings,
        ..ImportSummary::default()
    })
}

/// The table as CSV, with the units and column names of a recording. Labels come last, because a line that begins with # is a comment.
fn to_csv(table: &Means) -> Vec<u8> {
    let poses = &table.poses;
    let columns = &table.columns;
    let number = |value: f64| match value.is_nan() {
        true => String::new(),
        false => format!("{value:?}"),
    };
    let mut written: Vec<(String, Vec<String>)> = Vec::new();
    let mut add = |role: Role, cell: &dyn Fn(&PoseMean) -> String| {
        written.push((role.name().to_owned(), poses.iter().map(cell).collect()));
    };
    for column in columns
        .present()
        .filter(|c| !matches!(c, Column::Time | Column::Step))
    {
        add(Role::Column(column), &|pose| match column {
            Column::Raw(c) => number(pose.raw[c]),
            Column::Reference(c) => number(pose.reference[c]),
            _ => number(pose.temp_c),
        });
        let Column::Raw(c) = column else { continue };
        if poses.iter().any(|pose| !pose.deviation[c].is_nan()) {
            add(Role::Deviation(c), &|pose| number(pose.deviation[c]));
        }
        if poses.iter().any(|pose| pose.averaged[c].is_some()) {
            let count = |n: u64| n.to_string();
            add(Role::Averaged(Some(c)), &|pose| {
                pose.averaged[c].map_or_else(String::new, count)
            });
        }
    }
    if columns.step {
        add(Role::Column(Column::Step), &|pose| pose.label.clone());
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    // Writing into memory cannot fail.
    let _ = writer.write_record(written.iter().map(|(name, _)| name));
    for row in 0..poses.len() {
        let _ = writer.write_record(written.iter().map(|(_, cells)| &cells[row]));
    }
    writer.into_inner().unwrap_or_default()
}
