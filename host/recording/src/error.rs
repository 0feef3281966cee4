//! One error for everything that refuses: the place, what is wrong there, and what to do.

use std::fmt;
use std::path::Path;

/// Why something was refused, as the one line that a person reads: `PLACE: PROBLEM; REMEDY`.
///
/// One struct and not an enum of causes: callers only ever print it and exit with status 1, and a
/// line that lacks one of the three parts is what makes command-line tools tiresome, so none can be
/// left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    /// File with row and column, or step, axis, parameter: as narrow as is known.
    pub place: String,
    /// What is wrong there, with the offending value.
    pub problem: String,
    /// What the reader can do about it.
    pub remedy: String,
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error at `place` (file, row, column, step or axis).
    pub fn new(
        place: impl fmt::Display,
        problem: impl fmt::Display,
        remedy: impl fmt::Display,
    ) -> Self {
        Self {
            place: place.to_string(),
            problem: problem.to_string(),
            remedy: remedy.to_string(),
        }
    }

    /// An error of the operating system on a file or folder.
    pub fn io(path: &Path, error: &std::io::Error) -> Self {
        let remedy = match error.kind() {
            std::io::ErrorKind::NotFound => "check the path",
            std::io::ErrorKind::PermissionDenied => "check its permissions",
            std::io::ErrorKind::StorageFull => "free some space and run it again",
            _ => "check the file and the disk",
        };
        // "(os error 2)" helps nobody who reads the sentence before it.
        let text = error.to_string();
        let text = text
            .split(" (os error")
            .next()
            .unwrap_or_default()
            .to_lowercase();
        Self::new(path.display(), text, remedy)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = format!("{}: {}; {}", self.place, self.problem, self.remedy);
        // A file name or a cell may hold a line break, or what moves a terminal's cursor; the promise is one line.
        let breaks = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
        f.write_str(&line.replace(breaks, " "))
    }
}

impl std::error::Error for Error {}
