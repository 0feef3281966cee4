//! A session on the full screen of a terminal, which is restored however the program ends.

use std::io::{IsTerminal as _, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use mimu_recording::error::{Error, Result};
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event as keys;
use ratatui::crossterm::event::{KeyCode, KeyEventKind, KeyModifiers};

use super::answers::of_yes;
use super::lines::write_event;
use super::picture::{LEAST, Shown, draw};
use crate::report;

/// Number of log entries kept: more than any screen shows.
const KEPT: usize = 200;
/// Interval of checking for the end while waiting for a key.
const POLL: Duration = Duration::from_millis(100);

/// Meaning of a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Key {
    Cancel,
    Redo,
    Skip,
    Yes,
    No,
}

impl Key {
    fn of(code: KeyCode, modifiers: KeyModifiers) -> Option<Self> {
        match code {
            KeyCode::Char('c') if modifiers.contains(KeyModifiers::CONTROL) => Some(Self::Cancel),
            KeyCode::Char('q') => Some(Self::Cancel),
            KeyCode::Char('r') => Some(Self::Redo),
            KeyCode::Char('s') => Some(Self::Skip),
            KeyCode::Char('y') => Some(Self::Yes),
            KeyCode::Char('n') => Some(Self::No),
            _ => None,
        }
    }
}

/// The terminal in full-screen mode, from creation to drop.
struct Taken {
    terminal: DefaultTerminal,
}

impl Drop for Taken {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

/// The full screen.
pub(crate) struct Screen {
    taken: Taken,
    keys: Receiver<Key>,
    keyboard: Option<JoinHandle<()>>,
    ended: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    /// Output of the events, if any.
    events: Option<Box<dyn Write>>,
    yes: bool,
    standing: SessionState,
    log: Vec<String>,
    question: Option<Question>,
    answer: Option<bool>,
}

impl Screen {
    /// Whether standard input and output are a terminal that is large enough.
    pub(crate) fn fits() -> bool {
        let at_terminal = std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
        let size = ratatui::crossterm::terminal::size();
        at_terminal && size.is_ok_and(|(w, h)| w >= LEAST[0] && h >= LEAST[1])
    }

    /// Takes over the terminal. `stop` is set from outside to end the session.
    pub(crate) fn new(
        stop: Arc<AtomicBool>,
        yes: bool,
        events: Option<Box<dyn Write>>,
    ) -> Result<Self> {
        let failed = |error: std::io::Error| {
            Error::new("terminal", error, "run it with --plain for lines of text")
        };
        // ratatui's hook restores the terminal before a panic is reported. Otherwise the message would vanish with the screen.
        let taken = Taken {
            terminal: ratatui::try_init().map_err(failed)?,
        };
        let (tell, keys) = channel();
        let ended = Arc::new(AtomicBool::new(false));
        let (end, stopped) = (ended.clone(), stop.clone());
        let keyboard = std::thread::Builder::new()
            .name("keyboard".into())
            .spawn(move || listen(&tell, &end, &stopped))
            .map_err(failed)?;
        Ok(Self {
            taken,
            keys,
            keyboard: Some(keyboard),
            ended,
            stop,
            events,
            yes,
            standing: SessionState::default(),
            log: Vec::new(),
            question: None,
            answer: None,
        })
    }

    fn draw(&mut self) {
        let question = self.question.as_ref().map(Question::words);
        let shown = Shown {
            standing: &self.standing,
            log: &self.log,
            question: question.as_deref(),
        };
        // A closed terminal shows nothing, but the session's files contain all results.
        let _ = self.taken.terminal.draw(|frame| draw(frame, &shown));
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(keyboard) = self.keyboard.take() {
            let _ = keyboard.join();
        }
    }
}

impl View for Screen {
    fn tell(&mut self, event: &Event) {
        if let Some(out) = &mut self.events {
            write_event(out.as_mut(), event);
        }
        if let Event::Phase { phase, .. } = event {
            (self.standing.phase, self.standing.step) = (*phase, None);
        }
        if let Event::Dwell { number, words, .. } = event {
            self.log.push(format!("dwell {number}: {words}"));
        }
        // The screen shows instructions and half-widths in other places.
        if !matches!(
            event,
            Event::Step { .. } | Event::Dwell { .. } | Event::Progress { .. }
        ) {
            let lines = report::wizard_lines(event).into_iter();
            let lines = lines
                .map(|l| l.trim().to_string())
                .filter(|l| !l.is_empty());
            self.log.extend(lines);
            let spare = self.log.len().saturating_sub(KEPT);
            self.log.drain(..spare);
        }
        // Drawn now, because nothing is drawn while a calibration is judged or stored.
        self.draw();
    }

    fn show(&mut self, standing: &SessionState) {
        self.standing = standing.clone();
        self.draw();
    }

    fn request(&mut self) -> Option<UserRequest> {
        if self.stop.load(Ordering::Relaxed) {
            return Some(UserRequest::Cancel);
        }
        while let Ok(key) = self.keys.try_recv() {
            match key {
                Key::Cancel => return Some(UserRequest::Cancel),
                Key::Redo => return Some(UserRequest::RedoLast),
                Key::Skip => return Some(UserRequest::Skip),
                // A key pressed before the question does not answer it.
                Key::Yes | Key::No if self.question.is_none() => {}
                Key::Yes | Key::No => self.answer = Some(key == Key::Yes),
            }
        }
        None
    }

    fn ask(&mut self, question: &Question) -> Option<bool> {
        if self.yes {
            return Some(of_yes(question));
        }
        if self.question.as_ref() != Some(question) {
            (self.question, self.answer) = (Some(question.clone()), None);
            self.draw();
        }
        let answer = self.answer.take();
        if answer.is_some() {
            self.question = None;
            self.draw();
        }
        answer
    }
}

/// Reads keys until the end. In raw mode the terminal sends no signal for Ctrl-C, so the session is ended here.
fn listen(tell: &Sender<Key>, end: &AtomicBool, stop: &AtomicBool) {
    while !end.load(Ordering::Relaxed) {
        match keys::poll(POLL) {
            Ok(true) => {}
            Ok(false) => continue,
            Err(_) => return,
        }
        let Ok(keys::Event::Key(key)) = keys::read() else {
            continue;
        };
        if key.kind != KeyEventKind::Press {
            continue;
        }
        let Some(key) = Key::of(key.code, key.modifiers) else {
            continue;
        };
        if key == Key::Cancel {
            stop.store(true, Ordering::Relaxed);
        }
        if tell.send(key).is_err() {
            return;
        }
    }
}
