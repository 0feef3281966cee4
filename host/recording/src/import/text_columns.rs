//! Text of some columns of a Parquet file, row by row.

use std::borrow::Cow;
use std::path::Path;

use super::parquet_rows::ParquetRows;
use crate::error::Result;

/// Hands the cells of the columns `names` to `row`, empty for null. Returns `false`, before any row, if the file lacks one of them.
///
/// # Errors
/// The file cannot be read or is damaged, or one of these columns is nested.
pub fn text_columns<const N: usize>(
    path: &Path,
    names: [&str; N],
    mut row: impl FnMut([Cow<'_, str>; N]),
) -> Result<bool> {
    let mut rows = ParquetRows::open(path)?;
    let all = rows.names();
    let at = names.map(|name| all.iter().position(|own| own == name));
    if at.iter().any(Option::is_none) {
        return Ok(false);
    }
    let at = at.map(Option::unwrap_or_default);
    rows.read_columns(at.into_iter())?;
    let mut record = csv::ByteRecord::new();
    while rows.next(&mut record)?.is_some() {
        row(at.map(|at| String::from_utf8_lossy(&record[at])));
    }
    Ok(true)
}
