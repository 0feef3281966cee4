//! What a session says: events that count, once each, and how it stands, many times a second. Both are plain data, so that a full
//! screen, lines of text and JSON lines are views of the same.

use std::fmt;

use mimu::diagnose::Verdict;
use serde::{Serialize, Serializer};

use crate::folder::Part;
use crate::refit::Progress;
use crate::verdict::Judged;
use crate::waiting::{Interruption, Waiting};
use mimu_equipment::step::Step;

/// Something that has happened.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum Event {
    /// A unit greets.
    Greeted {
        /// Which.
        unit: String,
        /// What it says of itself.
        told: Vec<String>,
    },
    /// A session is resumed.
    Resumed {
        /// Dwells that there are already.
        dwells: usize,
    },
    /// The sensors were deflected electrically.
    SelfTested {
        /// Which unit.
        unit: String,
        /// Whether all answered as their data sheets state.
        passed: bool,
        /// Which did not, and what moved.
        words: String,
    },
    /// A phase begins.
    Phase {
        /// Which.
        phase: Phase,
        /// In a sentence.
        words: String,
    },
    /// What to do next.
    Step {
        /// Which recording.
        part: Part,
        /// Dwells so far.
        done: usize,
        /// Dwells as planned; more or fewer may come.
        planned: usize,
        /// What to do.
        step: Step,
        /// In words.
        words: String,
    },
    /// Why it waits now.
    Waiting {
        /// Which unit.
        unit: String,
        /// Why.
        why: Waiting,
    },
    /// A dwell was completed.
    Dwell {
        /// Which unit.
        unit: String,
        /// Which recording.
        part: Part,
        /// Its number.
        number: i32,
        /// What it was.
        step: Step,
        /// In words.
        words: String,
    },
    /// A dwell was discarded.
    Thrown {
        /// Which unit.
        unit: String,
        /// Why.
        why: Waiting,
    },
    /// A dwell is to be repeated.
    Redo {
        /// Its number.
        number: i32,
    },
    /// State of the calibration after a dwell.
    Progress {
        /// Which unit.
        unit: String,
        /// Beside the targets.
        progress: Progress,
    },
    /// The line was lost or found, the device has restarted, another unit is there.
    Interrupted {
        /// Which unit.
        unit: String,
        /// What happened.
        why: Interruption,
    },
    /// The calibration, judged by the verification.
    Verified {
        /// Which unit.
        unit: String,
        /// The figures.
        judged: Judged,
    },
    /// A calibration was stored, read back and compared.
    Stored {
        /// Which unit.
        unit: String,
        /// Its hash.
        hash: String,
        /// What was checked.
        words: String,
    },
    /// What still errs.
    Diagnosed {
        /// Which unit.
        unit: String,
        /// What it amounts to.
        verdict: Verdict,
        /// The effects, each with its strength.
        effects: Vec<String>,
        /// The page.
        page: String,
    },
    /// Something that a person should know.
    Note {
        /// What.
        words: String,
    },
    /// A question, to be answered by yes or no.
    Question {
        /// `power-cycled`, `store-effects`, `store-rough`, `go-on`.
        question: &'static str,
        /// In a sentence.
        words: String,
    },
}

impl Event {
    /// The unit that it is about, if it is about one.
    pub fn unit(&self) -> Option<&str> {
        match self {
            Self::Greeted { unit, .. }
            | Self::SelfTested { unit, .. }
            | Self::Waiting { unit, .. }
            | Self::Dwell { unit, .. }
            | Self::Thrown { unit, .. }
            | Self::Progress { unit, .. }
            | Self::Interrupted { unit, .. }
            | Self::Verified { unit, .. }
            | Self::Stored { unit, .. }
            | Self::Diagnosed { unit, .. } => Some(unit),
            Self::Resumed { .. }
            | Self::Phase { .. }
            | Self::Step { .. }
            | Self::Redo { .. }
            | Self::Note { .. }
            | Self::Question { .. } => None,
        }
    }
}

/// What a session does at a time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Phase {
    /// The units are opened.
    #[default]
    Start,
    /// The units come to rest and to a steady temperature.
    WarmUp,
    /// Dwells that the calibration is made from.
    Calibration,
    /// Dwells that it is judged by.
    Verification,
    /// The calibration goes into the device.
    Store,
    /// What still errs is looked for.
    Diagnosis,
    /// Dwells that the calibration with effects is judged by.
    Confirmation,
}

