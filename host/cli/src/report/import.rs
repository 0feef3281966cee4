//! An import.

use maud::{Markup, html};
use mimu::quantity::{plural, significant};
use mimu_recording::{ImportSummary, TimeSummary, TriadName};

use super::page::all_warnings;
use super::terminal::text;
use crate::output::quoted;

/// Result of `mimu import`.
pub fn import_text(summary: &ImportSummary) -> String {
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
        (
            summary.not_chosen,
            "row",
            "left out: not chosen by --where or --rows",
        ),
        (summary.padding, "row", "left out: all readings are 0"),
        (summary.empty_cells, "raw cell", "empty"),
    ];
    let said: Vec<String> = summary.arguments.iter().map(|a| quoted(a)).collect();
    text(&html! {
        p {
            (summary.recording) ": "
            @if summary.means { "means of " (plural(summary.rows, "pose")) } @else { (plural(summary.rows, "row")) " at " (summary.sample_rate_hz) " Hz" }
        }
        section {
            @if let Some(preset) = &summary.preset { ul class="lines" data-head="" { li {
                "read with the preset " (preset.name) ", " (if preset.recognised { "recognised by the header" } else { "as given" }) ": " (preset.title)
            } } }
            @for line in &summary.taken { p { (line) } }
            @if !summary.taken.is_empty() { p data-head="the same in full: " { "mimu import " (said.join(" ")) " -o DIR" } }
            @if summary.triads.iter().any(|t| ![TriadName::GYRO, TriadName::ACCEL].contains(t)) { p data-head="triads: " {
                (summary.triads.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "))
            } }
            ul class="lines" data-head="" {
                @for time in &summary.time { li { (time.file) ": " (time_of(time)) } }
                @for note in &summary.notes { li { (note) } }
                @for (n, noun, what) in counts { @if n > 0 { li { (plural(n, noun)) " " (what) } } }
                @for broken in &summary.broken_rows {
                    li { (broken.file) ": left out: " (broken) }
                    @for kind in &broken.kinds { li { "  " (kind.example) } }
                }
            }
        }
        (all_warnings(&summary.warnings))
    })
}

/// Findings about the time stamps of a file.
fn time_of(time: &TimeSummary) -> Markup {
    let [rms, max] = [time.jitter.rms_s, time.jitter.max_s].map(|s| significant(1e3 * s));
    html! {
        @match (time.unit, time.recognised) {
            (None, recognised) if time.counter => { "times " (if recognised { "taken as" } else { "from" }) " a counter of samples" }
            (Some(unit), true) => { "time stamps assumed to be in " (unit) }
            (Some(unit), false) => { "time stamps in " (unit) }
            (None, _) => "times scaled",
        }
        @if time.origin_s != 0 { " counted from " (time.origin_s) " s" }
        ", " (time.rate_hz) " Hz for " (significant(time.lasts_s)) " s; "
        @match (time.stamps_kept, time.jitter.max_s > 0.0) {
            (true, _) if time.polled.is_some() => "the stamps are kept: a polling loop reads once a round",
            (true, false) if time.counter => "its numbers are kept",
            (true, false) => "the stamps are kept",
            (true, true) => { "the stamps are kept: their intervals are multiples of one period to " (rms) " ms rms, " (max) " ms at most" }
            (false, _) => { "the stamps are off by " (rms) " ms rms, " (max) " ms at most: the sample count is used as the clock" }
        }
        @if time.gaps > 0 {
            "; " (plural(time.missing, "missing sample")) " in " (plural(time.gaps, "gap")) ", the longest of " (significant(time.longest_gap_s)) " s"
        }
        @if let Some(rate) = time.rate_in_bursts_hz { "; if the samples themselves come in bursts with pauses, give the rate in the bursts: --rate-hz " (rate) }
        @if time.repeated_rows > 0 { "; " (plural(time.repeated_rows, "row")) " left out because they repeat the row before" }
    }
}
