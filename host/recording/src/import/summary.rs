//! Result of an import.

use serde::Serialize;

use super::broken::BrokenRows;
use super::log_options::file_name;
use super::preset::PresetUse;
use super::source::Source;
use super::time::TimeSummary;
use crate::digits::plural;
use crate::triad_name::TriadName;

/// Lines of the source files that contained no row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct SkippedLines {
    /// Headers and other lines above the data.
    pub header: u64,
    /// Lines that begin with # or %.
    pub comment: u64,
    /// Empty lines.
    pub blank: u64,
}

impl SkippedLines {
    /// Adds those of another file.
    pub(super) fn add(&mut self, other: Self) {
        self.header += other.header;
        self.comment += other.comment;
        self.blank += other.blank;
    }
}

/// The result of `mimu import`, with the fields of its JSON.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ImportSummary {
    /// `mimu-import/1`.
    pub format: &'static str,
    /// Directory of the recording.
    pub recording: String,
    /// Where nobody named the columns: what they were taken for, their units and why, in a line each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub taken: Vec<String>,
    /// The arguments of `mimu import` that say the same without a look at the files.
    pub arguments: Vec<String>,
    /// Rows written.
    pub rows: u64,
    /// Whether each row is the mean over a pose instead of a sample.
    pub means: bool,
    /// The preset by which the files were read, if any.
    pub preset: Option<PresetUse>,
    /// Sample rate in Hz: that of the time stamps, or the given one if there are none; null for means without one.
    pub sample_rate_hz: f64,
    /// Results about the time stamps of each file that has them.
    pub time: Vec<TimeSummary>,
    /// Lines without a row, over all files.
    #[serde(rename = "skipped_lines")]
    pub skipped: SkippedLines,
    /// Rows of the first file before the beginning or after the end of another file.
    pub dropped_outside: u64,
    /// Rows of the first file that lie in a gap of another file.
    pub dropped_in_gaps: u64,
    /// Rows with values interpolated from another file.
    pub interpolated: u64,
    /// Rows that the filters or the range left out.
    pub not_chosen: u64,
    /// Rows left out as padding, because all of their readings are 0.
    pub padding: u64,
    /// Rows that could not be read and were left out, of each file that has some.
    pub broken_rows: Vec<BrokenRows>,
    /// Raw cells that are empty.
    pub empty_cells: u64,
    /// The triads that were taken, by number and kind.
    pub triads: Vec<TriadName>,
    /// Whether no column is of an accelerometer.
    #[serde(skip)]
    pub without_accel: bool,
    /// What was read from logs, and whether their own calibration was undone.
    pub notes: Vec<String>,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

impl ImportSummary {
    /// Adds the counts, notes and warnings of `file`.
    pub(super) fn add(&mut self, file: &Source) {
        let place = file_name(&file.path);
        let noticed = &file.noticed;
        self.warnings.extend_from_slice(&noticed.warnings);
        let notes = noticed.notes.iter().map(|note| format!("{place}: {note}"));
        self.notes.extend(notes);
        let found = file.seen.found(file.rate_hz()).into_iter();
        let warnings = found.map(|found| format!("{place}: {found}"));
        self.warnings.extend(warnings);
        self.padding += file.seen.padding();
        if let Some((lines, first)) = noticed.restarts {
            self.warnings.push(format!(
                "{place}: {} of words among the rows, the first in row {first}, left out: the logger started again there, and its bias may have changed; if its clock started again too, the pause is unknown",
                plural(lines, "line")
            ));
        }
        if noticed.zero_bytes > 0 {
            self.warnings.push(format!(
                "{place}: {} bytes of 0 before and after its lines were left out: reserved space that was never written",
                noticed.zero_bytes
            ));
        }
        if file.wraps[1] > 0 {
            self.warnings.push(format!(
                "{place}: the time stamps wrapped to 0 {}, like a counter of 16 to 32 bits or a clock at midnight, and were unwrapped",
                times(file.wraps[1])
            ));
        }
        self.skipped.add(noticed.skipped);
        if file.wraps[0] > 0 {
            self.warnings.push(format!(
                "{}: the column sample wrapped to 0 {}, like a counter of 16 or 32 bits, and was unwrapped",
                file.path.display(),
                times(file.wraps[0])
            ));
        }
        self.broken_rows.extend(file.broken.found(place));
    }
}

impl TimeSummary {
    /// A warning about the irregular times at which a loop read the unit.
    pub(super) fn of_loop(&self) -> Option<String> {
        let rounds = self.polled.as_ref()?;
        let [shortest, longest] =
            [rounds.shortest_s, rounds.longest_s].map(|s| format!("{:.1}", 1e3 * s));
        Some(format!(
            "{}: a loop read the unit at irregular times, {shortest} to {longest} ms apart; the readings are interpolated between them, which lowers their white noise. For regular times, let a timer of the board or the sensor's FIFO trigger the readings",
            self.file
        ))
    }
}

/// How often, in words.
fn times(count: u64) -> String {
    match count {
        1 => "once".into(),
        _ => format!("{count} times"),
    }
}
