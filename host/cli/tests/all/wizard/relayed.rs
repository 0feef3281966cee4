//! A session at a port that another program has open: its data is relayed with their times, without a port, thread or terminal.

use std::ffi::OsString;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};

use mimu_cli::called::{Session, wizard};
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};
use mimu_wizard::relay::{Arrival, Stamped};
use mimu_wizard::session::Outcome;
use mimu_wizard::turn::go_on;

use super::text::{judge, lines};

/// Relays events, and ends the session on request.
struct Told {
    events: Sender<String>,
    requests: Receiver<UserRequest>,
}

impl View for Told {
    fn tell(&mut self, event: &Event) {
        let _ = self.events.send(serde_json::to_string(event).unwrap());
    }

    fn show(&mut self, _: &SessionState) {}

    fn request(&mut self) -> Option<UserRequest> {
        self.requests.try_recv().ok()
    }

    fn ask(&mut self, question: &Question) -> Option<bool> {
        // Once a pose was missed, the playback is out of step, and poses come in another order than requested.
        Some(matches!(question, Question::GoOn(_)))
    }
}

struct Relay {
    session: Session,
    arrivals: Sender<Stamped>,
    events: Receiver<String>,
    requests: Sender<UserRequest>,
}

fn begin(folder: &Path) -> Relay {
    let (arrivals, heard) = channel();
    let (tell, events) = channel();
    let (requests, wished) = channel();
    let view = Told {
        events: tell,
        requests: wished,
    };
    let folder = folder.display();
    let arguments = format!(
        "wizard -o {folder} --port USB --gravity 9.80665 --text t_us,ax,ay,az,gx,gy,gz --device plane-7 --dwell 1.2 --warm-up 0 --as-planned"
    );
    let arguments = arguments.split(' ').map(OsString::from).collect();
    let session = wizard(arguments, heard, Box::new(view)).unwrap_or_else(|_| panic!("refused"));
    Relay {
        session,
        arrivals,
        events,
        requests,
    }
}

impl Relay {
    fn send(&self, at_s: f64, what: Arrival) {
        let _ = self.arrivals.send((at_s, what));
    }

    fn go_on(&mut self) -> Option<(Option<Outcome>, Option<String>)> {
        go_on(self.session.as_mut())
    }

    /// Relays the written lines, a tenth of a second at a time, until the session ends or has reported so many dwells.
    fn hear(
        &mut self,
        lines: &[String],
        from: &mut usize,
        dwells: usize,
    ) -> Option<(Option<Outcome>, Option<String>)> {
        let mut had = 0;
        while *from < lines.len() {
            let until = (*from + 10).min(lines.len());
            let bytes = lines[*from..until].concat().into_bytes();
            *from = until;
            self.send(0.01 * until as f64, Arrival::Bytes(bytes));
            if let Some(ended) = self.go_on() {
                return Some(ended);
            }
            had += self
                .events
                .try_iter()
                .filter(|e| e.starts_with("{\"event\":\"dwell\""))
                .count();
            if had >= dwells {
                return None;
            }
        }
        panic!("the board has no more to say");
    }
}

#[test]
fn a_session_that_is_relayed_is_unplugged_stopped_and_gone_on_with_and_its_intervals_hold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let (lines, mut at) = (lines(), 0);
    let mut relay = begin(&out);
    relay.send(0.0, Arrival::Opened);
    assert!(relay.hear(&lines, &mut at, 3).is_none());
    // Unplugged for a second during the turn to the fourth dwell.
    relay.send(
        0.01 * at as f64,
        Arrival::Lost("the port has vanished".into()),
    );
    assert!(relay.go_on().is_none());
    let told: Vec<String> = relay.events.try_iter().collect();
    assert!(
        told.iter().any(|e| e.contains("\"event\":\"interrupted\"")),
        "{told:?}"
    );
    at += 100;
    relay.send(0.01 * at as f64, Arrival::Opened);
    assert!(relay.hear(&lines, &mut at, 3).is_none());
    relay.requests.send(UserRequest::Cancel).unwrap();
    let (outcome, refused) = relay.go_on().unwrap();
    assert!(outcome.unwrap().cancelled && refused.is_none());
    drop(relay);

    let mut relay = begin(&out);
    relay.send(0.01 * at as f64, Arrival::Opened);
    let (outcome, refused) = relay.hear(&lines, &mut at, usize::MAX).unwrap();
    assert_eq!(refused, None);
    let outcome = outcome.unwrap();
    assert_eq!(
        outcome.units[0].stored,
        Some(out.join("calibration.toml").display().to_string())
    );
    judge(&out.join("calibration.toml"), "");
}
