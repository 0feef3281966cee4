//! What is known of a maker's recordings.

use crate::manifest::RawUnit;

/// The recordings of one maker: which files they are, what their columns mean, and in which units they are.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// Name on the command line.
    pub name: &'static str,
    /// What it reads, for people.
    pub title: &'static str,
    /// Unit of the readings after the factors; `None` where the maker leaves it open.
    pub raw_unit: Option<RawUnit>,
    /// Kinds of files; of several that fit, the first.
    pub(super) layouts: &'static [Layout],
    /// Files that a folder may hold, the best set first; the faster sensor first in each.
    pub(super) in_folder: &'static [&'static [&'static str]],
    /// Why its files are not joined, and what to do, where they have no time in common.
    pub(super) apart: Option<[&'static str; 2]>,
    /// What a file beside the readings says where two presets share their headers.
    pub(super) beside: Option<Beside>,
}

/// One kind of file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub file: FileName,
    /// Its columns, all of which must be there, written as for the command line.
    pub columns: &'static str,
    /// Columns that it may have.
    pub optional: &'static str,
    /// Factors of columns, signs included, written as for the command line.
    pub scales: &'static [&'static str],
    /// Words behind which a line above the data has the sample rate in Hz; must be there as well.
    pub rate_after: Option<&'static str>,
    /// What makes it no use, and what to do.
    pub unfit: Option<[&'static str; 2]>,
}

impl Layout {
    /// With names in the header, and nothing more to say.
    pub const fn of(columns: &'static str) -> Layout {
        Layout {
            file: FileName::Any,
            columns,
            optional: "",
            scales: &[],
            rate_after: None,
            unfit: None,
        }
    }
}

/// What a file has to be called, where its header does not say which sensor it is of. The case of letters does not count.
#[derive(Debug, Clone, Copy)]
pub(super) enum FileName {
    Any,
    Is(&'static str),
    Has(&'static str),
}

impl FileName {
    pub fn fits(self, name: &str) -> bool {
        let name = name.to_lowercase();
        match self {
            FileName::Any => true,
            FileName::Is(own) => name == own.to_lowercase(),
            FileName::Has(part) => name.contains(&part.to_lowercase()),
        }
    }
}

/// A table of one row that lies beside the files.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beside {
    pub file: &'static str,
    /// Columns and values.
    pub values: &'static [(&'static str, &'static str)],
    /// Whether the recording is of this preset if one of the values is there, or if none is.
    pub one_is_there: bool,
}
