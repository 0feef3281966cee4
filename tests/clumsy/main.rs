//! Sessions of the wizard with boards that write text, in the hands of people who err, in virtual time: `clumsy SESSIONS [FIRST [FOLDER]]`. FIRST is
//! the first seed; FOLDER keeps the sessions.
//!
//! `clumsy TROUBLE SESSIONS [FIRST [FOLDER]]`: every session has one of these besides.
//!
//! | trouble | what |
//! |---|---|
//! | drift | the gyro drifts by 0.3 deg/s a minute. A session is wrong if it stores a misfit without a question, which these people decline, or a calibration that is judged good |
//! | clock | the board's clock errs by 0.5 to 4.5 % |
//! | steps | biases differ by 0.1 deg/s and 5 mg after each power-on, and the cable is pulled |
//! | swap | another unit of the part is at the cable after it was pulled. A session is wrong if it stores a calibration that is judged good |
//! | kills | the command is killed every two minutes, and started again |
//!
//! A session passes if it ends in a calibration that is right. One that ends in another way says why; a wrong calibration is an error of the wizard.

mod person;
mod sensors;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, Sender, channel};

use mimu::{Calibration, JudgementKind};
use mimu_cli::called::{Refusal, wizard};
use mimu_tests::stored_calibration::{Truth, errors, half_widths};
use mimu_tests::text_board::{Random, TextBoard};
use mimu_wizard::event::{Event, Question, SessionState, UserRequest, View};
use mimu_wizard::relay::{Arrival, Stamped};
use mimu_wizard::turn::go_on;
use rayon::prelude::*;

use person::{Habits, Person, Trouble};
use sensors::Sensor;

/// Drift of the boards, rad/s a second: 0.3 deg/s a minute.
const DRIFT: f64 = 0.005 * std::f64::consts::PI / 180.0;
/// Longest session, s.
const LONGEST_S: f64 = 3600.0;
/// How often the person runs the same command again if it was refused, and if it was killed.
const AGAIN: [u32; 2] = [2, 30];
/// Mean time until the command is killed, s.
const KILLED_S: f64 = 120.0;
/// A parameter that errs by so many halves of its 95 % interval is wrong: that is 5.9 sigma.
const WRONG: f64 = 3.0;

/// Passes the events on, and agrees to everything except to storing a calibration that the wizard doubts.
struct Told(Sender<Event>);

impl View for Told {
    fn tell(&mut self, event: &Event) {
        let _ = self.0.send(event.clone());
    }

    fn show(&mut self, _: &SessionState) {}

    fn request(&mut self) -> Option<UserRequest> {
        None
    }

    fn ask(&mut self, question: &Question) -> Option<bool> {
        Some(!matches!(question, Question::StoreRough(_)))
    }
}

/// What became of a session.
#[derive(Debug)]
enum End {
    /// Errors of the stored calibration, deg/s and mg; its parameters outside their intervals, of how many; and the largest error of one, in halves of
    /// its interval.
    Stored([f64; 2], [usize; 2], f64),
    /// The session is finished, and nothing was stored: why.
    Not(String),
    /// The session was refused: why. The same command goes on with it.
    Refused(String),
    /// The command was killed, and goes on with the session.
    Killed,
    /// It went on for [`LONGEST_S`]: the last reason to wait.
    Stuck(String),
}

struct Session {
    seed: u64,
    sensor: &'static str,
    habits: Vec<&'static str>,
    minutes: f64,
    dwells: usize,
    runs: u32,
    end: End,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (trouble, arguments) = match &arguments[..] {
        [what, rest @ ..] if what.parse::<u64>().is_err() => match Trouble::named(what) {
            Some(trouble) => (Some(trouble), rest),
            None => {
                eprintln!("clumsy: {what:?} is unknown; give drift, clock, steps, swap or kills");
                return ExitCode::FAILURE;
            }
        },
        all => (None, all),
    };
    let kept = arguments.get(2).map(PathBuf::from);
    let numbers: Result<Vec<u64>, _> = arguments.iter().take(2).map(|a| a.parse()).collect();
    let Ok([sessions, rest @ ..]) = numbers.as_deref() else {
        eprintln!("clumsy: give the number of sessions, and the first seed");
        return ExitCode::FAILURE;
    };
    let first = rest.first().copied().unwrap_or(0);
    let all: Vec<Session> = (first..first + sessions)
        .into_par_iter()
        .map(|seed| {
            let mut sensor = Sensor::of(seed);
            match trouble {
                Some(Trouble::Drift) => sensor.board.drift = DRIFT,
                Some(Trouble::Clock) => wrong_clock(&mut sensor.board, seed),
                _ => {}
            }
            let session = session(seed, sensor, trouble, kept.as_deref());
            println!("{}", session.line());
            session
        })
        .collect();
    summary(&all)
}

