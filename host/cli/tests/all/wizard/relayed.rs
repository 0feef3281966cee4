//! A session at a port that another program has open: its data is relayed with their times, without a port, thread or terminal.

use std::ffi::OsString;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};

use mimu::calibration::Calibration;
use mimu_cli::called::{Refusal, Session, wizard};
use mimu_recording::{ClockRate, Manifest, Times};
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};
use mimu_wizard::procedure::faces;
use mimu_wizard::relay::{Arrival, Stamped};
use mimu_wizard::session::Outcome;
use mimu_wizard::turn::go_on;

use super::text::{judge, lines, lines_in};
use crate::command::{done, says};

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
    begin_with(folder, "").unwrap_or_else(|why| panic!("{why}"))
}

/// With further arguments; or why the command is refused.
fn begin_with(folder: &Path, more: &str) -> Result<Relay, String> {
    let (arrivals, heard) = channel();
    let (tell, events) = channel();
    let (requests, wished) = channel();
    let view = Told {
        events: tell,
        requests: wished,
    };
    let folder = folder.display();
    let arguments = format!(
        "wizard -o {folder} --port USB --gravity 9.80665 --text t_us,ax,ay,az,gx,gy,gz --device plane-7 --dwell 1.2 --warm-up 0 --as-planned{more}"
    );
    let arguments = arguments.split(' ').map(OsString::from).collect();
    let session = wizard(arguments, heard, Box::new(view)).map_err(|refused| match refused {
        Refusal::Usage(why) => why,
        Refusal::Data(error) => error.to_string(),
    })?;
    Ok(Relay {
        session,
        arrivals,
        events,
        requests,
    })
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

#[test]
fn times_of_a_clock_three_percent_fast_are_converted_and_the_intervals_hold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let fast = |line: String| match line
        .split_once(',')
        .map(|(t, rest)| (t.parse::<f64>(), rest))
    {
        Some((Ok(t_us), rest)) if t_us > 1e5 => format!("{:.0},{rest}", 1.03 * t_us),
        _ => line,
    };
    let lines: Vec<String> = lines().into_iter().map(fast).collect();
    let mut relay = begin(&out);
    relay.send(0.0, Arrival::Opened);
    let (outcome, refused) = relay.hear(&lines, &mut 0, usize::MAX).unwrap();
    assert_eq!(refused, None);
    let clock = outcome.unwrap().units[0].clock.unwrap();
    // The relay counts lost lines as no time: 0.02 %.
    assert!(
        (clock.factor - 1.03).abs() < clock.half_width + 3e-4,
        "{clock:?}"
    );
    // A scale factor uncorrected errs by 0.03: ten halves of its interval.
    judge(&out.join("calibration.toml"), "");
    let manifest = out.join("calibration/recording.toml");
    let written = Manifest::read(&manifest).unwrap().clock.unwrap();
    assert!(
        written.half_width < 3e-4 && written.times == Times::Board,
        "{written:?}"
    );
    let made = Calibration::read(&out.join("calibration.toml")).unwrap();
    let computer = ClockRate {
        times: Times::Computer,
        ..written
    };
    assert_eq!(made.recording.clock, Some(computer));
    let text = std::fs::read_to_string(&manifest).unwrap();
    let trusted = text.replace("times = \"board\"", "times = \"trusted\"");
    std::fs::write(&manifest, trusted).unwrap();
    let said = done(&out, "fit calibration");
    says(
        &said,
        &["judgement: suspect: the clock of its samples runs 1.03"],
    );
}

/// A population of a hundred units in counts: scale factors of the MPU-6050 within 1.5 %, axes within 20 mrad, biases within 300 and 600 counts. `larger`: by how
/// much its gyros' scale factors are larger than those of the part.
fn population(larger: f64) -> String {
    let names = |of: &str, axes: [&str; 3]| axes.map(|a| format!("{of}_{a}"));
    let all = [
        names("scale", ["x", "y", "z"]),
        names("misalignment", ["x", "y", "z"]),
        names("non_orthogonality", ["yz", "zy", "zx"]),
        names("bias", ["x", "y", "z"]),
    ]
    .concat();
    let mut text = String::from(
        "format = \"mimu-prior/1\"\ntool = \"a test\"\nraw_unit = \"count\"\nreference = \"gravity\"\nbiases = true\n",
    );
    for (sensor, scale, bias) in [("gyro", 3754.9 * larger, 300.0), ("accel", 1670.1, 600.0)] {
        // By hand the accelerometer's own axes are the body's: it has no misalignment.
        let of: Vec<usize> = (0..12).filter(|k| sensor == "gyro" || k / 3 != 1).collect();
        let sigma = |k: usize| [0.015 * scale, 0.02, 0.02, bias][k / 3];
        let mean = |k: usize| if k < 3 { scale } else { 0.0 };
        let row = |i: &usize| -> Vec<f64> {
            let each = of
                .iter()
                .map(|j| if i == j { sigma(*i).powi(2) } else { 0.0 });
            each.collect()
        };
        let names: Vec<&String> = of.iter().map(|k| &all[*k]).collect();
        let units: Vec<&str> = of.iter().map(|_| "as fits have it").collect();
        let means: Vec<f64> = of.iter().map(|k| mean(*k)).collect();
        let sigmas: Vec<f64> = of.iter().map(|k| sigma(*k)).collect();
        let rows: Vec<Vec<f64>> = of.iter().map(row).collect();
        text += &format!(
            "[{sensor}]\nunits = 100\nparameters = {names:?}\nparameter_units = {units:?}\nmean = {means:?}\nsigma = {sigmas:?}\ncovariance = {rows:?}\n"
        );
    }
    text
}

#[test]
fn with_the_population_six_faces_end_in_a_calibration_whose_intervals_hold() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let kind = folder.path().join("kind.toml");
    std::fs::write(&kind, population(1.0)).unwrap();
    let with = format!(" --prior {}", kind.display());
    let (lines, mut at) = (lines_in(faces(1.2)), 0);
    let mut relay = begin_with(&out, &with).unwrap_or_else(|why| panic!("{why}"));
    relay.send(0.0, Arrival::Opened);
    assert!(relay.hear(&lines, &mut at, 3).is_none());
    relay.requests.send(UserRequest::Cancel).unwrap();
    relay.go_on().unwrap();
    drop(relay);
    // Without the prior these poses would not suffice, and others would have been asked for.
    let without = begin(&out);
    without.send(0.01 * at as f64, Arrival::Opened);
    let mut without = without;
    let (_, refused) = without.go_on().unwrap();
    let refused = refused.unwrap();
    says(
        &refused,
        &[
            "prior was gyro of 100 units, accel of 100 units, now it is none",
            "--prior",
        ],
    );
    let mut relay = begin_with(&out, &with).unwrap_or_else(|why| panic!("{why}"));
    relay.send(0.01 * at as f64, Arrival::Opened);
    let (outcome, refused) = relay.hear(&lines, &mut at, usize::MAX).unwrap();
    assert_eq!(refused, None);
    let unit = &outcome.unwrap().units[0];
    assert_eq!(unit.dwells, 6, "{unit:?}");
    let calibration = out.join("calibration.toml");
    assert_eq!(
        unit.stored,
        Some(calibration.display().to_string()),
        "{unit:?}"
    );
    judge(&calibration, "");
}
