//! What is known about a maker's files.

use crate::declared::RawUnit;

/// The files of one maker: their names, columns and units.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// The files that it reads, for people.
    pub title: &'static str,
    /// Unit of the readings after the factors; `None` if the maker leaves it open.
    pub raw_unit: Option<RawUnit>,
    /// Kinds of files; the first that fits is used.
    pub(super) layouts: &'static [Layout],
    /// Files that a folder may contain, the best set first; the faster sensor first in each.
    pub(super) in_folder: &'static [&'static [&'static str]],
    /// Files of a magnetometer that may be beside them, the best first.
    pub(super) mag_in_folder: &'static [&'static str],
    /// A file beside the readings that decides between two presets with the same headers.
    pub(super) beside: Option<Beside>,
}

/// One kind of file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// The name that a file must have if its header does not show the sensor. Case is ignored.
    pub file: Option<&'static str>,
    /// Its columns, all of which must be there, written as for the command line.
    pub columns: &'static str,
    /// Columns that it may have, each group whole.
    pub optional: &'static [&'static str],
    /// Factors of columns, signs included, written as for the command line.
    pub scales: &'static [&'static str],
    /// Words before the sample rate, Hz, in a line above the data. The line is required.
    pub rate_after: Option<&'static str>,
    /// Why such a file is refused, and the remedy.
    pub refusal: Option<[&'static str; 2]>,
}

impl Layout {
    /// A layout of which only the names in the header are known.
    pub const fn of(columns: &'static str) -> Layout {
        Layout {
            file: None,
            columns,
            optional: &[],
            scales: &[],
            rate_after: None,
            refusal: None,
        }
    }
}

/// A table of one row that lies beside the files.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beside {
    pub file: &'static str,
    /// Columns and values.
    pub values: &'static [(&'static str, &'static str)],
    /// Whether the recording belongs to this preset if one of the values occurs, or (`false`) if none does.
    pub belongs_if_present: bool,
}