/// The clock of a seed's board is fast or slow by 0.5 to 4.5 %.
fn wrong_clock(board: &mut TextBoard, seed: u64) {
    let share = 0.005 + 0.04 * Random::new(seed ^ 0xc10c).even();
    let factor = if seed.is_multiple_of(2) {
        1.0 + share
    } else {
        1.0 - share
    };
    board.stamps_s /= factor;
}

impl Session {
    fn right(&self) -> bool {
        matches!(self.end, End::Stored(.., worst) if worst < WRONG)
    }

    fn line(&self) -> String {
        let end = match &self.end {
            End::Stored(e, [out, of], worst) => format!(
                "{}, errs by {:.3} deg/s and {:.2} mg, {out} of {of} parameters outside, the worst {worst:.1} half intervals",
                if self.right() { "right" } else { "WRONG" },
                e[0],
                e[1]
            ),
            End::Not(why) => format!("not stored: {why}"),
            End::Refused(why) => format!("refused: {why}"),
            End::Killed => "killed too often".into(),
            End::Stuck(why) => format!("STUCK: {why}"),
        };
        format!(
            "{:3} {:12} {:4.1} min, {:2} dwells, {} runs, [{}]: {end}",
            self.seed,
            self.sensor,
            self.minutes,
            self.dwells,
            self.runs,
            self.habits.join(", ")
        )
    }
}

/// The units and habits of a seed, and what became of them. `kept` keeps the session.
fn session(seed: u64, sensor: Sensor, trouble: Option<Trouble>, kept: Option<&Path>) -> Session {
    let habits = Habits::of(seed).with(trouble);
    let folder = tempfile::tempdir().expect("a folder");
    let out = match kept {
        Some(kept) => kept.join(seed.to_string()),
        None => folder.path().join("out"),
    };
    let mut person = Person::new(&habits, seed, trouble);
    let (mut runs, mut end) = ([0; 2], End::Killed);
    while runs[0] <= AGAIN[0] && runs[1] <= AGAIN[1] {
        end = run(&sensor, &mut person, &out);
        match &end {
            End::Refused(_) if person.now_s < LONGEST_S => runs[0] += 1,
            End::Killed if person.now_s < LONGEST_S => runs[1] += 1,
            _ => break,
        }
    }
    let journal = std::fs::read_to_string(out.join("journal.jsonl")).unwrap_or_default();
    Session {
        seed,
        sensor: sensor.name,
        habits: habits.names(),
        minutes: person.now_s / 60.0,
        dwells: journal.matches("\"entry\":\"dwell\"").count(),
        runs: runs[0] + runs[1] + 1,
        end,
    }
}

