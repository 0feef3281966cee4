//! An import as text.

use std::fmt::Write as _;

use mimu::quantity::{plural, significant};
use mimu_recording::{ImportSummary, TimeSummary};

use crate::output::quoted;
use crate::report::text::{warn, wrap};

/// Result of `mimu import`.
pub fn import_text(summary: &ImportSummary) -> String {
    let mut out = String::new();
    let _ = match summary.means {
        true => writeln!(
            out,
            "{}: means of {}",
            summary.recording,
            plural(summary.rows, "pose")
        ),
        false => writeln!(
            out,
            "{}: {} at {} Hz",
            summary.recording,
            plural(summary.rows, "row"),
            summary.sample_rate_hz
        ),
    };
    if let Some(preset) = &summary.preset {
        let whence = match preset.recognised {
            true => "recognised by the header",
            false => "as given",
        };
        let _ = writeln!(
            out,
            "  read with the preset {}, {whence}: {}",
            preset.name, preset.title
        );
    }
    if !summary.taken.is_empty() {
        for line in &summary.taken {
            wrap(&mut out, "  ", line);
        }
        let said = summary.arguments.iter().map(|a| quoted(a));
        let said: Vec<String> = said.collect();
        wrap(
            &mut out,
            "  the same in full: ",
            &format!("mimu import {} -o DIR", said.join(" ")),
        );
    }
    for time in &summary.time {
        let _ = writeln!(out, "  {}: {}", time.file, time_text(time));
    }
    for note in &summary.notes {
        let _ = writeln!(out, "  {note}");
    }
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
    for (n, noun, what) in counts {
        if n > 0 {
            let _ = writeln!(out, "  {} {what}", plural(n, noun));
        }
    }
    for broken in &summary.broken_rows {
        let _ = writeln!(out, "  {}: left out: {broken}", broken.file);
        for kind in &broken.kinds {
            let _ = writeln!(out, "    {}", kind.example);
        }
    }
    warn(&mut out, summary.warnings.iter());
    out
}

/// Findings about the time stamps of a file.
fn time_text(time: &TimeSummary) -> String {
    let mut out = match (time.unit, time.recognised) {
        (None, recognised) if time.counter => {
            let taken = if recognised { "taken as" } else { "from" };
            format!("times {taken} a counter of samples")
        }
        (Some(unit), true) => format!("time stamps assumed to be in {unit}"),
        (Some(unit), false) => format!("time stamps in {unit}"),
        (None, _) => "times scaled".into(),
    };
    if time.origin_s != 0 {
        let _ = write!(out, " counted from {} s", time.origin_s);
    }
    let lasts = significant(time.lasts_s);
    let _ = write!(out, ", {} Hz for {lasts} s; ", time.rate_hz);
    let [rms, max] = [time.jitter.rms_s, time.jitter.max_s].map(|s| significant(1e3 * s));
    let _ = match (time.stamps_kept, time.jitter.max_s > 0.0) {
        (true, _) if time.polled.is_some() => write!(
            out,
            "the stamps are kept: a polling loop reads once a round"
        ),
        (true, false) if time.counter => write!(out, "its numbers are kept"),
        (true, false) => write!(out, "the stamps are kept"),
        (true, true) => write!(
            out,
            "the stamps are kept: their intervals are multiples of one period to {rms} ms rms, {max} ms at most"
        ),
        (false, _) => write!(
            out,
            "the stamps are off by {rms} ms rms, {max} ms at most: the sample count is used as the clock"
        ),
    };
    if time.gaps > 0 {
        let _ = write!(
            out,
            "; {} in {}, the longest of {} s",
            plural(time.missing, "missing sample"),
            plural(time.gaps, "gap"),
            significant(time.longest_gap_s)
        );
    }
    if let Some(rate) = time.rate_in_bursts_hz {
        let _ = write!(
            out,
            "; if the samples themselves come in bursts with pauses, give the rate in the bursts: --rate-hz {rate}"
        );
    }
    if time.repeated_rows > 0 {
        let _ = write!(
            out,
            "; {} left out because they repeat the row before",
            plural(time.repeated_rows, "row")
        );
    }
    out
}
