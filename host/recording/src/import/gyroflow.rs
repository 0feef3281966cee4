//! Logs of cameras and gyro loggers for Gyroflow (`.gcsv`).
//!
//! Text in cells: a first line with the format's name, lines `key,value`, the names of the columns (`t,gx,gy,gz,ax,ay,az`), then the rows. The header
//! has the units: `t tscale` is in s (0.001 without it), `g gscale` in rad/s, `a ascale` in g, `m mscale` of a magnetometer in gauss. Axes are those of
//! the logger's sensor; `orientation` says how Gyroflow turns them into the camera's, and is left to Gyroflow.
//!
//! Source: docs.gyroflow.xyz, "gcsv format" 1.3; telemetry-parser 0.2.6, src/gyroflow/mod.rs, which reads the same names and defaults.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use super::decimal::Decimal;
use super::readings::{Choice, LogFormat, Readings};
use crate::error::{Argument, Error, Result};
use crate::triad_name::TriadName;

/// First lines of the format, the second without a maker's name.
const TITLES: [&str; 2] = ["GYROFLOW IMU LOG", "CAMERA IMU LOG"];
/// Factor of the stamps where the header has none, s.
const TSCALE: f64 = 1e-3;
/// What the format calls g.
const GRAVITY: f64 = 9.80665;
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
    if choice.topics.is_empty() && choice.instance.is_none() {
        let file = File::open(path).map_err(|error| Error::io(path, &error))?;
        return Ok(vec![Log::read(path, BufReader::new(file))?]);
    }
    let problem = "a log of Gyroflow has one sensor and no topics";
    Err(Error::new(path.display(), problem, "leave the choice out")
        .about(Argument::Topic)
        .about(Argument::Instance))
}

struct Log {
    readings: Readings,
    /// Factor of the stamps, s.
    tscale: f64,
    /// Factors of the readings, SI and µT.
    scales: Vec<f64>,
    /// How many of them are of gyro and accelerometer. A slower magnetometer may have empty cells.
    inertial: usize,
    /// Rows without a number for each column, and the first of them, counted from the first line of the file.
    broken: Option<(u64, u64)>,
}

impl Log {
    fn read(path: &Path, file: impl BufRead) -> Result<Readings> {
        let (mut header, mut log) = (BTreeMap::new(), None);
        for (line, number) in file.split(b'\n').zip(1_u64..) {
            let line = line.map_err(|error| Error::io(path, &error))?;
            let line = String::from_utf8_lossy(&line);
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            match &mut log {
                _ if cells == [""] => {}
                None if number == 1 => check_title(path, cells[0])?,
                None if ["t", "time"].contains(&cells[0]) => {
                    log = Some(Self::with_header(path, &header, &cells)?)
                }
                None => {
                    if let [key, value] = cells.as_slice() {
                        header.insert((*key).to_owned(), (*value).to_owned());
                    }
                }
                Some(log) => log.take(&cells, number),
            }
        }
        let Some(mut log) = log else {
            let problem = "it has no line with the names of the columns, t,gx,gy,gz and so on";
            return Err(Error::new(
                path.display(),
                problem,
                "log again: the file is cut",
            ));
        };
        if let Some((rows, first)) = log.broken {
            log.readings.warnings.push(format!("{rows} rows without a number in each column were skipped, the first in line {first}"));
        }
        Ok(log.readings)
    }

    fn with_header(path: &Path, header: &BTreeMap<String, String>, names: &[&str]) -> Result<Self> {
        let has_accel = names.get(4..7) == Some(&NAMES[3..6]);
        if names.get(1..4) != Some(&NAMES[..3]) {
            let problem = format!(
                "its columns are {}, but a log of Gyroflow begins with t,gx,gy,gz",
                names.join(",")
            );
            return Err(Error::new(
                path.display(),
                problem,
                "rename the file to .csv, and name its columns",
            ));
        }
        let number = |key: &str| -> Result<Option<f64>> {
            let Some(text) = header.get(key) else {
                return Ok(None);
            };
            match text.parse() {
                Ok(value) if f64::is_finite(value) && value != 0.0 => Ok(Some(value)),
                _ => Err(Error::new(
                    path.display(),
                    format!("{key} of its header is {text:?}, not a number"),
                    "correct this line of the file",
                )),
            }
        };
        let factor = |key: &str, unit: &str| {
            number(key)?.ok_or_else(|| {
                let problem = format!("its header has no {key}, so its readings have no unit");
                Error::new(
                    path.display(),
                    problem,
                    format!("add a line `{key},FACTOR` to the header: {unit} per count"),
                )
            })
        };
        let gyro = factor("gscale", "rad/s")?;
        let mut scales = vec![gyro; 3];
        if has_accel {
            scales.extend([factor("ascale", "g")? * GRAVITY; 3]);
        }
        let inertial = scales.len();
        let mut triads = vec![TriadName::GYRO];
        triads.extend(has_accel.then_some(TriadName::ACCEL));
        if has_accel
            && names.get(7..10) == Some(&NAMES[6..])
            && let Some(gauss) = number("mscale")?
        {
            scales.extend([gauss * GAUSS_UT; 3]);
            triads.push(TriadName::MAG);
        }
        let mut readings = Readings::of_triads(triads);
        let text = |key: &str| header.get(key).map_or("none", String::as_str);
        readings.notes.push(format!(
            "log of Gyroflow by {}; axes are those of its sensor, before Gyroflow's orientation ({})",
            text("id"),
            text("orientation")
        ));
        if !has_accel {
            readings
                .warnings
                .push("the log has no accelerometer".into());
        }
        Ok(Self {
            readings,
            tscale: number("tscale")?.unwrap_or(TSCALE),
            scales,
            inertial,
            broken: None,
        })
    }

    fn take(&mut self, cells: &[&str], line: u64) {
        let number = |cell: &&str| {
            fast_float2::parse::<f64, _>(cell.as_bytes())
                .ok()
                .filter(|v| v.is_finite())
        };
        let numbers: Option<Vec<f64>> = cells.iter().take(1 + self.inertial).map(number).collect();
        match numbers {
            Some(mut numbers) if numbers.len() == 1 + self.inertial => {
                let further = 1 + self.inertial..1 + self.scales.len();
                let cell = |at: usize| cells.get(at).and_then(number).unwrap_or(f64::NAN);
                numbers.extend(further.map(cell));
                let stamp_ns = (numbers[0] * self.tscale * 1e9).round() as i64;
                let values = numbers[1..].iter().zip(&self.scales);
                self.readings
                    .push(stamp_ns, values.map(|(value, scale)| value * scale));
            }
            _ => {
                let (rows, first) = self.broken.unwrap_or((0, line));
                self.broken = Some((rows + 1, first));
            }
        }
    }
}

fn check_title(path: &Path, title: &str) -> Result<()> {
    if TITLES.contains(&title.trim_start_matches('\u{feff}')) {
        return Ok(());
    }
    let problem = format!("it does not begin with {}", TITLES[0]);
    Err(Error::new(
        path.display(),
        problem,
        "give a log of Gyroflow, or rename the file to .csv and name its columns",
    ))
}

#[cfg(test)]
mod tests;
