//! Warnings about a recording that is read, and the only place with their texts.

use std::fmt;
use std::path::PathBuf;

/// A warning about a recording that is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Warning {
    /// The folder of an unfinished recording, and whether its last row is cut.
    Unfinished(PathBuf, bool),
    /// A file of samples, and a column of it that is ignored.
    UnknownColumn(String, String),
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Unfinished(folder, cut) => write!(
                f,
                "{}: the recording is unfinished (its program was killed, or is still recording); the existing rows are used{}",
                folder.display(),
                if *cut {
                    " except for the last one, which is cut"
                } else {
                    ""
                }
            ),
            Self::UnknownColumn(place, name) => {
                write!(f, "{place}: column {name} is unknown and is ignored")
            }
        }
    }
}
