//! Events and result of a session of the wizard, as text.

use std::fmt::Write as _;

use mimu::quantity::{minutes, plural, significant};
use mimu_wizard::event::Event;
use mimu_wizard::folder::Part;
use mimu_wizard::refit::Progress;
use mimu_wizard::session::{Outcome, UnitOutcome};
use mimu_wizard::verdict::{Judged, SensorJudged};

use crate::hint;
use crate::report::verify::whole_turns;

/// An event as lines of text; none for events that only programs need.
pub fn wizard_lines(event: &Event) -> Vec<String> {
    match event {
        Event::Greeted { told, unit } => {
            let mut lines: Vec<String> = told.clone();
            if lines.is_empty() {
                lines.push(unit.clone());
            }
            lines
        }
        Event::Resumed { dwells } => vec![format!(
            "the session continues after {}",
            plural(*dwells as u64, "dwell")
        )],
        Event::SelfTested { words, passed, .. } => vec![match passed {
            true => format!("self-test: {words}"),
            false => format!("self-test FAILED: {words}"),
        }],
        Event::Phase { phase, words } => vec![String::new(), format!("{phase}: {words}")],
        Event::Step {
            done,
            planned,
            words,
            ..
        } => vec![format!("[{}/{planned}] {words}", done + 1)],
        Event::Spin {
            done,
            planned,
            words,
            ..
        } => vec![format!("[whole turns {}/{planned}] {words}", done + 1)],
        Event::Turned { axis, turns, .. } => vec![match turns {
            0 => "    it has rested: turn it now".into(),
            turns => format!("    {} about {axis}", plural(u64::from(*turns), "turn")),
        }],
        Event::Spun { axis, turns, .. } => vec![format!(
            "    done: {} about {axis}, and it lies where it lay",
            plural(u64::from(*turns), "turn")
        )],
        Event::SpinLost { why, .. } => vec![format!(
            "    these turns cannot be used: {why}; put it against the edge, let it rest, and turn it again"
        )],
        Event::Waiting { why, .. } => vec![format!("    waiting: {}", hint::of_waiting(why))],
        Event::Dwell { part, number, .. } => match part {
            Part::Calibration => Vec::new(),
            _ => vec![format!("    dwell {number} done")],
        },
        Event::Discarded { why, .. } => {
            vec![format!("    discarded, repeat: {}", hint::of_waiting(why))]
        }
        Event::Redo { number } => vec![format!("    dwell {number} will be repeated")],
        Event::Progress { progress, .. } => vec![format!("    {}", progress_line(progress))],
        Event::Interrupted { why, .. } => vec![format!("    {why}")],
        Event::Verified { judged, .. } => judged_lines(judged),
        Event::Stored { hash, words, .. } => vec![format!("{hash}: {words}")],
        Event::Diagnosed {
            verdict,
            effects,
            page,
            ..
        } => {
            let found = match effects.is_empty() {
                true => "no effect was found".to_string(),
                false => format!("found: {}", effects.join(", ")),
            };
            vec![
                format!("verdict: {}; {found}", verdict.name()),
                format!("page: {page}"),
            ]
        }
        Event::Note { words } => vec![format!("    {words}")],
        // The view asks the question and waits for the answer.
        Event::Question { .. } => Vec::new(),
    }
}

/// The half-widths of a calibration with their targets, in one line.
pub(crate) fn progress_line(progress: &Progress) -> String {
    if progress.sensors.is_empty() {
        return match &progress.not_yet {
            Some(why) => format!("done; not determined yet: {why}"),
            None => "done; not determined yet".into(),
        };
    }
    let mut text = String::from("done;");
    for sensor in &progress.sensors {
        let _ = write!(text, " {}", sensor.sensor);
        for aim in &sensor.aims {
            let mark = if aim.half_width <= aim.target {
                ""
            } else {
                "!"
            };
            let _ = write!(
                text,
                " {} ±{}{mark}",
                aim.parameter.name(),
                significant(aim.half_width)
            );
        }
        text.push(';');
    }
    text.pop();
    text
}

fn judged_lines(judged: &Judged) -> Vec<String> {
    let mut lines = vec![format!("judgement: {}", judged.judgement)];
    lines.extend(judged.sensors.iter().map(judged_line));
    let turned = judged.whole_turns.iter().map(whole_turns);
    lines.extend(turned.map(|turned| format!("gyro  {turned}")));
    lines.extend(
        judged
            .broken
            .iter()
            .map(|b| format!("FAILED, nothing was stored: {b}")),
    );
    lines
}

fn judged_line(of: &SensorJudged) -> String {
    let (factor, unit) = of.figure.readable(of.sensor);
    let shown = |si: f64| significant(si * factor);
    let mut text = format!(
        "{:5} error of {} in poses that the fit has not used: ",
        of.sensor.name(),
        of.figure.description()
    );
    let _ = write!(text, "data sheet {}, ", shown(of.before));
    if of.affine != of.after {
        let _ = write!(
            text,
            "calibrated {}, with effects {}",
            shown(of.affine),
            shown(of.after)
        );
    } else {
        let _ = write!(text, "calibrated {}", shown(of.after));
    }
    let _ = write!(
        text,
        " {unit}; noise alone {} ({:.2} times the noise)",
        shown(of.floor),
        of.after / of.floor
    );
    text
}

/// Result of a session.
pub fn wizard_text(outcome: &Outcome) -> String {
    let mut text = String::new();
    if outcome.cancelled {
        text.push_str("\nended; the same command resumes here\n");
        return text;
    }
    for unit in &outcome.units {
        unit_text(unit, &mut text);
    }
    text
}

fn unit_text(unit: &UnitOutcome, text: &mut String) {
    let _ = writeln!(
        text,
        "\n{}: {} in {}, {} discarded",
        unit.unit,
        plural(unit.dwells as u64, "dwell"),
        minutes(unit.recorded_s),
        unit.discarded
    );
    if let Some(clock) = &unit.clock {
        let _ = writeln!(text, "time: {}", clock.described());
    }
    let judged = unit.confirmed.as_ref().or(unit.verified.as_ref());
    for line in judged.into_iter().flat_map(judged_lines) {
        let _ = writeln!(text, "{line}");
    }
    if let Some(verdict) = &unit.verdict {
        let effects = match unit.effects.as_slice() {
            [] => "no effect".into(),
            effects => effects.join(", "),
        };
        let _ = writeln!(text, "diagnosis: {}, {effects}", verdict.name());
    }
    match &unit.stored {
        Some(file) => {
            let _ = writeln!(text, "in use: {file}");
        }
        None => text.push_str("nothing was stored\n"),
    }
    for note in &unit.notes {
        let _ = writeln!(text, "note: {note}");
    }
    if let Some(page) = &unit.page {
        let _ = writeln!(text, "page: {page}");
    }
}
