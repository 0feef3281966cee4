//! Bags in a build without the feature `bags`: they are refused.

use std::path::Path;

use super::decimal::Decimal;
use super::readings::{Choice, LogFormat, Readings};
use crate::error::{Error, Result};

const fn refused(name: &'static str, ending: &'static str) -> LogFormat {
    LogFormat {
        name,
        ending,
        unit: Decimal::Nanosecond,
        read,
    }
}

pub(super) const BAG: LogFormat = refused("ROS 1", "bag");
pub(super) const MCAP: LogFormat = refused("ROS 2", "mcap");
pub(super) const DB3: LogFormat = refused("ROS 2", "db3");

fn read(path: &Path, _: Choice<'_>) -> Result<Vec<Readings>> {
    let problem = "this program was built without bags";
    let remedy = "build it with the feature `bags`";
    Err(Error::new(path.display(), problem, remedy))
}
