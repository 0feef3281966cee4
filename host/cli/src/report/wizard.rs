//! Events and result of a session of the wizard.

use maud::{Markup, html};
use mimu::quantity::{minutes, plural, significant};
use mimu_wizard::event::Event;
use mimu_wizard::folder::Part;
use mimu_wizard::refit::Progress;
use mimu_wizard::session::{Outcome, UnitOutcome};
use mimu_wizard::verdict::{FurtherJudged, Judged, SensorJudged};

use super::terminal::text;
use super::verify::whole_turns;
use crate::hint;

/// An event as lines of text; none for events that only programs need.
pub fn wizard_lines(event: &Event) -> Vec<String> {
    text(&of_event(event)).lines().map(String::from).collect()
}

fn of_event(event: &Event) -> Markup {
    html! { @match event {
        Event::Greeted { told, unit } => { @if told.is_empty() { p.line { (unit) } } @for line in told { p.line { (line) } } }
        Event::Resumed { dwells } => p.line { "the session continues after " (plural(*dwells as u64, "dwell")) },
        Event::SelfTested { words, passed, .. } => p.line { @if *passed { "self-test: " } @else { "self-test FAILED: " } (words) },
        Event::Phase { phase, words } => pre { "\n" (phase) ": " (words) },
        Event::Step { done, planned, words, .. } => p.line { "[" (done + 1) "/" (planned) "] " (words) },
        Event::Spin { done, planned, words, .. } => p.line { "[whole turns " (done + 1) "/" (planned) "] " (words) },
        Event::Turned { turns: 0, .. } => p.line { "    it has rested: turn it now" },
        Event::Turned { axis, turns, .. } => p.line { "    " (plural(u64::from(*turns), "turn")) " about " (axis) },
        Event::Spun { axis, turns, .. } => p.line { "    done: " (plural(u64::from(*turns), "turn")) " about " (axis) ", and it lies where it lay" },
        Event::SpinLost { why, .. } => p.line { "    these turns cannot be used: " (why) "; put it against the edge, let it rest, and turn it again" },
        Event::Waiting { why, .. } => p.line { "    waiting: " (hint::of_waiting(why)) },
        Event::Dwell { part: Part::Calibration, .. } => {}
        Event::Dwell { number, .. } => p.line { "    dwell " (number) " done" },
        Event::Discarded { why, .. } => p.line { "    discarded, repeat: " (hint::of_waiting(why)) },
        Event::Redo { number } => p.line { "    dwell " (number) " will be repeated" },
        Event::Progress { progress, .. } => p.line { "    " (progress_line(progress)) },
        Event::Interrupted { why, .. } => p.line { "    " (why) },
        Event::Verified { judged, .. } => (words(judged)),
        Event::Stored { hash, words, .. } => p.line { (hash) ": " (words) },
        Event::Diagnosed { verdict, effects, page, .. } => {
            p.line { "verdict: " (verdict.name()) "; " @if effects.is_empty() { "no effect was found" } @else { "found: " (effects.join(", ")) } }
            p.line { "page: " (page) }
        }
        Event::Field { words, .. } | Event::Note { words } => p.line { "    " (words) },
        // The view asks the question and waits for the answer.
        Event::Question { .. } => {}
    } }
}

/// The half-widths of a calibration with their targets, in one line.
pub(crate) fn progress_line(progress: &Progress) -> String {
    if progress.sensors.is_empty() {
        let why = progress.not_yet.as_ref().map(|why| format!(": {why}"));
        return format!("done; not determined yet{}", why.unwrap_or_default());
    }
    let sensors = progress.sensors.iter().map(|sensor| {
        let aims = sensor.aims.iter().map(|aim| {
            let mark = if aim.half_width > aim.target { "!" } else { "" };
            let (name, half) = (aim.parameter.name(), significant(aim.half_width));
            format!(" {name} ±{half}{mark}")
        });
        format!(" {}{}", sensor.sensor, aims.collect::<String>())
    });
    format!("done;{}", sensors.collect::<Vec<_>>().join(";"))
}

fn words(judged: &Judged) -> Markup {
    html! {
        p.line { "judgement: " (judged.judgement) }
        @for of in &judged.sensors { p.line { (sensor(of)) } }
        @for turned in &judged.whole_turns { p.line { "gyro  " (whole_turns(turned)) } }
        @for of in &judged.further { (further(of)) }
        @for broken in &judged.broken { p.line { "FAILED, nothing was stored: " (broken) } }
    }
}

fn further(of: &FurtherJudged) -> Markup {
    let left_out: Vec<String> = of.left_out_dwells.iter().map(i32::to_string).collect();
    html! {
        @if of.in_file { p.line { (of.triad) " is judged " (of.judgement) } }
        @else { p.line { (of.triad) " is not in the file: " (of.judgement) } }
        @if !left_out.is_empty() { p.line { (of.triad) ": left out, because the other poses contradict them: dwells " (left_out.join(", ")) } }
    }
}

fn sensor(of: &SensorJudged) -> Markup {
    let (factor, unit) = of.figure.readable(of.sensor);
    let [before, affine, after, floor] =
        [of.before, of.affine, of.after, of.floor].map(|si| significant(si * factor));
    html! {
        (format!("{:5} error of ", of.sensor.name())) (of.figure.description()) " in poses that the fit has not used: data sheet " (before) ", calibrated "
        @if of.affine != of.after { (affine) ", with effects " } (after) " " (unit) "; noise alone " (floor) (format!(" ({:.2} times the noise)", of.after / of.floor))
    }
}

/// Result of a session.
pub fn wizard_text(outcome: &Outcome) -> String {
    match outcome.cancelled {
        true => "\nended; the same command resumes here\n".into(),
        false => outcome
            .units
            .iter()
            .map(|unit| format!("\n{}", text(&document(unit))))
            .collect(),
    }
}

fn document(unit: &UnitOutcome) -> Markup {
    html! {
        p.line { (unit.unit) ": " (plural(unit.dwells as u64, "dwell")) " in " (minutes(unit.recorded_s)) ", " (unit.discarded) " discarded" }
        @if let Some(clock) = &unit.clock { p.line { "time: " (clock.described()) } }
        @if let Some(judged) = unit.confirmed.as_ref().or(unit.verified.as_ref()) { (words(judged)) }
        @if let Some(verdict) = &unit.verdict { p.line { "diagnosis: " (verdict.name()) ", " @if unit.effects.is_empty() { "no effect" } @else { (unit.effects.join(", ")) } } }
        @match &unit.stored { Some(file) => p.line { "in use: " (file) }, None => p.line { "nothing was stored" } }
        @for note in &unit.notes { p.line { "note: " (note) } }
        @if let Some(page) = &unit.page { p.line { "page: " (page) } }
    }
}
