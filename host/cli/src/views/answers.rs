//! Input of the user during a session, and answers given in advance on the command line.

use std::collections::VecDeque;
use std::io::BufRead as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use mimu_recording::error::{Error, Result};
use mimu_wizard::event::{Question, UserRequest};

/// The answer of `--yes`: effects are stored. A large error is not stored, a problem ends the session, and nobody switches the supply.
pub(crate) fn of_yes(question: &Question) -> bool {
    matches!(question, Question::StoreEffects(_))
}

/// Lines from standard input, and Ctrl-C.
pub(crate) struct Typed {
    lines: Receiver<String>,
    stop: Arc<AtomicBool>,
    requests: VecDeque<UserRequest>,
    /// Whether a question is open, and its answer once it is typed.
    asked: bool,
    answer: Option<bool>,
    ended: bool,
}

/// The lines of standard input, as they come.
pub(crate) fn lines() -> Result<Receiver<String>> {
    let (tell, lines) = channel();
    let read = move || {
        let mut input = std::io::stdin()
            .lock()
            .lines()
            .map_while(std::io::Result::ok);
        // Until nobody listens any more.
        let _ = input.try_for_each(|line| tell.send(line));
    };
    std::thread::Builder::new()
        .name("keyboard".into())
        .spawn(read)
        .map_err(|error| Error::new("keyboard", error, "run it again"))?;
    Ok(lines)
}

impl Typed {
    pub(crate) fn new(stop: Arc<AtomicBool>) -> Result<Self> {
        Ok(Self {
            lines: lines()?,
            stop,
            requests: VecDeque::new(),
            asked: false,
            answer: None,
            ended: false,
        })
    }

    /// The user's request, if any.
    pub(crate) fn request(&mut self) -> Option<UserRequest> {
        if self.stop.load(Ordering::Relaxed) {
            return Some(UserRequest::Cancel);
        }
        self.read();
        self.requests.pop_front()
    }

    /// Begins a question: earlier input does not answer it.
    pub(crate) fn begin_question(&mut self) {
        self.read();
        (self.asked, self.answer) = (true, None);
    }

    fn read(&mut self) {
        loop {
            match self.lines.try_recv() {
                Ok(line) => self.take(&line),
                Err(TryRecvError::Disconnected) => {
                    self.ended = true;
                    return;
                }
                Err(TryRecvError::Empty) => return,
            }
        }
    }

    fn take(&mut self, line: &str) {
        let mut words = line.split_whitespace();
        let Some(first) = words.next() else { return };
        let request = match (first, words.next()) {
            ("q" | "quit" | "cancel", None) => Some(UserRequest::Cancel),
            ("s" | "skip", None) => Some(UserRequest::Skip),
            ("r" | "redo", None) => Some(UserRequest::RedoLast),
            ("r" | "redo", Some(number)) => number.parse().ok().map(UserRequest::Redo),
            ("y" | "yes" | "n" | "no", None) if !self.asked => {
                eprintln!("there is no open question: an answer counts only after its question");
                None
            }
            ("y" | "yes", None) => {
                self.answer = Some(true);
                None
            }
            ("n" | "no", None) => {
                self.answer = Some(false);
                None
            }
            _ => {
                eprintln!("type redo, redo N, skip, quit, yes or no");
                None
            }
        };
        self.requests.extend(request);
    }

    /// The answer to a question, once it is typed. At the end of standard input it is no.
    pub(crate) fn answer(&mut self) -> Option<bool> {
        let answer = self.answer.take().or(self.ended.then_some(false));
        self.asked &= answer.is_none();
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_counts_after_its_question_only() {
        let (tell, lines) = channel();
        let mut typed = Typed {
            lines,
            stop: Arc::default(),
            requests: VecDeque::new(),
            asked: false,
            answer: None,
            ended: false,
        };
        let say = |line: &str| tell.send(line.into()).unwrap();
        say("yes");
        say("skip");
        typed.begin_question();
        assert_eq!(
            (typed.request(), typed.answer()),
            (Some(UserRequest::Skip), None)
        );
        say("yes");
        assert_eq!((typed.request(), typed.answer()), (None, Some(true)));
        // Each question begins without an answer.
        say("no");
        assert_eq!((typed.request(), typed.answer()), (None, None));
        typed.begin_question();
        assert_eq!((typed.request(), typed.answer()), (None, None));
    }
}
