//! Logs that describe their own contents: bags of ROS, logs of PX4, of ArduPilot and for Gyroflow.
//!
//! To add a format, write a module with a `read` and add it to [`FORMATS`].

use std::path::Path;

use super::readings::{Choice, Readings};
use super::time::Decimal;
use super::{ardupilot, gyroflow, px4, ros};
use crate::error::{Argument, Error, Result};

/// A format: the endings of its files, the unit in which it counts time, and its reader, which converts the stamps to ns.
struct LogFormat {
    endings: &'static [&'static str],
    unit: Decimal,
    read: fn(&Path, Choice<'_>) -> Result<Vec<Readings>>,
}

const FORMATS: [LogFormat; 6] = [
    LogFormat {
        endings: &["bag"],
        unit: Decimal::Nanosecond,
        read: ros::read_bag,
    },
    LogFormat {
        endings: &["mcap"],
        unit: Decimal::Nanosecond,
        read: ros::read_mcap,
    },
    LogFormat {
        endings: &["db3"],
        unit: Decimal::Nanosecond,
        read: ros::read_db3,
    },
    LogFormat {
        endings: &["ulg"],
        unit: Decimal::Microsecond,
        read: px4::read,
    },
    LogFormat {
        endings: &["bin"],
        unit: Decimal::Microsecond,
        read: ardupilot::read,
    },
    LogFormat {
        endings: &["gcsv"],
        unit: Decimal::Microsecond,
        read: gyroflow::read,
    },
];

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

/// Whether a file is such a log, by its ending. The readings of logs are in rad/s and m/s², their stamps in ns.
pub fn is_log(path: &Path) -> bool {
    format(path).is_some()
}

/// Unit in which the log at `path` counts time.
pub(super) fn unit(path: &Path) -> Option<Decimal> {
    format(path).map(|format| format.unit)
}

/// The readings of a log: one set for the whole unit, or one for each sensor if these have separate clocks, the faster one first.
pub(super) fn read(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    let Some(format) = format(path) else {
        return Err(Error::new(
            path.display(),
            "this is not a log",
            "name its columns",
        ));
    };
    let all = (format.read)(path, choice)?;
    if all.iter().all(|readings| readings.len() == 0) {
        let problem = "the chosen topic or file has no message of an inertial unit";
        return Err(
            Error::new(path.display(), problem, "choose another topic or file")
                .about(Argument::Topic)
                .about(Argument::Instance),
        );
    }
    Ok(all)
}