/// Runs the command until it ends, or the person has no more patience.
fn run(sensor: &Sensor, person: &mut Person, out: &Path) -> End {
    let (arrivals, heard): (Sender<Stamped>, Receiver<Stamped>) = channel();
    let (tell, events) = channel();
    let arguments = format!(
        "wizard -o {} --port USB --gravity 9.793 --text t_us,ax,ay,az,gx,gy,gz --raw-unit {} --device unit --dwell 2 --warm-up 0",
        out.display(),
        sensor.unit
    );
    let arguments: Vec<OsString> = arguments.split(' ').map(OsString::from).collect();
    let mut session = match wizard(arguments, heard, Box::new(Told(tell))) {
        Ok(session) => session,
        Err(Refusal::Usage(why)) => return End::Refused(why),
        Err(Refusal::Data(error)) => return End::Refused(error.to_string()),
    };
    let _ = arrivals.send((person.now_s, Arrival::Opened));
    let mut last = String::new();
    while person.now_s < LONGEST_S {
        for event in events.try_iter() {
            match event {
                Event::Step { step, .. } => person.asked(step.up),
                Event::Dwell { .. } => person.finished(),
                Event::Waiting { why, .. } => {
                    last = why.to_string();
                    person.told(&last);
                }
                _ => {}
            }
        }
        for arrival in person.tenth(sensor) {
            let _ = arrivals.send(arrival);
        }
        if person.kills() {
            return End::Killed;
        }
        let Some((outcome, refused)) = go_on(session.as_mut()) else {
            continue;
        };
        let unit = outcome.and_then(|o| o.units.into_iter().next());
        return match (unit, refused) {
            // The boards have no effects.
            (Some(unit), _) if unit.stored.is_some() && !unit.effects.is_empty() => End::Not(
                format!("effects that are not there: {}", unit.effects.join(", ")),
            ),
            (Some(unit), _) if unit.stored.is_some() => {
                let file = out.join("calibration.toml");
                match Calibration::read(&file).ok().and_then(|c| c.judgement) {
                    // A drift has no bias to compare with, and two units have no parameters.
                    Some(judgement)
                        if (sensor.board.drift != 0.0 || person.swapped())
                            && judgement.kind >= JudgementKind::Unexplained =>
                    {
                        End::Not(format!("stored, and judged {judgement}"))
                    }
                    _ => judged(&person.truths(sensor), &file),
                }
            }
            (Some(unit), why) => {
                let judged = unit.confirmed.or(unit.verified);
                let judged = judged.map(|j| j.judgement.to_string());
                let all = judged.into_iter().chain(unit.notes).chain(why);
                End::Not(all.collect::<Vec<String>>().join("; "))
            }
            (None, Some(why)) => End::Refused(why),
            (None, None) => End::Refused("no outcome".into()),
        };
    }
    End::Stuck(last)
}

/// The calibration beside the truth of the power-on that it fits best.
fn judged(truths: &[Truth], file: &Path) -> End {
    let beside = |truth: &Truth| match (errors(file, truth), half_widths(file, truth)) {
        (Ok(errors), Ok(both)) => {
            let all: Vec<f64> = both
                .concat()
                .into_iter()
                .filter(|w| w.is_finite())
                .collect();
            let outside = all.iter().filter(|w| **w > 1.0).count();
            Ok((
                errors,
                [outside, all.len()],
                all.into_iter().fold(0.0, f64::max),
            ))
        }
        (Err(why), _) | (_, Err(why)) => Err(why),
    };
    let each: Result<Vec<_>, String> = truths.iter().map(beside).collect();
    match each.map(|each| each.into_iter().min_by(|a, b| a.2.total_cmp(&b.2))) {
        Ok(Some((errors, outside, worst))) => End::Stored(errors, outside, worst),
        Ok(None) => End::Not("no truth".into()),
        Err(why) => End::Not(why),
    }
}

fn summary(all: &[Session]) -> ExitCode {
    let right = all.iter().filter(|s| s.right()).count();
    let wrong = all
        .iter()
        .filter(|s| matches!(s.end, End::Stored(..)) && !s.right());
    let wrong: Vec<String> = wrong.map(|s| s.seed.to_string()).collect();
    let stuck = all
        .iter()
        .filter(|s| matches!(s.end, End::Stuck(_)))
        .count();
    let (outside, of) = all.iter().fold((0, 0), |(outside, of), s| match s.end {
        End::Stored(_, [out, among], _) => (outside + out, of + among),
        _ => (outside, of),
    });
    let shown = match wrong.as_slice() {
        [] => String::new(),
        seeds => format!(" (seeds {})", seeds.join(", ")),
    };
    println!(
        "\n{} sessions: {right} right, {} wrong{shown}, {stuck} stuck",
        all.len(),
        wrong.len()
    );
    println!("{outside} of {of} parameters outside their intervals");
    println!("\n| habit | sessions | right |\n|---|---:|---:|");
    let mut by_habit: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for session in all {
        for habit in session.habits.iter().chain([&session.sensor]) {
            let [sessions, right] = by_habit.entry(habit).or_default();
            *sessions += 1;
            *right += usize::from(session.right());
        }
    }
    for (habit, [sessions, right]) in by_habit {
        println!("| {habit} | {sessions} | {right} |");
    }
    match wrong.is_empty() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}
