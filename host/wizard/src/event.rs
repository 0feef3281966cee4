//! Output of a session: events, reported once each, and the state, reported many times a second. Both are plain data, so that lines
//! of text and JSON lines are views of the same.

use mimu::diagnose::Verdict;
use serde::Serialize;

use crate::folder::Part;
use crate::refit::Progress;
use crate::spin::{Spin, SpinState};
use crate::verdict::Judged;
use crate::waiting::{Interruption, Waiting};
use mimu_equipment::step::Step;

/// An event of a session.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum Event {
    /// A unit sent its greeting.
    Greeted {
        /// Name of the unit.
        unit: String,
        /// Its identity and state, in words.
        told: Vec<String>,
    },
    /// A session was resumed.
    Resumed {
        /// Dwells recorded before.
        dwells: usize,
    },
    /// A unit ran its self-test.
    SelfTested {
        /// Name of the unit.
        unit: String,
        /// Whether all sensors responded as their data sheets require.
        passed: bool,
        /// Failed sensors, and what moved.
        words: String,
    },
    /// A phase began.
    Phase {
        /// The phase.
        phase: Phase,
        /// Description in a sentence.
        words: String,
    },
    /// The next dwell was requested.
    Step {
        /// The recording.
        part: Part,
        /// Dwells completed so far.
        done: usize,
        /// Planned dwells; more or fewer may follow.
        planned: usize,
        /// The requested dwell.
        step: Step,
        /// The dwell in words.
        words: String,
    },
    /// The next whole turns were requested.
    Spin {
        /// The recording.
        part: Part,
        /// Whole turns completed so far.
        done: usize,
        /// Whole turns in all, each about one axis and one way.
        planned: usize,
        /// The requested turns.
        spin: Spin,
        /// The rest before them.
        step: Step,
        /// What to do, in words.
        words: String,
    },
    /// A turn is complete; the number is 0 when the unit has rested and is to be turned.
    Turned {
        /// Name of the unit.
        unit: String,
        /// The axis with its sign: `+z`.
        axis: String,
        /// Turns so far.
        turns: u32,
    },
    /// Whole turns are complete, and the unit is put back.
    Spun {
        /// Name of the unit.
        unit: String,
        /// The recording.
        part: Part,
        /// The axis with its sign.
        axis: String,
        /// Their number, as the gyro shows it.
        turns: u32,
    },
    /// Whole turns cannot be used, and are asked for again.
    SpinLost {
        /// Name of the unit.
        unit: String,
        /// The reason.
        why: String,
    },
    /// A unit waits.
    Waiting {
        /// Name of the unit.
        unit: String,
        /// The reason.
        why: Waiting,
    },
    /// A dwell was completed.
    Dwell {
        /// Name of the unit.
        unit: String,
        /// The recording.
        part: Part,
        /// Number of the dwell.
        number: i32,
        /// The dwell.
        step: Step,
        /// The dwell in words.
        words: String,
    },
    /// A dwell was discarded.
    Discarded {
        /// Name of the unit.
        unit: String,
        /// The reason.
        why: Waiting,
    },
    /// A dwell is to be repeated.
    Redo {
        /// Number of the dwell.
        number: i32,
    },
    /// State of the calibration after a dwell.
    Progress {
        /// Name of the unit.
        unit: String,
        /// Half-widths and targets.
        progress: Progress,
    },
    /// The line was lost or restored, the device restarted, or another unit is at the port.
    Interrupted {
        /// Name of the unit.
        unit: String,
        /// What happened.
        why: Interruption,
    },
    /// The calibration was verified.
    Verified {
        /// Name of the unit.
        unit: String,
        /// The figures.
        judged: Judged,
    },
    /// A calibration was stored, read back and compared.
    Stored {
        /// Name of the unit.
        unit: String,
        /// Hash of the calibration.
        hash: String,
        /// The checks that were made.
        words: String,
    },
    /// The remaining errors were diagnosed.
    Diagnosed {
        /// Name of the unit.
        unit: String,
        /// Verdict of the diagnosis.
        verdict: Verdict,
        /// The effects found, each with its magnitude.
        effects: Vec<String>,
        /// File of the diagnosis page.
        page: String,
    },
    /// The field at the magnetometer is not that of the poses before.
    Field {
        /// Name of the unit.
        unit: String,
        /// How it differs, and what to do.
        words: String,
    },
    /// Information for the user.
    Note {
        /// The message.
        words: String,
    },
    /// A yes/no question.
    Question {
        /// `power-cycled`, `store-effects`, `store-rough`, `go-on`.
        question: &'static str,
        /// The question in a sentence.
        words: String,
    },
}

