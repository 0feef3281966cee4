//! Logs of cameras and gyro loggers for Gyroflow (`.gcsv`).
//!
//! Text in cells: a first line with the format's name, lines `key,value`, the names of the columns (`t,gx,gy,gz,ax,ay,az`), then the rows. The header
//! has the units: `t tscale` is in s (0.001 without it), `g gscale` in rad/s, `a ascale` in g, `m mscale` of a magnetometer in gauss. Axes are those of
//! the logger's sensor; `orientation` says how Gyroflow turns them into the camera's, and is left to Gyroflow.
//!
//! Source: docs.gyroflow.xyz, "gcsv format" 1.3; telemetry-parser 0.2.6, src/gyroflow/mod.rs, which reads the same names and defaults.

use std::collections::BTreeMap;
use std::path::Path;

use super::assignment::{ColumnList, Role};
use super::broken::{BrokenRow, Unreadable};
use super::decimal::Decimal;
use super::head;
use super::header::HEAD;
use super::readings::{Choice, LogFormat, Readings};
use super::table::{Cells, Table};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::separator::Separator;
use crate::triad_name::TriadName;
use crate::units::STANDARD_GRAVITY;

/// First lines of the format, the second without a maker's name.
const TITLES: [&str; 2] = ["GYROFLOW IMU LOG", "CAMERA IMU LOG"];
/// Factor of the stamps where the header has none, s.
const TSCALE: f64 = 1e-3;
/// Gauss in µT.
const GAUSS_UT: f64 = 100.0;
/// Columns after the time. The accelerometer or the magnetometer may be missing.
const NAMES: [&str; 9] = ["gx", "gy", "gz", "ax", "ay", "az", "mx", "my", "mz"];

/// Logs of Gyroflow.
pub(super) const GCSV: LogFormat = LogFormat {
    name: "Gyroflow",
    ending: "gcsv",
    unit: Decimal::Microsecond,
    read,
};

/// Reads a log.
fn read(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    if !choice.topics.is_empty() || choice.instance.is_some() {
        let problem = "a log of Gyroflow has one sensor and no topics";
        return Err(Error::new(path.display(), problem, "leave the choice out")
            .about(Argument::Topic)
            .about(Argument::Instance));
    }
    let header = Header::read(path)?;
    let (tscale, triads) = (header.number("tscale")?.unwrap_or(TSCALE), header.triads()?);
    let named = |(triad, _): &(TriadName, f64)| [0, 1, 2].map(|axis| Column::of(*triad, axis));
    let columns = [Column::Time]
        .into_iter()
        .chain(triads.iter().flat_map(named));
    let list = columns.map(Role::Column).zip(header.names.iter().cloned());
    let list = ColumnList::ByName(list.collect());
    let mut table = Table::open(path, Some(&list), Some(Separator::Comma).into(), &[])?;
    let mut readings = Readings::of_triads(triads.iter().map(|(triad, _)| *triad));
    // A slower magnetometer may have empty cells.
    let inertial = triads
        .iter()
        .filter(|(triad, _)| *triad != TriadName::MAG)
        .count();
    let (mut cells, mut broken) = (Cells::default(), None);
    loop {
        match table.next(&mut cells) {
            Ok(None) => break,
            Ok(Some(_)) if cells.numbers[..=3 * inertial].iter().all(|v| v.is_finite()) => {
                let scaled = cells.numbers[1..]
                    .iter()
                    .zip(triads.iter().flat_map(|(_, f)| [f; 3]));
                let stamp_ns = (cells.numbers[0] * tscale * 1e9).round() as i64;
                readings.push(stamp_ns, scaled.map(|(value, factor)| value * factor));
            }
            Err(Unreadable::File(error)) => return Err(error),
            Ok(Some(row)) | Err(Unreadable::Row(BrokenRow { number: row, .. })) => {
                broken.get_or_insert((0, row)).0 += 1;
            }
        }
    }
    let text = |key: &str| header.values.get(key).map_or("none", String::as_str);
    readings.notes.push(format!(
        "log of Gyroflow by {}; axes are those of its sensor, before Gyroflow's orientation ({})",
        text("id"),
        text("orientation")
    ));
    if !triads.iter().any(|(triad, _)| *triad == TriadName::ACCEL) {
        readings
            .warnings
            .push("the log has no accelerometer".into());
    }
    if let Some((rows, first)) = broken {
        readings.warnings.push(format!(
            "{rows} rows without a number in each column were skipped, the first in line {first}"
        ));
    }
    Ok(vec![readings])
}

