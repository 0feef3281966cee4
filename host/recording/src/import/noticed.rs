//! What a reader of foreign rows notices beside them.

use super::SkippedLines;

/// What was noticed in a file so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct Noticed {
    /// Lines that contained no row.
    pub skipped: SkippedLines,
    /// Lines of words among the rows, and the first of them: a logger that starts again writes its header or greeting once more.
    pub restarts: Option<(u64, u64)>,
    /// Zero bytes around the lines, which were left out.
    pub zero_bytes: u64,
    /// Whether the times are dates or times of day, which are in s.
    pub calendar: bool,
    /// What was read from a log, and how its readings were changed.
    pub notes: Vec<String>,
    /// Warnings about what was ignored.
    pub warnings: Vec<String>,
}

impl Noticed {
    /// Line `number` among the rows has words.
    pub fn words(&mut self, number: u64) {
        self.skipped.header += 1;
        self.restarts.get_or_insert((0, number)).0 += 1;
    }
}
