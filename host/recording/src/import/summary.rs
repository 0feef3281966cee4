//! What an import has done.

use serde::Serialize;

use super::broken::BrokenRows;
use super::foreign::ForeignFile;
use super::options::file_name;
use super::preset::PresetUse;
use super::time::TimeSummary;

/// Lines of the source files that held no row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct SkippedLines {
    /// Headers and whatever else stood above the data.
    pub header: u64,
    /// Lines that begin with # or %.
    pub comment: u64,
    /// Empty lines.
    pub blank: u64,
}

/// What an import has done: the result of `mimu import`, as its JSON has it.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ImportSummary {
    /// `mimu-import/1`.
    pub format: &'static str,
    /// Directory of the recording.
    pub recording: String,
    /// Rows written.
    pub rows: u64,
    /// Whether the rows are means over a pose each, and no samples.
    pub means: bool,
    /// The maker's layout that the files were read by, if any.
    pub preset: Option<PresetUse>,
    /// Sample rate in Hz: that of the time stamps, or the one that was given where there are none; null of means without one.
    pub sample_rate_hz: f64,
    /// What the time stamps have shown, of each file that has them.
    pub time: Vec<TimeSummary>,
    /// Lines without a row, over all files.
    #[serde(rename = "skipped_lines")]
    pub skipped: SkippedLines,
    /// Rows of the first file that another file does not reach in time.
    pub dropped_outside: u64,
    /// Rows of the first file that lie in a gap of another file.
    pub dropped_in_gaps: u64,
    /// Rows with values interpolated from another file.
    pub interpolated: u64,
    /// Rows left out as they are not those that were asked for.
    pub not_chosen: u64,
    /// Rows left out as padding, as all of their readings are 0.
    pub padding: u64,
    /// Rows that could not be read and were left out, of each file that has some.
    pub broken_rows: Vec<BrokenRows>,
    /// Raw cells that are empty.
    pub empty_cells: u64,
    /// What was read of logs, and what was undone of their own calibration.
    pub notes: Vec<String>,
    /// One sentence for each thing that a person should know.
    pub warnings: Vec<String>,
}

impl ImportSummary {
    /// Takes in what was skipped in `file` and what is to be said of it.
    pub(super) fn add(&mut self, file: &ForeignFile) {
        let place = file_name(file.path());
        let notes = file.notes().iter().map(|note| format!("{place}: {note}"));
        self.notes.extend(notes);
        self.warnings
            .extend(file.seen.warnings(&place, file.rate_hz()));
        self.padding += file.seen.padding;
        self.not_chosen += file.not_chosen();
        for (sensor, rows) in ["gyro", "accel"].iter().zip(file.seen.dead()) {
            self.warnings.extend(rows.map(|rows| {
                format!(
                    "{place}: {sensor} is exactly 0 on all axes in all of its {rows} rows: it was not connected, and is left out"
                )
            }));
        }
        if file.zero_bytes() > 0 {
            self.warnings.push(format!(
                "{place}: {} bytes of 0 before and after its lines were left out: reserved space that was never written",
                file.zero_bytes()
            ));
        }
        if file.stamp_wraps() > 0 {
            self.warnings.push(format!(
                "{place}: the time stamps wrapped to 0 {}, like a counter of 16 to 32 bits, and were unwrapped",
                times(file.stamp_wraps())
            ));
        }
        let skipped = file.skipped();
        self.skipped.header += skipped.header;
        self.skipped.comment += skipped.comment;
        self.skipped.blank += skipped.blank;
        if file.wraps() > 0 {
            self.warnings.push(format!(
                "{}: the column sample wrapped to 0 {}, like a counter of 16 or 32 bits, and was unwrapped",
                file.path().display(),
                times(file.wraps())
            ));
        }
        self.broken_rows.extend(file.broken.found(place));
    }
}

impl TimeSummary {
    /// A warning of the irregular times at which a loop read the unit.
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
