//! An import for people.

use std::fmt::Write as _;

use mimu::quantity::plural;
use mimu_recording::ImportSummary;

use crate::report::text::warn;

/// Result of `mimu import`.
pub fn import_text(summary: &ImportSummary) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}: {} at {} Hz",
        summary.recording,
        plural(summary.rows, "row"),
        summary.sample_rate_hz
    );
    let skipped = summary.skipped;
    let counts = [
        (skipped.header, "header line", "skipped"),
        (skipped.comment, "comment line", "skipped"),
        (skipped.blank, "empty line", "skipped"),
        (
            summary.dropped_outside,
            "row",
            "dropped: outside the time that all files cover",
        ),
        (
            summary.dropped_in_gaps,
            "row",
            "dropped: in a gap of another file",
        ),
        (
            summary.interpolated,
            "row",
            "interpolated from another file",
        ),
        (summary.empty_cells, "raw cell", "empty"),
    ];
    for (n, noun, what) in counts {
        if n > 0 {
            let _ = writeln!(out, "  {} {what}", plural(n, noun));
        }
    }
    warn(&mut out, summary.warnings.iter());
    out
}
