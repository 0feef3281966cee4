//! What is wrong with a recording: one line for each kind, for every command that judges one.
//!
//! Most problems appear while the recording is read or its dwells are judged, as a [`Warning`] with figures. This module looks for what
//! only a fit shows: an implausible offset of an accelerometer, or a missing pose.

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::fault::Fault;
use crate::fit::{Fit, SensorFit, faces_not_up};
use crate::prepared::Prepared;
use crate::quantity::{AXES, Figure, Sensor, significant};
use crate::signal::blocks::extent;
use crate::warning::Warning;
use mimu_recording::RawUnit;
use mimu_recording::health::{self, Finding};

/// Offset of an accelerometer beyond any data sheet, g: those of MEMS parts allow up to 0.15.
const LARGEST_OFFSET_G: f64 = 0.5;
/// Sample rate below which turns by hand are too fast, Hz: between two samples at 20 Hz a hand at 200 deg/s changes its rate by a third.
const SLOW_HZ: f64 = 40.0;

/// What is wrong with a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordingProblem {
    /// An axis of the accelerometer, and its offset, g.
    #[error("accel_{} has an offset of {} g, more than any working part: check that the part is undamaged, that its range is set as assumed, and that its zero was subtracted", AXES[*.0], significant(*.1))]
    Offset(usize, f64),
    /// Sample rate of a recording in which the unit is turned by hand, Hz.
    #[error("{} Hz is a low rate for turns by hand: record at 50 Hz or more, or turn slowly", significant(*.0))]
    SlowForTurns(f64),
    /// Temperatures at which no board is used.
    #[error("{0}")]
    Temperatures(Finding),
    /// Faces that no pose had up.
    #[error("no pose has {0} up, so the errors there are unknown: add such poses")]
    MissingPoses(String),
    /// Samples that were lost between the device and the PC.
    #[error(
        "{0} samples were lost between the device and the PC: check the cable and the load of the PC"
    )]
    LostSamples(u64),
    /// Warnings of one kind from reading the recording and judging its dwells; at least one.
    #[error("{}", seen(.1))]
    Seen(Seen, Vec<Warning>),
}

/// Kinds of problems that appear without a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum Seen {
    /// Readings are not in their declared unit.
    Unit,
    /// A channel has no noise.
    DeadChannel,
    /// Readings at the ends of a converter, or of a sensor's range.
    Rails,
    /// Dwells or turns with readings at a rail.
    Clipping,
    /// Repeated readings: the sensor is slower than the log, or stuck.
    HeldReadings,
    /// Time stamps at another rate than the recording's.
    Clock,
    /// A sample rate that no inertial unit has.
    SampleRate,
    /// Times without samples.
    Gaps,
    /// Samples without a reading.
    EmptySamples,
    /// Values of the thermometer that cannot be temperatures.
    Temperatures,
    /// Firmware removes the bias of the gyro.
    BiasRemoved,
    /// Another range of the accelerometer from some row on.
    RangeChange,
    /// Columns that change places at some row.
    ColumnsMoved,
}

impl Seen {
    /// Kind of `warning`, if it is about a problem of the recording.
    fn of(warning: &Warning) -> Option<Self> {
        Some(match warning {
            Warning::Of(_, warning) | Warning::Channel(_, warning) => return Self::of(warning),
            Warning::CalibrationOfOther { .. } | Warning::NoisierThanGyros { .. } => Self::Unit,
            Warning::Health(finding) => Self::of_finding(finding.fault)?,
            Warning::Clipped { .. }
            | Warning::DwellsNotUsed {
                fault: Fault::Saturated(_),
                ..
            }
            | Warning::TurnNotUsed {
                fault: Some(Fault::Saturated(_)),
                ..
            } => Self::Clipping,
            Warning::DwellsNotUsed {
                fault: Fault::Stuck(_),
                ..
            }
            | Warning::TurnNotUsed {
                fault: Some(Fault::Stuck(_)),
                ..
            } => Self::HeldReadings,
            Warning::RateOff { .. } | Warning::TrustedClock(_) => Self::Clock,
            Warning::ImplausibleRate { .. } => Self::SampleRate,
            Warning::Gaps { .. } | Warning::TurnNotUsed { fault: None, .. } => Self::Gaps,
            Warning::Empty { .. }
            | Warning::DwellsNotUsed {
                fault: Fault::Missing(_),
                ..
            } => Self::EmptySamples,
            Warning::BiasRemoved(_) => Self::BiasRemoved,
            _ => return None,
        })
    }