impl Phase {
    /// The recording that its dwells are counted in.
    pub fn part(self) -> Part {
        match self {
            Self::Verification => Part::Verification,
            Self::Confirmation => Part::Confirmation,
            _ => Part::Calibration,
        }
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::WarmUp => "warm-up",
            Self::Calibration => "calibration",
            Self::Verification => "verification",
            Self::Store => "store",
            Self::Diagnosis => "diagnosis",
            Self::Confirmation => "confirmation",
        })
    }
}

impl Serialize for Phase {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// How a unit stands.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct UnitStanding {
    /// Which.
    pub unit: String,
    /// Motion of gyro and accelerometer over what still counts as still.
    pub motion: Option<[f64; 2]>,
    /// What is allowed of it: 1, and more of the gyro while it turns.
    pub motion_limits: [f64; 2],
    /// Angle between up and the direction that is wanted up, degrees.
    pub tilt_deg: Option<f64>,
    /// What is allowed of it.
    pub tilt_limit_deg: f64,
    /// Rate about the vertical, deg/s; `None` where no data sheet is known and there is no calibration yet.
    pub rate_dps: Option<f64>,
    /// Departure from the rate that is wanted that is allowed, deg/s.
    pub rate_limit_dps: f64,
    /// °C.
    pub temp_c: Option<f64>,
    /// °C/min.
    pub trend_c_per_min: Option<f64>,
    /// What is allowed of it while it warms up, if that is waited for.
    pub trend_limit_c_per_min: Option<f64>,
    /// Samples received, and lost since the beginning.
    pub samples: u64,
    /// Samples that are missing.
    pub lost: u64,
    /// Samples with a reading at the end of its range.
    pub clipped: u64,
    /// Why it waits; `None` while a dwell runs.
    pub waiting: Option<Waiting>,
    /// Seconds of the dwell that are left.
    pub left_s: Option<f64>,
}

/// How the session stands.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Standing {
    /// What is done now.
    pub phase: Phase,
    /// The step.
    pub step: Option<Step>,
    /// Dwells so far, and as planned.
    pub dwells: [usize; 2],
    /// Thrown away.
    pub thrown: usize,
    /// Time since the beginning, s, by the units' clock.
    pub elapsed_s: f64,
    /// Each unit.
    pub units: Vec<UnitStanding>,
    /// The calibration of each, as far as it is determined.
    pub progress: Vec<Progress>,
}

/// Request of a person since the last call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// End the session; its data stay, and it can be resumed.
    Cancel,
    /// Repeat the last dwell.
    RedoLast,
    /// Repeat the dwell with this number.
    Redo(i32),
    /// Another pose first; this one follows later.
    Skip,
}

/// A question that has to be answered by yes or no.
#[derive(Debug, Clone, PartialEq)]
pub enum Question {
    /// Whether the supply was turned off and on.
    PowerCycled,
    /// Whether to store the calibration with the effects that were found.
    StoreEffects(String),
    /// Whether to store a calibration whose error is many times the noise, as described.
    StoreRough(String),
    /// Whether to continue despite this problem.
    GoOn(String),
}

impl Question {
    /// Its name in [`Event::Question`].
    pub fn name(&self) -> &'static str {
        match self {
            Self::PowerCycled => "power-cycled",
            Self::StoreEffects(_) => "store-effects",
            Self::StoreRough(_) => "store-rough",
            Self::GoOn(_) => "go-on",
        }
    }

    /// As a sentence.
    pub fn words(&self) -> String {
        match self {
            Self::PowerCycled => {
                "unplug the board, plug it in again, and answer yes; no skips this test".into()
            }
            Self::StoreEffects(effects) => {
                format!("verify and store the calibration with {effects}?")
            }
            Self::StoreRough(why) => format!("{why}; store it anyway?"),
            Self::GoOn(why) => format!("{why}; continue anyway?"),
        }
    }
}

/// Shows a session to a person, and receives their requests.
pub trait View {
    /// Something has happened.
    fn tell(&mut self, event: &Event);

    /// Shows the present state; called many times per second.
    fn show(&mut self, standing: &Standing);

    /// What is wanted.
    fn wish(&mut self) -> Option<Wish>;

    /// Asks a question; `None` until it is answered.
    fn ask(&mut self, question: &Question) -> Option<bool>;
}
