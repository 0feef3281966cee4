//! A session as lines of text, one for each event, with the present state below them on a terminal.

use std::collections::BTreeSet;
use std::io::Write;

use indicatif::{ProgressBar, ProgressStyle};
use mimu_equipment::step::sketch;
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};

use super::answers::{Typed, of_yes};
use crate::{hint, report};

/// Number of final characters of a unit's name that identify it.
const TAIL: usize = 6;

/// Writes lines of text, JSON lines, or both.
pub(crate) struct Lines {
    /// Output of the text, if any.
    pub text: Option<Box<dyn Write>>,
    /// Output of the events, if any.
    pub events: Option<Box<dyn Write>>,
    /// Whether a person turns the unit, so that each dwell gets a sketch.
    pub sketches: bool,
    pub typed: Typed,
    pub yes: bool,
    asked: Option<Question>,
    /// The present state, on a terminal only.
    state: ProgressBar,
    /// Units that have sent a greeting. If there are several, lines name the unit.
    units: BTreeSet<String>,
}

impl Lines {
    pub(crate) fn new(typed: Typed, yes: bool) -> Self {
        let state = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{wide_msg}") {
            state.set_style(style);
        }
        Self {
            text: None,
            events: None,
            sketches: false,
            typed,
            yes,
            asked: None,
            state,
            units: BTreeSet::new(),
        }
    }

    /// Prefix of a line about one of several units: the end of its name, because ids of one production lot have a common beginning.
    fn whose(&self, event: &Event) -> String {
        let several = self.units.len() > 1;
        match several.then(|| event.unit()).flatten() {
            Some(unit) => {
                let from = unit.char_indices().rev().nth(TAIL - 1).map_or(0, |c| c.0);
                format!("{}: ", &unit[from..])
            }
            None => String::new(),
        }
    }

    fn say(&mut self, text: &str) {
        if let Some(out) = &mut self.text {
            // A reader that closed the pipe needs no more lines.
            let write = || writeln!(out, "{text}").and_then(|()| out.flush());
            let _ = self.state.suspend(write);
        }
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        self.state.finish_and_clear();
    }
}

/// The present state: of the first unit that waits, if any does.
fn state_line(state: &SessionState) -> String {
    let waiting = state.units.iter().find(|unit| unit.waiting.is_some());
    let Some(unit) = waiting.or(state.units.first()) else {
        return String::new();
    };
    let mut parts = Vec::new();
    if let Some([gyro, accel]) = unit.motion {
        let [most_gyro, most_accel] = unit.motion_limits;
        parts.push(format!(
            "motion: gyro {gyro:.2} of {most_gyro}, accel {accel:.2} of {most_accel}"
        ));
    }
    if let Some(tilt) = unit.tilt_deg {
        parts.push(format!("tilt {tilt:.1} of {} degrees", unit.tilt_limit_deg));
    }
    match (unit.rate_dps, state.step) {
        (Some(rate), Some(step)) if step.rate_dps != 0.0 => {
            parts.push(format!("{rate:+.1} of {:+.1} deg/s", step.rate_dps));
        }
        _ => {}
    }
    if let Some(spin) = &unit.spin {
        let turns = spin.turns.unwrap_or_default();
        parts.push(format!(
            "{turns:.1} of {} turns about {}",
            spin.asked, spin.axis
        ));
    }
    if let (Some(temp_c), Some(trend), Some(limit)) = (
        unit.temp_c,
        unit.trend_c_per_min,
        unit.trend_limit_c_per_min,
    ) {
        parts.push(format!("{temp_c:.1} °C, {trend:+.2} of {limit} °C/min"));
    }
    parts.extend(unit.field.clone());
    match (&unit.waiting, unit.left_s) {
        (Some(why), _) => parts.push(format!("waits: {}", hint::of_waiting(why))),
        (None, Some(left_s)) => parts.push(format!("measures, {left_s:.1} s left")),
        (None, None) => {}
    }
    parts.join("; ")
}

/// An event as a line of JSON.
pub(crate) fn write_event(out: &mut dyn Write, event: &Event) {
    if let Ok(line) = serde_json::to_string(event) {
        // A closed pipe is ignored, as in [`Lines::say`].
        let _ = writeln!(out, "{line}").and_then(|()| out.flush());
    }
}

impl View for Lines {
    fn tell(&mut self, event: &Event) {
        if let Some(out) = &mut self.events {
            write_event(out.as_mut(), event);
        }
        if let Event::Greeted { unit, .. } = event {
            self.units.insert(unit.clone());
        }
        let whose = self.whose(event);
        for line in report::wizard_lines(event) {
            self.say(&format!("{whose}{line}"));
        }
        if let Event::Step { step, .. } | Event::Spin { step, .. } = event
            && self.sketches
        {
            for line in sketch(&step.up()) {
                self.say(&line);
            }
        }
    }

    fn show(&mut self, state: &SessionState) {
        if self.text.is_some() {
            self.state.set_message(state_line(state));
        }
    }

    fn request(&mut self) -> Option<UserRequest> {
        self.typed.request()
    }

    fn ask(&mut self, question: &Question) -> Option<bool> {
        if self.yes {
            return Some(of_yes(question));
        }
        if self.asked.as_ref() != Some(question) {
            self.asked = Some(question.clone());
            self.typed.begin_question();
            self.say(&format!("{} (yes or no)", question.words()));
        }
        let answer = self.typed.answer();
        if answer.is_some() {
            self.asked = None;
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use mimu_equipment::step::Step;
    use mimu_wizard::event::UnitState;
    use mimu_wizard::waiting::Waiting;
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_state_is_that_of_the_unit_that_waits() {
        let unit = UnitState {
            motion: Some([0.5, 0.25]),
            motion_limits: [1.0; 2],
            tilt_deg: Some(3.0),
            tilt_limit_deg: 10.0,
            left_s: Some(2.5),
            ..UnitState::default()
        };
        let mut state = SessionState {
            step: Some(Step::at_rest(Vector3::z(), 5.0)),
            units: vec![unit.clone(), unit],
            ..SessionState::default()
        };
        let figures = "motion: gyro 0.50 of 1, accel 0.25 of 1; tilt 3.0 of 10 degrees";
        assert_eq!(
            state_line(&state),
            format!("{figures}; measures, 2.5 s left")
        );
        state.units[1].waiting = Some(Waiting::TableMoves);
        assert_eq!(
            state_line(&state),
            format!("{figures}; waits: the table moves")
        );
        assert_eq!(state_line(&SessionState::default()), "");
    }
}