/// The lines above the rows.
struct Header<'a> {
    path: &'a Path,
    values: BTreeMap<String, String>,
    names: Vec<String>,
}

impl<'a> Header<'a> {
    fn read(path: &'a Path) -> Result<Self> {
        let refuse =
            |problem: String, remedy: &str| Err(Error::new(path.display(), problem, remedy));
        let (head, _) = head::open(path, HEAD)?;
        let text = String::from_utf8_lossy(&head);
        let mut lines = text
            .lines()
            .map(|line| line.split(',').map(str::trim).collect::<Vec<_>>());
        if !lines.next().is_some_and(|title| TITLES.contains(&title[0])) {
            let remedy = "give a log of Gyroflow, or rename the file to .csv and name its columns";
            return refuse(format!("it does not begin with {}", TITLES[0]), remedy);
        }
        let mut values = BTreeMap::new();
        for cells in lines {
            match cells.as_slice() {
                ["t" | "time", names @ ..] if names.starts_with(&NAMES[..3]) => {
                    let names = cells.into_iter().map(str::to_owned).collect();
                    return Ok(Self {
                        path,
                        values,
                        names,
                    });
                }
                ["t" | "time", ..] => {
                    let problem = format!(
                        "its columns are {}, but a log of Gyroflow begins with t,gx,gy,gz",
                        cells.join(",")
                    );
                    return refuse(problem, "rename the file to .csv, and name its columns");
                }
                [key, value] => drop(values.insert((*key).to_owned(), (*value).to_owned())),
                _ => {}
            }
        }
        let problem = "it has no line with the names of the columns, t,gx,gy,gz and so on";
        refuse(problem.into(), "log again: the file is cut")
    }

    /// The number of a line.
    fn number(&self, key: &str) -> Result<Option<f64>> {
        let Some(text) = self.values.get(key) else {
            return Ok(None);
        };
        match text.parse() {
            Ok(value) if f64::is_finite(value) && value != 0.0 => Ok(Some(value)),
            _ => {
                let problem = format!("{key} of its header is {text:?}, not a number");
                Err(Error::new(
                    self.path.display(),
                    problem,
                    "correct this line of the file",
                ))
            }
        }
    }

    /// The triads of the log in the order of the columns, with their factors to SI and µT.
    fn triads(&self) -> Result<Vec<(TriadName, f64)>> {
        let factor = |key: &str, unit: &str| {
            self.number(key)?.ok_or_else(|| {
                let problem = format!("its header has no {key}, so its readings have no unit");
                let remedy = format!("add a line `{key},FACTOR` to the header: {unit} per count");
                Error::new(self.path.display(), problem, remedy)
            })
        };
        let has = |count: usize| self.names[1..].iter().take(count).eq(&NAMES[..count]);
        let mut triads = vec![(TriadName::GYRO, factor("gscale", "rad/s")?)];
        if has(6) {
            triads.push((TriadName::ACCEL, factor("ascale", "g")? * STANDARD_GRAVITY));
        }
        if has(9)
            && let Some(gauss) = self.number("mscale")?
        {
            triads.push((TriadName::MAG, gauss * GAUSS_UT));
        }
        Ok(triads)
    }
}

#[cfg(test)]
mod tests;
