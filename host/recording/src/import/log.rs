//! Logs that describe their own contents: bags of ROS, logs of PX4, of ArduPilot and for Gyroflow.
//!
//! To add a format, write a module with a [`LogFormat`] and add this to [`FORMATS`].

use std::path::Path;

use super::decimal::Decimal;
use super::readings::{Choice, LogFormat, Readings};
#[cfg(feature = "bags")]
use super::ros;
use super::{ardupilot, gyroflow, px4};
use crate::error::{Argument, Error, Result};

const FORMATS: &[&LogFormat] = &[
    #[cfg(feature = "bags")]
    &ros::BAG,
    #[cfg(feature = "bags")]
    &ros::MCAP,
    #[cfg(feature = "bags")]
    &ros::DB3,
    &px4::ULG,
    &ardupilot::BIN,
    &gyroflow::GCSV,
];

fn format(path: &Path) -> Option<&'static LogFormat> {
    let ending = path.extension()?;
    let mut all = FORMATS.iter().copied();
    all.find(|format| ending.eq_ignore_ascii_case(format.ending))
}

/// The formats of logs for people: `ROS 1 (.bag), PX4 (.ulg)` and so on.
pub fn log_formats() -> String {
    let each = FORMATS
        .iter()
        .map(|f| format!("{} (.{})", f.name, f.ending));
    each.collect::<Vec<_>>().join(", ")
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
    let mut inertial = all.iter().filter(|readings| !readings.is_further());
    if inertial.all(|readings| readings.len() == 0) {
        let problem = "the chosen topic or file has no message of an inertial unit";
        return Err(
            Error::new(path.display(), problem, "choose another topic or file")
                .about(Argument::Topic)
                .about(Argument::Instance),
        );
    }
    Ok(all)
}
