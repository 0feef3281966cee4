//! Logs that say themselves what they hold: bags of ROS, logs of PX4 and of ArduPilot.
//!
//! Another format is a module with a `read` and a line in [`FORMATS`].

use std::path::Path;

use super::assignment::Role;
use super::text_table::Cells;
use super::time::Stamp;
use super::{ardupilot, px4, ros};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::in_order::broke_down;

/// A format: how its files are named, and who reads them.
struct LogFormat {
    endings: &'static [&'static str],
    read: fn(&Path, Choice<'_>) -> Result<Vec<Readings>>,
}

const FORMATS: [LogFormat; 5] = [
    LogFormat {
        endings: &["bag"],
        read: ros::read_bag,
    },
    LogFormat {
        endings: &["mcap"],
        read: ros::read_mcap,
    },
    LogFormat {
        endings: &["db3"],
        read: ros::read_db3,
    },
    LogFormat {
        endings: &["ulg"],
        read: px4::read,
    },
    LogFormat {
        endings: &["bin"],
        read: ardupilot::read,
    },
];

/// Which of the sensors in a log is wanted.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Choice<'a> {
    /// Name of the topic or message; the format decides without it.
    pub topic: Option<&'a str>,
    /// Number of the sensor among those of one topic.
    pub instance: Option<u32>,
}

/// Readings of one clock: those of a whole unit, or of one of its two sensors.
#[derive(Debug, Default)]
pub(super) struct Readings {
    /// What each value of a row is.
    columns: Vec<Column>,
    stamps_ns: Vec<i64>,
    /// Row by row.
    values: Vec<f64>,
    next: usize,
    /// What was read, and what was done to it.
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

impl Readings {
    /// Of these columns, in the order of the values, without rows yet.
    pub fn of(columns: Vec<Column>) -> Self {
        Self {
            columns,
            ..Self::default()
        }
    }

    /// Of both sensors.
    pub fn of_unit() -> Self {
        Self::of((0..6).map(Column::Raw).collect())
    }

    /// Appends a row; one value for each column.
    pub fn push(&mut self, stamp_ns: i64, values: impl IntoIterator<Item = f64>) {
        self.stamps_ns.push(stamp_ns);
        self.values.extend(values);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.stamps_ns.len()
    }

    /// Roles in the order of [`Cells::numbers`].
    pub fn roles(&self) -> Vec<Role> {
        let time = std::iter::once(Column::Time);
        time.chain(self.columns.iter().copied())
            .map(Role::Column)
            .collect()
    }

    /// Share of the rows that has been handed out.
    pub fn progress(&self) -> f64 {
        self.next as f64 / self.len().max(1) as f64
    }

    /// Puts the next row into `cells` and returns its number from 1, or `None` at the end.
    pub fn next(&mut self, cells: &mut Cells) -> Option<u64> {
        let stamp_ns = *self.stamps_ns.get(self.next)?;
        let width = self.columns.len();
        cells.stamp = Stamp::from(stamp_ns);
        cells.step.clear();
        cells.numbers.clear();
        cells.numbers.push(stamp_ns as f64);
        let from = self.next * width;
        cells
            .numbers
            .extend_from_slice(&self.values[from..from + width]);
        self.next += 1;
        Some(self.next as u64)
    }
}

fn format(path: &Path) -> Option<&'static LogFormat> {
    let ending = path.extension()?.to_str()?;
    let has = |format: &&LogFormat| {
        format
            .endings
            .iter()
            .any(|e| e.eq_ignore_ascii_case(ending))
    };
    FORMATS.iter().find(has)
}

/// Whether a file is such a log, by its name. Its readings are in rad/s and m/s², its stamps in ns.
pub fn is_log(path: &Path) -> bool {
    format(path).is_some()
}

/// The readings of a log: one for the whole unit, or one for each sensor where they have clocks of their own, the faster one first.
pub(super) fn read(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    let Some(format) = format(path) else {
        return Err(Error::new(
            path.display(),
            "this is no log",
            "name its columns",
        ));
    };
    // Readers of damaged files have panicked before; a damaged file is no bug of ours.
    let read = std::panic::catch_unwind(|| (format.read)(path, choice));
    let all = read.map_err(|_| broke_down(&path.display().to_string()))??;
    if all.iter().all(|readings| readings.len() == 0) {
        let problem = "there is no message of an inertial unit in what was chosen";
        return Err(
            Error::new(path.display(), problem, "choose another topic or file")
                .about(Argument::Topic)
                .about(Argument::Instance),
        );
    }
    Ok(all)
}