impl Event {
    /// The unit concerned, if any: the JSON says it under one key for all kinds.
    pub fn unit(&self) -> Option<String> {
        let json = serde_json::to_value(self).ok()?;
        Some(json.get("unit")?.as_str()?.to_owned())
    }
}

/// The present phase of a session.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, strum::Display)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Phase {
    /// Opening the units.
    #[default]
    Start,
    /// Waiting for rest and a steady temperature.
    WarmUp,
    /// Dwells for the calibration.
    Calibration,
    /// Whole turns for the calibration.
    #[serde(rename = "whole turns")]
    #[strum(serialize = "whole turns")]
    WholeTurns,
    /// Dwells for the verification.
    Verification,
    /// Storing the calibration on the device.
    Store,
    /// Diagnosing the remaining errors.
    Diagnosis,
    /// Dwells that verify the calibration with effects.
    Confirmation,
}

impl Phase {
    /// The recording that its dwells belong to.
    pub fn part(self) -> Part {
        match self {
            Self::Verification => Part::Verification,
            Self::Confirmation => Part::Confirmation,
            _ => Part::Calibration,
        }
    }
}

/// State of a unit.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct UnitState {
    /// Name of the unit.
    pub unit: String,
    /// Motion of gyro and accelerometer, relative to the limit of rest.
    pub motion: Option<[f64; 2]>,
    /// Largest accepted motion: 1, and more for the gyro while the unit turns.
    pub motion_limits: [f64; 2],
    /// Unit vector upwards in the body frame.
    pub up: Option<[f64; 3]>,
    /// Angle between up and the requested direction, degrees.
    pub tilt_deg: Option<f64>,
    /// Largest accepted angle, degrees.
    pub tilt_limit_deg: f64,
    /// Rate about the vertical, deg/s; `None` without a data sheet until there is a calibration.
    pub rate_dps: Option<f64>,
    /// Largest accepted difference from the requested rate, deg/s.
    pub rate_limit_dps: f64,
    /// Temperature, °C.
    pub temp_c: Option<f64>,
    /// Rate of change of the temperature, °C/min.
    pub trend_c_per_min: Option<f64>,
    /// Limit of this rate during warm-up, if the session waits for it.
    pub trend_limit_c_per_min: Option<f64>,
    /// How the field at the magnetometer differs from that of the poses before; `None` while it does not, or if that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Samples received.
    pub samples: u64,
    /// Missing samples.
    pub lost: u64,
    /// Samples with a reading at the end of its range.
    pub clipped: u64,
    /// Why no dwell runs; `None` while one runs.
    pub waiting: Option<Waiting>,
    /// Remaining time of the dwell, s.
    pub left_s: Option<f64>,
    /// The whole turns that are asked for, and how far they are.
    pub spin: Option<SpinState>,
}

/// State of the session.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SessionState {
    /// The present phase.
    pub phase: Phase,
    /// The requested dwell.
    pub step: Option<Step>,
    /// Completed and planned dwells.
    pub dwells: [usize; 2],
    /// Discarded dwells.
    pub discarded: usize,
    /// Time since the beginning by the units' clock, s.
    pub elapsed_s: f64,
    /// State of each unit.
    pub units: Vec<UnitState>,
    /// State of each calibration, as far as it is determined.
    pub progress: Vec<Progress>,
}

/// A request of the user since the last call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UserRequest {
    /// End the session. Its data are kept, and it can be resumed.
    Cancel,
    /// Repeat the last dwell.
    RedoLast,
    /// Repeat the dwell with this number.
    Redo(i32),
    /// Record another pose first; this one follows later.
    Skip,
}

/// A yes/no question.
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
    /// Name in [`Event::Question`].
    pub fn name(&self) -> &'static str {
        match self {
            Self::PowerCycled => "power-cycled",
            Self::StoreEffects(_) => "store-effects",
            Self::StoreRough(_) => "store-rough",
            Self::GoOn(_) => "go-on",
        }
    }

    /// The question as a sentence.
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

/// Shows a session to the user, and receives requests.
pub trait View {
    /// Reports an event.
    fn tell(&mut self, event: &Event);

    /// Shows the present state; called many times a second.
    fn show(&mut self, state: &SessionState);

    /// The user's request since the last call.
    fn request(&mut self) -> Option<UserRequest>;

    /// Asks a question. Returns `None` until it is answered.
    fn ask(&mut self, question: &Question) -> Option<bool>;
}
