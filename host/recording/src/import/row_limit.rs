//! How many rows an import takes.

use std::path::Path;

use crate::error::Error;

/// Most rows of a file: 28 h at 1 kHz. Compressed files of a few MB may hold many more.
pub(super) const MOST_ROWS: u64 = 100_000_000;

/// The refusal of a file with `count` rows.
pub(super) fn too_many_rows(path: &Path, count: &str) -> Error {
    let problem = format!("it has {count} rows, and at most {MOST_ROWS} fit into memory");
    let remedy = "cut it into several files, or record at a lower rate";
    Error::new(path.display(), problem, remedy)
}
