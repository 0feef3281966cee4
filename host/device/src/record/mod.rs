//! Recording a device: its raw stream into a directory that can be read at any time.
//!
//! Times are the device's own, by its crystal, since it began to sample. A missing sample is therefore a gap in `t_s`, and does not move later ones.
//! The same holds for the time without a line when a cable is pulled. The rate of a sensor with a clock of its own is the mean over the recording.

mod clock;
mod known;
mod line;
mod run;
mod steps;

use std::path::{Path, PathBuf};
use std::time::Duration;

use mimu_core::wire::Request;

use serde::{Serialize, Serializer};

pub use crate::reading::shortest;
pub use known::Known;
pub use steps::Steps;

use crate::flagged::Flagged;
use crate::identity::{Identity, Started, unit_name};
use crate::received::LineCount;
use crate::result::TOOL;
use crate::session::Session;
use mimu_recording::error::{Error, Result};
use mimu_recording::{Manifest, RawUnit, Recorded, Reference, Restart, SampleFormat};
use run::Run;

/// What to record.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordOptions {
    /// Directory of the new recording.
    pub directory: PathBuf,
    /// Length in the device's time. Without it, the recording runs until it is ended.
    pub duration: Option<Duration>,
    /// Where dwells begin and end.
    pub steps: Steps,
    /// How long to wait for a port that has vanished. With zero the recording ends at once.
    pub reconnect: Duration,
    /// Whether every dwell has a known input. The reference is then a table.
    pub table: bool,
    /// Name of the unit; without it, the number of its microcontroller.
    pub device: Option<String>,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// Latitude, degrees.
    pub latitude_deg: Option<f64>,
    /// Final format. During the recording the samples are CSV.
    pub format: SampleFormat,
}

/// Requests of the person at the keyboard since the last query.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct UserRequest {
    /// End the recording.
    pub end: bool,
    /// How many times a dwell was to begin, or the running one to end.
    pub marks: u32,
}

/// State of a recording.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct RecordingState {
    /// Samples written.
    pub samples: u64,
    /// Samples missing between them, without those of restarts.
    pub missing: u64,
    /// Number of gaps.
    pub gaps: u64,
    /// Time of the first sample, s.
    pub first_s: Option<f64>,
    /// Time of the last, s.
    pub last_s: Option<f64>,
    /// Dwells begun.
    pub dwells: u32,
    /// The running dwell.
    #[serde(skip)]
    pub step: Option<i32>,
    /// Restarts of the device.
    pub restarts: Vec<Restart>,
    /// Number of times that a connected device had to be asked to stream again.
    pub resumed: u32,
    /// Times that the port vanished and came back.
    pub reconnected: u32,
    /// The port has vanished, and is awaited.
    #[serde(skip)]
    pub waiting: bool,
    /// Discarded dwells: incomplete turns.
    pub dropped: Vec<i32>,
    /// The last temperature, °C.
    pub temp_c: f64,
    /// Faults that the device flags.
    #[serde(flatten)]
    pub flagged: Flagged,
    /// Counts of what was received on the line.
    pub line: LineCount,
    /// Further warnings.
    pub warnings: Vec<String>,
}

/// A completed recording: the result of `mimu record`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordSummary {
    /// `mimu-record/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// Port of the device.
    pub port: String,
    /// Directory of the recording.
    pub recording: String,
    /// Its final state.
    #[serde(flatten)]
    pub state: RecordingState,
    /// Why it ended early. It is complete up to that point.
    #[serde(serialize_with = "as_words")]
    pub broken_off: Option<Error>,
}

fn as_words<S: Serializer>(of: &Option<Error>, to: S) -> std::result::Result<S::Ok, S::Error> {
    of.as_ref().map(Error::to_string).serialize(to)
}

/// Records. `known` gives the inputs of the dwells, if they are known. `look` is shown the state several times a second, and returns the person's
/// requests; `finishing` gets the fraction done of the conversion to Parquet.
///
/// An error means that no recording was made. If a recording was broken off, the [`RecordSummary`] contains the reason.
pub fn record(
    session: &mut Session,
    options: &RecordOptions,
    known: Option<Known>,
    mut look: impl FnMut(&RecordingState) -> UserRequest,
    finishing: impl Fn(f64),
) -> Result<RecordSummary> {
    let who = session.who().clone();
    let raw_unit = who.raw_unit(session.port())?;
    let mut manifest = manifest(&who, raw_unit, options, known.as_ref());
    let mut run = Run::begin(session, options, known, &manifest)?;
    let ended = run.receive(session, options, &mut look);
    run.drop_open_turn();
    run.state.line = run.line.total(session.count());
    run.state.waiting = false;
    // A device that is gone cannot be stopped.
    let _ = ended
        .is_ok()
        .then(|| session.done(Request::Stop, "to stop streaming"));
    let samples = run.state.samples;
    // A disk that is full fails here too, and the first failure says why.
    let state = match (run.finish(&mut manifest, options.format, finishing), &ended) {
        (Ok(state), _) => state,
        (Err(error), _) if samples == 0 => return Err(error),
        (Err(_), Err(first)) => return Err(kept(first.clone(), samples, &options.directory)),
        (Err(error), Ok(())) => return Err(kept(error, samples, &options.directory)),
    };
    match ended {
        Ok(()) if state.samples == 0 => Err(Error::new(
            session.port(),
            "no sample came, so nothing was recorded",
            "reset the board and run it again",
        )),
        Err(error) if state.samples == 0 => Err(error),
        ended => Ok(RecordSummary {
            format: "mimu-record/1",
            tool: TOOL,
            port: session.port().to_owned(),
            recording: options.directory.display().to_string(),
            broken_off: ended
                .err()
                .map(|error| kept(error, state.samples, &options.directory)),
            state,
        }),
    }
}

/// The manifest, as far as it is known before the first sample.
fn manifest(
    who: &Identity,
    raw_unit: RawUnit,
    options: &RecordOptions,
    known: Option<&Known>,
) -> Manifest {
    let device = options.device.clone();
    let mut manifest = Manifest::new(
        device.unwrap_or_else(|| unit_name(&who.unit_id)),
        who.sample_rate_hz,
        options.gravity_mps2,
        raw_unit,
        match options.table {
            true => Reference::Table,
            false => Reference::Gravity,
        },
    );
    manifest.latitude_deg = options.latitude_deg;
    if let Some(known) = known {
        manifest.step_labels = known.labels().to_vec();
    }
    // The clock restarts after every reset, but the die stays warm: counted from a reset, each warm-up would look different. The device knows how
    // long it has had power, unless it lost that in the reset.
    let by_power = who.start == Started::PowerOn;
    manifest.power_on_s = who.powered_for_ms.map(|ms| -f64::from(ms) / 1000.0);
    manifest.recorded = Some(Recorded {
        tool: TOOL.into(),
        firmware: who.firmware.clone(),
        board: who.board.clone(),
        unit_id: who.unit_id.clone(),
        sensors: Some(who.settings()),
        start: (!by_power).then(|| who.start.to_string()),
        ..Recorded::default()
    });
    manifest
}

/// `error`, with the place of the samples received so far.
fn kept(error: Error, samples: u64, directory: &Path) -> Error {
    let kept = format!(" ({samples} samples are kept in {})", directory.display());
    error.map(|e| e.problem += &kept)
}
