//! Warnings about a recording that is read, and the only place with their texts.

use std::fmt;
use std::path::PathBuf;

/// A warning about a recording that is read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Warning {
    /// The folder of an unfinished recording, and whether its last row is cut.
    Unfinished {
        /// Its folder.
        folder: PathBuf,
        /// Whether its last row is cut.
        cut: bool,
    },
    /// A file of samples, and a column of it that is ignored.
    UnknownColumn {
        /// The file.
        place: String,
        /// The column.
        name: String,
    },
}

impl Warning {
    /// Its name: that of the variant, in small letters.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Unfinished { .. } => "unfinished",
            Self::UnknownColumn { .. } => "unknown_column",
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Unfinished { folder, cut } => write!(
                f,
                "{}: the recording is unfinished (its program was killed, or is still recording); the existing rows are used{}",
                folder.display(),
                if *cut {
                    " except for the last one, which is cut"
                } else {
                    ""
                }
            ),
            Self::UnknownColumn { place, name } => {
                write!(f, "{place}: column {name} is unknown and is ignored")
            }
        }
    }
}
