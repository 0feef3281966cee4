//! Bags in a build without the feature `bags`: they are refused.

use std::path::Path;

use super::readings::{Choice, Readings};
use crate::error::{Error, Result};

pub(super) fn read_bag(path: &Path, _: Choice<'_>) -> Result<Vec<Readings>> {
    let problem = "this program was built without bags";
    let remedy = "build it with the feature `bags`";
    Err(Error::new(path.display(), problem, remedy))
}

pub(super) use read_bag as read_mcap;
pub(super) use read_bag as read_db3;
