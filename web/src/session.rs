//! A session of the wizard with a board at a port of the browser. `session` begins it by the arguments of `mimu wizard`; the page calls
//! [`mimu_go_on`] when something has come from the board or the person.
//!
//! In (standard input) and out (standard output) are lines of JSON:
//!
//! | in | what |
//! |---|---|
//! | `{"opened": 1.5}` | the port was opened, at this time in s |
//! | `{"bytes": [1.5, "1,2,3\n"]}` | received bytes, each as the character with its code |
//! | `{"lost": [1.5, "it was unplugged"]}` | the port is gone |
//! | `{"time": 1.5}` | only the time |
//! | `{"wish": "cancel"}` | also `redo-last`, `skip` |
//! | `{"answer": true}` | the answer to the open question |
//!
//! | out | what |
//! |---|---|
//! | `{"event": ..., "lines": [...]}` | an event as `mimu wizard --events` writes it, and as the terminal shows it |
//! | `{"question": "..."}` | a question waits for its answer |
//! | `{"standing": ...}` | its state, ten times a second |
//! | `{"ended": {"outcome", "text", "refused"}}` | its outcome, as `--json` writes it and in words; or why it was refused |

use std::cell::RefCell;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::Read as _;
use std::rc::Rc;
use std::sync::mpsc::{Sender, channel};

use mimu_cli::called::{self, Refusal, Session};
use mimu_cli::report::{wizard_lines, wizard_text};
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};
use mimu_wizard::relay::{Arrival, Stamped};
use mimu_wizard::turn::go_on;
use serde::Deserialize;
use serde_json::{Value, json};

thread_local! {
    static OPEN: RefCell<Option<OpenSession>> = const { RefCell::new(None) };
}

struct OpenSession {
    session: Session,
    arrivals: Sender<Stamped>,
    person: Rc<RefCell<Person>>,
}

/// Input of the person that the session has not taken yet.
#[derive(Default)]
struct Person {
    requests: VecDeque<UserRequest>,
    answer: Option<bool>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Input {
    Opened(f64),
    Bytes(f64, String),
    Lost(f64, String),
    Time(f64),
    Wish(WishInput),
    Answer(bool),
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum WishInput {
    Cancel,
    RedoLast,
    Skip,
}

fn say(line: &Value) {
    println!("{line}");
}

/// Begins a session by the arguments of `mimu wizard`. The error is the line to print.
pub fn begin(arguments: &[String]) -> Result<(), String> {
    let person = Rc::new(RefCell::new(Person::default()));
    let (arrivals, heard) = channel();
    let view = PageView {
        person: person.clone(),
        asked: None,
    };
    let arguments = arguments.iter().map(OsString::from).collect();
    let session =
        called::wizard(arguments, heard, Box::new(view)).map_err(|refusal| match refusal {
            Refusal::Usage(line) => line,
            Refusal::Data(error) => error.to_string(),
        })?;
    let open = OpenSession {
        session,
        arrivals,
        person,
    };
    OPEN.with_borrow_mut(|slot| *slot = Some(open));
    Ok(())
}

/// Reads what waits at standard input, and continues the session until it must wait again. Returns 1 if the session has ended.
// A WASI program ends with `main`, but a session does not: the page continues it through this function.
#[unsafe(no_mangle)]
#[expect(unsafe_code)]
pub extern "C" fn mimu_go_on() -> u32 {
    let mut text = String::new();
    let read = std::io::stdin().read_to_string(&mut text);
    OPEN.with_borrow_mut(|slot| {
        let Some(open) = slot else { return 1 };
        let heard = read
            .map_err(|error| error.to_string())
            .and_then(|_| text.lines().try_for_each(|line| open.hear(line)));
        if let Err(error) = heard {
            say(&json!({"ended": {"refused": format!("page: {error}; report this")}}));
            *slot = None;
            return 1;
        }
        let Some((outcome, refused)) = go_on(open.session.as_mut()) else {
            return 0;
        };
        let text = outcome.as_ref().map(wizard_text);
        say(&json!({"ended": {"outcome": outcome, "text": text, "refused": refused}}));
        *slot = None;
        1
    })
}

impl OpenSession {
    fn hear(&self, line: &str) -> Result<(), String> {
        let input = serde_json::from_str(line).map_err(|error| error.to_string())?;
        let mut person = self.person.borrow_mut();
        let arrived = match input {
            Input::Opened(at_s) => (at_s, Arrival::Opened),
            // The page sends only characters below 256.
            Input::Bytes(at_s, text) => (
                at_s,
                Arrival::Bytes(text.chars().map(|c| c as u8).collect()),
            ),
            Input::Lost(at_s, why) => (at_s, Arrival::Lost(why)),
            Input::Time(at_s) => (at_s, Arrival::Nothing),
            Input::Answer(answer) => {
                person.answer = Some(answer);
                return Ok(());
            }
            Input::Wish(request) => {
                person.requests.push_back(match request {
                    WishInput::Cancel => UserRequest::Cancel,
                    WishInput::RedoLast => UserRequest::RedoLast,
                    WishInput::Skip => UserRequest::Skip,
                });
                return Ok(());
            }
        };
        // A session that has closed its line ends with the next step.
        let _ = self.arrivals.send(arrived);
        Ok(())
    }
}

/// Shows a session to the page.
struct PageView {
    person: Rc<RefCell<Person>>,
    asked: Option<Question>,
}

impl View for PageView {
    fn tell(&mut self, event: &Event) {
        say(&json!({"event": event, "lines": wizard_lines(event)}));
    }

    fn show(&mut self, standing: &SessionState) {
        say(&json!({"standing": standing}));
    }

    fn request(&mut self) -> Option<UserRequest> {
        self.person.borrow_mut().requests.pop_front()
    }

    fn ask(&mut self, question: &Question) -> Option<bool> {
        if self.asked.as_ref() != Some(question) {
            self.asked = Some(question.clone());
            // An earlier answer does not belong to this question.
            self.person.borrow_mut().answer = None;
            say(&json!({"question": question.words()}));
        }
        let answer = self.person.borrow_mut().answer.take();
        if answer.is_some() {
            self.asked = None;
        }
        answer
    }
}