    /// Kind of a fault of the readings, if a fit may see it.
    fn of_finding(fault: health::Fault) -> Option<Self> {
        Some(match fault {
            health::Fault::Dead { .. } => Self::DeadChannel,
            health::Fault::EndOfConverter { .. }
            | health::Fault::FullScale { .. }
            | health::Fault::RunAtEnd { .. }
            | health::Fault::CalmEnd { .. } => Self::Rails,
            health::Fault::NoGravity { .. }
            | health::Fault::NotSi { .. }
            | health::Fault::NotCounts { .. }
            | health::Fault::Turning { .. } => Self::Unit,
            health::Fault::NoTemperatures { .. } => Self::Temperatures,
            health::Fault::RangeChanged { .. } => Self::RangeChange,
            health::Fault::ColumnsMoved { .. } => Self::ColumnsMoved,
            health::Fault::Held { .. } => Self::HeldReadings,
            _ => return None,
        })
    }

    fn id(self) -> &'static str {
        self.into()
    }
}

/// What is wrong with one of the recordings that a command was given.
#[derive(Debug, Clone, PartialEq)]
pub struct OfRecording {
    /// Its file of samples, as in other messages.
    pub recording: String,
    /// What is wrong.
    pub problem: RecordingProblem,
}

impl OfRecording {
    /// All problems of a recording that was fitted.
    pub fn fitted(fit: &Fit) -> Vec<Self> {
        Self::named(&fit.prepared, RecordingProblem::of(fit))
    }

    /// The problems that appear without a fit, of a recording that was refused or is not fitted.
    pub fn prepared(prepared: &Prepared) -> Vec<Self> {
        Self::named(prepared, RecordingProblem::without_fit(prepared))
    }

    fn named(prepared: &Prepared, problems: Vec<RecordingProblem>) -> Vec<Self> {
        let named = problems.into_iter().map(|problem| Self {
            recording: prepared.place.clone(),
            problem,
        });
        named.collect()
    }
}

impl RecordingProblem {
    /// All problems of a recording that was fitted; those that may spoil all of it come first.
    pub fn of(fit: &Fit) -> Vec<Self> {
        let prepared = &fit.prepared;
        let mut all = Self::seen(fit.all_warnings());
        let accel = fit.sensor(Sensor::Accel);
        all.extend(accel.into_iter().flat_map(|accel| offsets(fit, accel)));
        let rate_hz = prepared.condensed.period_s.recip();
        let turns = fit
            .sensor(Sensor::Gyro)
            .filter(|g| g.figure == Figure::Direction);
        let implausible = Warning::of_rate(rate_hz).is_some();
        if turns.is_some() && rate_hz < SLOW_HZ && !implausible {
            all.push(Self::SlowForTurns(rate_hz));
        }
        let missing = accel
            .filter(|a| a.figure == Figure::GravityMagnitude)
            .and_then(|accel| {
                let poses = prepared.observations(Sensor::Accel);
                let raw: Vec<_> = poses.iter().map(|o| o.raw).collect();
                faces_not_up(&accel.estimated.triad.inverse, &raw)
            });
        all.extend(missing.map(Self::MissingPoses));
        all.extend(Self::of_board(prepared));
        all
    }

