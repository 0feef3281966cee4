//! Pages: single, self-contained HTML files; and what documents of several results have in common.
//!
//! A page is valid XML too, so that any parser can read it. Each number is a `data` element with the value from the JSON.

use std::fmt::Display;
use std::path::PathBuf;

use maud::{Markup, PreEscaped, html};
use mimu::{Judgement, OfRecording, Readable, Sensor, significant};

use super::terminal::text;
use crate::output::now;

/// How much of a result its document has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Level {
    /// Text of at most 25 lines.
    Summary,
    /// Text with everything.
    Verbose,
    /// Everything, with figures.
    Page,
}

impl Level {
    pub(super) fn of(verbose: bool) -> Self {
        if verbose {
            Self::Verbose
        } else {
            Self::Summary
        }
    }

    pub(super) fn is_page(self) -> bool {
        self == Self::Page
    }

    pub(super) fn has_all(self) -> bool {
        self >= Self::Verbose
    }
}

/// Origin of a page.
#[derive(Debug, Clone)]
pub struct Made {
    /// Recording, as given.
    pub recording: String,
    /// Command line.
    pub command: String,
    /// Date and time.
    pub created: String,
}

impl Made {
    /// A page made now of `recordings` by the command line `command`.
    pub(crate) fn of(recordings: &[PathBuf], command: &str) -> Self {
        let named = recordings.iter().map(|r| r.display().to_string());
        Self {
            recording: named.collect::<Vec<_>>().join(", "),
            command: command.to_owned(),
            created: now(),
        }
    }

    /// The last line of a page that `tool` has made.
    pub(super) fn line(&self, tool: &str) -> Markup {
        html! { p class="dim" { (tool) ", " (self.created) ": " code { (self.command) } } }
    }
}

/// Style of the figures, and of the whole page.
pub(super) const FIGURES: &str = include_str!("page/figures.css");
pub(super) const STYLE: &str = concat!(
    include_str!("page/figures.css"),
    include_str!("page/style.css")
);
/// Elements without an end tag, closed as XML requires.
const META: &str = r#"<meta charset="utf-8"/><meta name="viewport" content="width=device-width, initial-scale=1"/>"#;

/// The page with this title.
pub(super) fn page(title: &str, main: &Markup) -> String {
    let page = html! {
        (PreEscaped("<!DOCTYPE html>"))
        html lang="en" xmlns="http://www.w3.org/1999/xhtml" {
            head { (PreEscaped(META)) title { (title) } style { (PreEscaped(STYLE)) } }
            body { main { (main) } }
        }
    };
    page.into_string() + "\n"
}

/// The table of contents: id and name of each section, and whether it is there.
pub(super) fn contents(sections: &[(&str, &str, bool)]) -> Markup {
    html! { nav aria-label="Contents" { ul class="contents" {
        @for (id, name, _) in sections.iter().filter(|(.., is_there)| *is_there) { li { a href={ "#" (id) } { (name) } } }
    } } }
}

/// A judgement, as the first thing of a page. In the class `line` a terminal does not wrap it.
pub(super) fn judged(judgement: &Judgement, class: &str) -> Markup {
    let kind = judgement.kind.name();
    html! { p data-head="judgement: " class={ "judged " (kind) " " (class) } { strong { (kind) } ": " (judgement.reason) } }
}

/// Faults of recordings in a summary.
const OF_PROBLEMS: usize = 7;

/// Faults of a recording, or with `several` of recordings. They are not wrapped, so that programs can find them. A summary has only the first few.
pub(super) fn problems(problems: &[OfRecording], several: bool, level: Level) -> Markup {
    html! { @if !problems.is_empty() {
        @let which = if several { "these recordings" } else { "this recording" };
        @let shown = if level.has_all() { problems.len() } else { OF_PROBLEMS };
        @if level.is_page() { h2 { "Problems of " (which) } } @else { p { "problems of " (which) ":" } }
        ul.lines {
            @for OfRecording { recording, problem } in problems.iter().take(shown) { li data-problem=(problem.id()) { @if several { (recording) ": " } (problem) } }
            @if problems.len() > shown { li { "and " (problems.len() - shown) " more (--verbose)" } }
        }
    } }
}

/// Faults of recordings as text.
pub(crate) fn problems_text(all: &[OfRecording], several: bool, verbose: bool) -> String {
    text(&problems(all, several, Level::of(verbose)))
}

/// Warnings in words. Unless `all`, one of each kind with the number of the others.
pub(super) fn kinds<'a, W: 'a>(
    warnings: impl Iterator<Item = &'a W>,
    is_like: impl Fn(&W, &W) -> bool,
    say: impl Fn(&W) -> String,
    all: bool,
) -> Vec<String> {
    let mut kinds: Vec<(&W, usize)> = Vec::new();
    for warning in warnings {
        match kinds.iter_mut().find(|(w, _)| !all && is_like(w, warning)) {
            Some((_, more)) => *more += 1,
            None => kinds.push((warning, 0)),
        }
    }
    let said = kinds.into_iter().map(|(warning, more)| match more {
        0 => say(warning),
        more => format!("{} ({more} more of this kind: --verbose)", say(warning)),
    });
    said.collect()
}

/// Warnings, one per line, so that programs can find them. A summary has as many as fit with `after` further lines of the command.
pub(super) fn warnings(all: &[String], level: Level, after: usize) -> Markup {
    let class = if level.has_all() { "lines" } else { "fitted" };
    html! { @if !all.is_empty() {
        @if level.has_all() { h2 { "To know" } }
        ul class=(class) data-head="warning: " data-after=(after) { @for warning in all { li { (warning) } } }
    } }
}

/// Warnings that are all shown.
pub(super) fn all_warnings(all: impl IntoIterator<Item = impl Display>) -> Markup {
    let all: Vec<_> = all.into_iter().collect();
    html! { @if !all.is_empty() { ul class="lines" data-head="warning: " { @for warning in &all { li { (warning) } } } } }
}

/// A number in readable form, with the value from the JSON.
pub(super) fn shown(si: f64, factor: f64, unit: &str) -> Markup {
    html! { @if si.is_finite() { data value=(si) { (written(&significant(si * factor))) @if !unit.is_empty() { " " (unit) } } } @else { "–" } }
}

/// A number in a unit that people read.
pub(super) fn quantity(si: f64, unit: &Readable) -> Markup {
    shown(si, unit.factor, &unit.unit)
}

/// `text` with a minus sign instead of a hyphen, and powers of ten in superscript.
pub(super) fn written(text: &str) -> String {
    let text = match text.split_once('e') {
        Some((digits, power)) if power.parse::<i32>().is_ok() => {
            format!("{digits}·10{}", raised(power))
        }
        _ => text.into(),
    };
    text.replace('-', "−")
}

/// Name of a sensor in a sentence.
pub(super) fn spoken(sensor: Sensor) -> &'static str {
    sensor.pick("gyro", "accelerometer")
}

/// Digits as superscripts.
pub(super) fn raised(text: &str) -> String {
    let one = |c: char| match c.to_digit(10) {
        Some(digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize).unwrap_or(c),
        None if c == '-' => '⁻',
        None => c,
    };
    text.chars().map(one).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn only_a_power_of_ten_is_written_as_one() {
        assert_eq!(super::written("-0.2 (fixed)"), "−0.2 (fixed)");
        assert_eq!(super::written("1.5e-7"), "1.5·10⁻⁷");
    }
}
