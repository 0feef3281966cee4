//! The wizard leads a person through whole turns, who errs in each way; it is killed on the way and goes on.

use std::ffi::OsString;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};

use mimu::calibration::Calibration;
use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_cli::called::{Session, wizard};
use mimu_cli::report::wizard_lines;
use mimu_recording::Recording;
use mimu_tests::says;
use mimu_tests::spinner::{Slip, Spinner};
use mimu_tests::stored_calibration::half_widths;
use mimu_tests::text_board::TextBoard;
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};
use mimu_wizard::relay::{Arrival, Stamped};
use mimu_wizard::session::Outcome;
use mimu_wizard::turn::go_on;

/// Passes events on.
struct Told(Sender<Event>);

impl View for Told {
    fn tell(&mut self, event: &Event) {
        let _ = self.0.send(event.clone());
    }

    fn show(&mut self, _: &SessionState) {}

    fn request(&mut self) -> Option<UserRequest> {
        None
    }

    fn ask(&mut self, _: &Question) -> Option<bool> {
        Some(false)
    }
}

pub struct Led {
    session: Session,
    pub arrivals: Sender<Stamped>,
    events: Receiver<Event>,
}

pub fn begin(out: &Path, person: &Spinner, more: &str) -> Led {
    let (arrivals, heard) = channel();
    let (tell, events) = channel();
    let arguments = format!(
        "wizard -o {} --port USB --gravity 9.793 --text t_us,ax,ay,az,gx,gy,gz --device unit --dwell 2 --warm-up 0 --as-planned --trust-clock {more}",
        out.display()
    );
    let arguments: Vec<OsString> = arguments.split_whitespace().map(OsString::from).collect();
    let session =
        wizard(arguments, heard, Box::new(Told(tell))).unwrap_or_else(|_| panic!("refused"));
    let _ = arrivals.send((person.now_s, Arrival::Opened));
    Led {
        session,
        arrivals,
        events,
    }
}

pub type Ended = (Option<Outcome>, Option<String>);

impl Led {
    /// Until the session ends, or `stop` says so of an event.
    pub fn lead(
        &mut self,
        person: &mut Spinner,
        said: &mut Vec<String>,
        stop: impl Fn(&Event) -> bool,
    ) -> Option<Ended> {
        while person.now_s < 3600.0 {
            let mut stopped = false;
            for event in self.events.try_iter().collect::<Vec<_>>() {
                person.hear(&event);
                said.extend(wizard_lines(&event));
                stopped |= stop(&event);
            }
            if stopped {
                return None;
            }
            let _ = self
                .arrivals
                .send((person.now_s + 0.1, Arrival::Bytes(person.tenth())));
            if let Some(ended) = go_on(self.session.as_mut()) {
                for event in self.events.try_iter() {
                    said.extend(wizard_lines(&event));
                }
                return Some(ended);
            }
        }
        panic!("it goes on for an hour:\n{}", said.join("\n"));
    }
}

fn count(said: &[String], words: &str) -> usize {
    said.iter().filter(|line| line.contains(words)).count()
}

#[test]
fn a_person_who_errs_in_whole_turns_is_told_so_and_ends_with_scale_factors_to_a_few_hundredths_of_a_per_cent()
 {
    let board = TextBoard::new(4);
    let truth = board.truth;
    let slips = [
        Slip::Right,
        Slip::OneShort,
        Slip::HalfWay,
        Slip::Aside(40.0),
        Slip::Right,
        Slip::Fast,
        Slip::Right,
    ];
    let mut person = Spinner::new(board, 7, &slips);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut said = Vec::new();
    let mut led = begin(&out, &person, "--whole-turns --placement 0.6");
    // Killed in the middle of the third spin of six.
    let in_third =
        |event: &Event| matches!(event, Event::Turned { axis, turns: 3, .. } if axis == "+x");
    assert!(led.lead(&mut person, &mut said, in_third).is_none());
    drop(led);
    // Its slip was lost with it.
    person.slips.push_front(Slip::HalfWay);
    let before = said.len();
    let mut led = begin(&out, &person, "--whole-turns --placement 0.6");
    let (outcome, refused) = led
        .lead(&mut person, &mut said, |_| false)
        .expect("it ends");
    let all = said.join("\n");
    assert_eq!(refused, None, "{all}");
    let outcome = outcome.unwrap();
    says(
        &all,
        &[
            "9.0 turns so far, and 10 are wanted: turn it once more",
            "5.4 turns so far, and 10 are wanted: turn it 5 times more",
            "it lies 40 degrees from where it lay",
            "these turns cannot be used: it lies 40",
            "it reached the end of the gyro's range, ",
            "3 turns about -x",
            "360 deg about z read as 3",
        ],
    );
    assert_eq!(count(&said[before..], "done: 10 turns"), 5, "{all}");
    assert_eq!(count(&said, "done: 10 turns"), 7, "{all}");
    assert_eq!(count(&said, "these turns cannot be used"), 2, "{all}");

    let verified = outcome.units[0].verified.as_ref().unwrap();
    let turned = &verified.whole_turns[0];
    assert!(
        turned.error_deg_per_turn.abs() < 2.0 * turned.half_width_deg_per_turn,
        "{turned:?}"
    );
    let stored = out.join("calibration.toml");
    let errors = half_widths(&stored, &truth).unwrap();
    let outside = errors.concat().iter().filter(|w| **w > 1.0).count();
    // Of 21 intervals at 95 %, five or more miss with a probability of 0.3 %.
    assert!(outside <= 4, "{errors:?}");

    // The folder states what was done, so that a fit of it is the same.
    let recording = Recording::open(&out.join("calibration")).unwrap();
    assert_eq!(recording.manifest.whole_turns.unwrap().placement_deg, 0.6);
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap();
    let fitted = fit(prepared, Options::default()).unwrap();
    let gyro = &fitted.sensor(Sensor::Gyro).unwrap().estimated.triad;
    let kept = Calibration::read(&stored).unwrap();
    let difference = gyro.inverse.matrix - kept.inverse(Sensor::Gyro).unwrap().matrix;
    assert!(difference.norm() < 1e-9 * gyro.inverse.matrix.norm());
    for estimate in [0, 4, 8].map(|k| gyro.forward_estimates()[k]) {
        let half = estimate.interval / estimate.value.abs();
        assert!(half < 3e-4, "{half}");
    }
}