    /// The problems that appear without a fit.
    pub fn without_fit(prepared: &Prepared) -> Vec<Self> {
        let warnings = prepared.condensed.warnings.iter();
        let mut all = Self::seen(warnings.chain(&prepared.dwells.warnings));
        all.extend(Self::of_board(prepared));
        all
    }

    /// The `warnings` about problems of the recording, by kind.
    fn seen<'a>(warnings: impl Iterator<Item = &'a Warning>) -> Vec<Self> {
        let mut seen: Vec<(Seen, Vec<Warning>)> = Vec::new();
        for warning in warnings {
            let Some(kind) = Seen::of(warning) else {
                continue;
            };
            match seen.iter_mut().find(|(k, _)| *k == kind) {
                Some((_, all)) => all.push(warning.clone()),
                None => seen.push((kind, vec![warning.clone()])),
            }
        }
        seen.sort_by_key(|(kind, _)| *kind as usize);
        seen.into_iter()
            .map(|(kind, warnings)| Self::Seen(kind, warnings))
            .collect()
    }

    /// Problems of the board's thermometer and of its connection to the PC.
    fn of_board(prepared: &Prepared) -> Vec<Self> {
        let mut all = Vec::new();
        let blocks = prepared.condensed.blocks.iter().map(|b| b.temp_c.mean);
        let known = blocks.filter(|t| t.is_finite());
        let [low, high] = extent(known);
        all.extend(health::unusual_temperatures(low, high).map(Self::Temperatures));
        let lost = prepared.manifest.recorded.as_ref().map_or(0, |r| r.missing);
        if lost > 0 {
            all.push(Self::LostSamples(lost));
        }
        all
    }

    /// Stable name of its kind.
    pub fn id(&self) -> &'static str {
        match self {
            Self::Offset(..) => "offset",
            Self::SlowForTurns(_) => "slow_for_turns",
            Self::Temperatures(..) => Seen::Temperatures.id(),
            Self::MissingPoses(_) => "missing_poses",
            Self::LostSamples(_) => "lost_samples",
            Self::Seen(kind, _) => kind.id(),
        }
    }
}

impl Warning {
    /// Whether it is also reported as a problem of the recording, and need not be printed twice.
    pub fn is_of_recording(&self) -> bool {
        Seen::of(self).is_some()
    }
}

/// Axes of an accelerometer with an implausible offset. A converter's zero may be anywhere, but that of signed counts and of SI is 0.
fn offsets(fit: &Fit, accel: &SensorFit) -> Vec<RecordingProblem> {
    let prepared = &fit.prepared;
    let channels = || Sensor::Accel.channels();
    let blocks = || prepared.condensed.blocks.iter();
    let signed = || blocks().any(|b| channels().any(|c| b.raw[c].n > 0 && b.raw[c].mean < 0.0));
    let about_zero = match prepared.manifest.raw_unit {
        RawUnit::Si => true,
        RawUnit::Count => signed(),
        RawUnit::Volt => false,
    };
    let forward = &accel.estimated.triad.forward;
    let g = prepared.manifest.gravity_mps2;
    let off = |axis: usize| forward.bias[axis] / (forward.matrix.row(axis).norm() * g);
    let axes = (0..3).filter(|axis| about_zero && off(*axis).abs() > LARGEST_OFFSET_G);
    axes.map(|axis| RecordingProblem::Offset(axis, off(axis)))
        .collect()
}

/// The first of the warnings of one kind, and the number of the others.
fn seen(warnings: &[Warning]) -> String {
    match warnings {
        [] => String::new(),
        [only] => only.to_string(),
        [first, more @ ..] => format!("{first} (and {} more of this kind)", more.len()),
    }
}

impl Serialize for OfRecording {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("RecordingProblem", 3)?;
        out.serialize_field("id", self.problem.id())?;
        out.serialize_field("text", &self.problem.to_string())?;
        out.serialize_field("recording", &self.recording)?;
        out.end()
    }
}
