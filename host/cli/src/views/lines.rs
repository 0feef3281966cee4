//! A session as lines of text, one for each event: for pipes, logs and small terminals.

use std::collections::BTreeSet;
use std::io::Write;

use mimu_equipment::step::sketch;
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};

use super::answers::{Typed, of_yes};
use crate::report;

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
    /// Units that have sent a greeting. If there are several, lines name the unit.
    units: BTreeSet<String>,
}

impl Lines {
    pub(crate) fn new(typed: Typed, yes: bool) -> Self {
        Self {
            text: None,
            events: None,
            sketches: false,
            typed,
            yes,
            asked: None,
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
            let _ = writeln!(out, "{text}").and_then(|()| out.flush());
        }
    }
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

    fn show(&mut self, _: &SessionState) {}

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
