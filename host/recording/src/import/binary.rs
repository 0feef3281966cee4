//! Binary files, recognised by their first bytes.

use std::path::Path;

use crate::error::{Error, Result};

/// Signatures of files that are not text, and what to do with them.
const BINARY: [(&[u8], &str, &str); 8] = [
    (
        b"MATLAB 5.0",
        "a binary MATLAB file",
        "write it as text: save -ascii in MATLAB, or writematrix to a .csv",
    ),
    (
        b"\x89HDF\r\n\x1a\n",
        "an HDF5 or MATLAB 7.3 file",
        "write it as text: save -ascii in MATLAB, or pandas.read_hdf(...).to_csv",
    ),
    (
        b"PAR1",
        "a Parquet file",
        "give it a name that ends in .parquet",
    ),
    (b"\x1f\x8b", "compressed with gzip", "unpack it with gunzip"),
    (
        b"PK\x03\x04",
        "a zip archive or a spreadsheet",
        "unpack it, or save the sheet as CSV",
    ),
    (b"\x93NUMPY", "a NumPy file", "write it with numpy.savetxt"),
    (b"\xff\xfe", "UTF-16 text", "save it as UTF-8"),
    (b"\xfe\xff", "UTF-16 text", "save it as UTF-8"),
];

/// A line without zero bytes before and after it.
///
/// A file system fills preallocated space with zeros, so a log whose supply was cut may end with them; a serial port may deliver some before the
/// first byte. Zeros between the characters of a line belong to UTF-16 or to binary numbers.
pub(super) fn without_zeros(line: &[u8]) -> &[u8] {
    let from = line.iter().position(|byte| *byte != 0);
    let to = line.iter().rposition(|byte| !matches!(byte, 0 | b'\r'));
    match (from, to) {
        (Some(from), Some(to)) if from <= to => &line[from..=to],
        _ => &[],
    }
}

/// Refuses binary files, by their first bytes.
pub(super) fn refuse_binary(path: &Path, head: &[u8]) -> Result<()> {
    for (signature, kind, remedy) in BINARY {
        if head.starts_with(signature) {
            return Err(Error::new(
                path.display(),
                format!("this is {kind}"),
                remedy,
            ));
        }
    }
    if !head.contains(&b'\n') && head.iter().filter(|byte| **byte == b'\r').count() > 1 {
        let problem = "its lines end with a carriage return alone";
        let remedy = "convert them: tr '\\r' '\\n'";
        return Err(Error::new(path.display(), problem, remedy));
    }
    let mut lines = head.split(|byte| *byte == b'\n');
    if lines.any(|line| without_zeros(line).contains(&0)) {
        let problem = "this is a binary file of an unknown kind";
        return Err(Error::new(
            path.display(),
            problem,
            "write it as CSV or Parquet",
        ));
    }
    Ok(())
}
