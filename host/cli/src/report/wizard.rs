//! Events and result of a session of the wizard.

use maud::{Markup, html};
use mimu::quantity::{minutes, plural, significant};
use mimu_wizard::event::Event;
use mimu_wizard::folder::Part;
use mimu_wizard::refit::Progress;
use mimu_wizard::session::{Outcome, UnitOutcome};
use mimu_wizard::verdict::{Judged, SensorJudged};

use super::terminal::text;
use super::verify::whole_turns;
use crate::hint;

/// An event as lines of text; none for events that only programs need.
pub fn wizard_lines(event: &Event) -> Vec<String> {
    let line = match event {
        Event::Greeted { told, unit } if told.is_empty() => unit.clone(),
        Event::Greeted { told, .. } => return told.clone(),
        Event::Resumed { dwells } => format!(
            "the session continues after {}",
            plural(*dwells as u64, "dwell")
        ),
        Event::SelfTested {
            words,
            passed: true,
            ..
        } => format!("self-test: {words}"),
        Event::SelfTested { words, .. } => format!("self-test FAILED: {words}"),
        Event::Phase { phase, words } => return vec![String::new(), format!("{phase}: {words}")],
        Event::Step {
            done,
            planned,
            words,
            ..
        } => format!("[{}/{planned}] {words}", done + 1),
        Event::Spin {
            done,
            planned,
            words,
            ..
        } => format!("[whole turns {}/{planned}] {words}", done + 1),
        Event::Turned { turns: 0, .. } => "    it has rested: turn it now".into(),
        Event::Turned { axis, turns, .. } => {
            format!("    {} about {axis}", plural(u64::from(*turns), "turn"))
        }
        Event::Spun { axis, turns, .. } => format!(
            "    done: {} about {axis}, and it lies where it lay",
            plural(u64::from(*turns), "turn")
        ),
        Event::SpinLost { why, .. } => {
            format!(
                "    these turns cannot be used: {why}; put it against the edge, let it rest, and turn it again"
            )
        }
        Event::Waiting { why, .. } => format!("    waiting: {}", hint::of_waiting(why)),
        Event::Dwell {
            part: Part::Calibration,
            ..
        } => return Vec::new(),
        Event::Dwell { number, .. } => format!("    dwell {number} done"),
        Event::Discarded { why, .. } => format!("    discarded, repeat: {}", hint::of_waiting(why)),
        Event::Redo { number } => format!("    dwell {number} will be repeated"),
        Event::Progress { progress, .. } => format!("    {}", progress_line(progress)),
        Event::Interrupted { why, .. } => format!("    {why}"),
        Event::Verified { judged, .. } => return judged_lines(judged),
        Event::Stored { hash, words, .. } => format!("{hash}: {words}"),
        Event::Diagnosed {
            verdict,
            effects,
            page,
            ..
        } => {
            let found = if effects.is_empty() {
                "no effect was found".into()
            } else {
                format!("found: {}", effects.join(", "))
            };
            return vec![
                format!("verdict: {}; {found}", verdict.name()),
                format!("page: {page}"),
            ];
        }
        Event::Note { words } => format!("    {words}"),
        // The view asks the question and waits for the answer.
        Event::Question { .. } => return Vec::new(),
    };
    vec![line]
}

/// The half-widths of a calibration with their targets, in one line.
pub(crate) fn progress_line(progress: &Progress) -> String {
    if progress.sensors.is_empty() {
        let why = progress.not_yet.as_ref().map(|why| format!(": {why}"));
        return format!("done; not determined yet{}", why.unwrap_or_default());
    }
    let sensors = progress.sensors.iter().map(|sensor| {
        let aims = sensor.aims.iter().map(|aim| {
            let mark = if aim.half_width <= aim.target {
                ""
            } else {
                "!"
            };
            format!(
                " {} ±{}{mark}",
                aim.parameter.name(),
                significant(aim.half_width)
            )
        });
        format!(" {}{}", sensor.sensor, aims.collect::<String>())
    });
    format!("done;{}", sensors.collect::<Vec<_>>().join(";"))
}

fn judged_lines(judged: &Judged) -> Vec<String> {
    text(&words(judged)).lines().map(String::from).collect()
}

fn words(judged: &Judged) -> Markup {
    html! {
        p.line { "judgement: " (judged.judgement) }
        @for of in &judged.sensors { p.line { (sensor(of)) } }
        @for turned in &judged.whole_turns { p.line { "gyro  " (whole_turns(turned)) } }
        @for broken in &judged.broken { p.line { "FAILED, nothing was stored: " (broken) } }
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
