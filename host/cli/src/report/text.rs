//! Lines and warnings of all text results.

use std::fmt::{Display, Write as _};
use std::sync::OnceLock;

use mimu::quantity::plural;
use mimu::recording_problem::OfRecording;

/// Width of text that does not go to a terminal, characters.
const COLUMNS: usize = 98;
/// Narrowest and widest text: narrower, tables no longer fold; wider, lines are hard to follow.
const WIDTHS: std::ops::RangeInclusive<usize> = 60..=120;

/// Width of text, characters: that of the terminal, if the text goes to one.
pub(crate) fn columns() -> usize {
    static FOUND: OnceLock<usize> = OnceLock::new();
    *FOUND.get_or_init(|| {
        let width = terminal().map(|width| width.clamp(*WIDTHS.start(), *WIDTHS.end()));
        width.unwrap_or(COLUMNS)
    })
}

#[cfg(not(target_family = "wasm"))]
fn terminal() -> Option<usize> {
    let (terminal_size::Width(width), _) = terminal_size::terminal_size_of(std::io::stdout())?;
    Some(width.into())
}

/// A page has no terminal.
#[cfg(target_family = "wasm")]
fn terminal() -> Option<usize> {
    None
}

/// Wraps `head` and `text`. Further lines are indented to the beginning of the text, or only a little if the head is long.
pub(super) fn wrap(out: &mut String, head: &str, text: &str) {
    let first = head.chars().count();
    let spaces = head.chars().take_while(|c| *c == ' ').count();
    let width = columns();
    let indent = if first > width / 3 { spaces + 2 } else { first };
    let (mut line, mut begun) = (head.to_string(), false);
    for word in text.split(' ') {
        let longer = line.chars().count() + usize::from(begun) + word.chars().count();
        if begun && longer > width {
            let _ = writeln!(out, "{line}");
            (line, begun) = (" ".repeat(indent), false);
        }
        if begun {
            line.push(' ');
        }
        line.push_str(word);
        begun = true;
    }
    let _ = writeln!(out, "{line}");
}

pub(crate) fn warn(out: &mut String, warnings: impl Iterator<Item = impl Display>) {
    for warning in warnings {
        let _ = writeln!(out, "warning: {warning}");
    }
}

/// Largest number of lines of a summary.
pub(crate) const SUMMARY: usize = 25;
/// Largest number of these lines for faults of the recording.
const OF_PROBLEMS: usize = 7;

/// Faults of a recording, or with `several` of recordings, one per line. They are not wrapped, so that programs can find them. Unless `verbose`, only
/// the first few.
pub(crate) fn problems(out: &mut String, problems: &[OfRecording], several: bool, verbose: bool) {
    if problems.is_empty() {
        return;
    }
    let which = if several {
        "these recordings"
    } else {
        "this recording"
    };
    let _ = writeln!(out, "problems of {which}:");
    let shown = if verbose { problems.len() } else { OF_PROBLEMS };
    for OfRecording { recording, problem } in problems.iter().take(shown) {
        let _ = match several {
            true => writeln!(out, "  - {recording}: {problem}"),
            false => writeln!(out, "  - {problem}"),
        };
    }
    if problems.len() > shown {
        let _ = writeln!(out, "  - and {} more (--verbose)", problems.len() - shown);
    }
}

/// The first of each kind, with the number of the others.
pub(crate) fn kinds<'a, W: 'a>(
    warnings: impl Iterator<Item = &'a W>,
    is_like: impl Fn(&W, &W) -> bool,
) -> impl Iterator<Item = (&'a W, usize)> {
    let mut kinds: Vec<(&W, usize)> = Vec::new();
    for warning in warnings {
        match kinds.iter_mut().find(|(w, _)| is_like(w, warning)) {
            Some((_, more)) => *more += 1,
            None => kinds.push((warning, 0)),
        }
    }
    kinds.into_iter()
}

/// `warning`, and the number of others of its kind.
pub(crate) fn counted(warning: String, more: usize) -> String {
    match more {
        0 => warning,
        more => format!("{warning} ({more} more of this kind: --verbose)"),
    }
}

/// As many warnings as fit into a summary with `after` further lines, one per line, and the number of the others.
pub(crate) fn warn_within(out: &mut String, warnings: impl Iterator<Item = String>, after: usize) {
    let warnings: Vec<String> = warnings.collect();
    let room = SUMMARY.saturating_sub(out.lines().count() + after);
    let shown = match warnings.len() <= room {
        true => warnings.len(),
        false => room.saturating_sub(1),
    };
    warn(out, warnings.iter().take(shown));
    let left = (warnings.len() - shown) as u64;
    if left > 0 {
        let _ = writeln!(out, "warning: {} (--verbose)", plural(left, "more warning"));
    }
}
