//! Recording a device: its raw stream into a directory that can be read at any time.
//!
//! Times are the device's own: sample n of its 1 kHz is at n/1000 s since it began to sample, so that a sample that is missing is a
//! gap in `t_s` and never moves the ones after it.

mod clock;
mod steps;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mimu_core::wire::Request;

use serde::{Serialize, Serializer};

pub use steps::Steps;

use crate::flagged::Flagged;
use crate::heard::{Event, LineCount, Samples};
use crate::result::TOOL;
use crate::session::Session;
use crate::who::Started;
use clock::Clock;
use mimu_recording::error::{Error, Result};
use mimu_recording::{
    Batch, Columns, Growing, Manifest, RawUnit, Recorded, Reference, Restart, SampleFormat,
};

/// Silence after which the device is asked whether it is still there.
const SILENCE: Duration = Duration::from_secs(2);

/// What to record.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordOptions {
    /// Directory of the new recording.
    pub directory: PathBuf,
    /// Length in the device's time; without it until it is ended.
    pub duration: Option<Duration>,
    /// Where dwells begin and end.
    pub steps: Steps,
    /// Name of the unit; without it, the number of its microcontroller.
    pub device: Option<String>,
    /// Local gravity, m/s².
    pub gravity_mps2: f64,
    /// Degrees.
    pub latitude_deg: Option<f64>,
    /// Format in the end. While it is received, it is CSV.
    pub format: SampleFormat,
}

/// What the person at the keyboard wants, since the last time that was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wish {
    /// End the recording.
    pub end: bool,
    /// Times that a dwell was to begin, or the running one to end.
    pub marks: u32,
}

/// How a recording stands.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Standing {
    /// Samples written.
    pub samples: u64,
    /// Samples missing between them, restarts left out.
    pub missing: u64,
    /// Stretches of missing samples.
    pub gaps: u64,
    /// Time of the first sample, s.
    pub first_s: Option<f64>,
    /// Time of the last, s.
    pub last_s: Option<f64>,
    /// Dwells begun.
    pub dwells: u32,
    /// Dwell that runs.
    #[serde(skip)]
    pub step: Option<i32>,
    /// Restarts of the device.
    pub restarts: Vec<Restart>,
    /// Times that a device which was still there had to be told to stream again.
    pub resumed: u32,
    /// °C, the last.
    pub temp_c: f64,
    /// What the device says is wrong with them.
    #[serde(flatten)]
    pub flagged: Flagged,
    /// What was heard on the line.
    pub line: LineCount,
}

/// A recording that was ended: the result of `mimu record`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordSummary {
    /// `mimu-record/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// Port of the device.
    pub port: String,
    /// Directory.
    pub recording: String,
    /// How it stood in the end.
    #[serde(flatten)]
    pub standing: Standing,
    /// Why it ended before it was to: the recording is whole up to there.
    #[serde(serialize_with = "as_words")]
    pub broken_off: Option<Error>,
}

fn as_words<S: Serializer>(of: &Option<Error>, to: S) -> std::result::Result<S::Ok, S::Error> {
    of.as_ref().map(Error::to_string).serialize(to)
}

/// Records. `look` is shown how it stands, some times a second, and says what is wanted; `finishing` hears the share that is done of
/// turning the samples into Parquet.
///
/// An error means that there is no recording. One that was broken off is a [`RecordSummary`], with its reason.
pub fn record(
    session: &mut Session,
    options: &RecordOptions,
    mut look: impl FnMut(&Standing) -> Wish,
    finishing: impl Fn(f64),
) -> Result<RecordSummary> {
    let who = session.who().clone();
    if who.raw_unit != "V" {
        let problem = format!(
            "its raw readings are in {}, and a recording of V is made",
            who.raw_unit
        );
        return Err(Error::new(
            session.port(),
            problem,
            "update mimu on this computer",
        ));
    }
    let device = options.device.clone();
    let mut manifest = Manifest::new(
        device.unwrap_or_else(|| format!("mimu-{}", who.unit_id)),
        f64::from(who.sample_rate_hz),
        options.gravity_mps2,
        RawUnit::Volt,
        Reference::Gravity,
    );
    manifest.latitude_deg = options.latitude_deg;
    // Its clock begins with every start, after a reset too: the die is warm then, and a warm-up counted from there would be another with
    // every reset. The device knows for how long it has had its power, unless it has lost that in the reset.
    let by_power = who.start == Started::PowerOn;
    manifest.power_on_s = who.powered_for_ms.map(|ms| -f64::from(ms) / 1000.0);
    manifest.recorded = Some(Recorded {
        tool: TOOL.into(),
        firmware: who.firmware.clone(),
        board: who.board.clone(),
        unit_id: who.unit_id.clone(),
        start: (!by_power).then(|| who.start.to_string()),
        ..Recorded::default()
    });
    let columns = Columns {
        step: options.steps != Steps::Detected,
        temp_c: true,
        gyro: true,
        accel: true,
        reference: [false; 6],
    };
    let growing = Growing::create(&options.directory, columns, &manifest)?;
    let mut run = Run {
        growing,
        clock: Clock::new(who.sample_rate_hz),
        steps: options.steps.clone(),
        standing: Standing::default(),
        begun: None,
        heard: Instant::now(),
        unit_id: who.unit_id,
        // A program that was killed may have left half a frame.
        before: session.count(),
    };
    let ended = run.receive(session, options, &mut look);
    let mut standing = run.standing;
    standing.line = session.count().since(&run.before);
    if let Some(recorded) = &mut manifest.recorded {
        recorded.missing = standing.missing;
        recorded.restarts = standing.restarts.clone();
    }
    // A device that is gone needs not be told.
    let _ = ended
        .is_ok()
        .then(|| session.done(Request::Stop, "to stop streaming"));
    run.growing.finish(&manifest, options.format, finishing)?;
    match ended {
        Ok(()) if standing.samples == 0 => Err(Error::new(
            session.port(),
            "no sample came, and nothing is recorded",
            "reset the board and run it again",
        )),
        Err(error) if standing.samples == 0 => Err(error),
        ended => Ok(RecordSummary {
            format: "mimu-record/1",
            tool: TOOL,
            port: session.port().to_owned(),
            recording: options.directory.display().to_string(),
            broken_off: ended
                .err()
                .map(|error| kept(error, standing.samples, &options.directory)),
            standing,
        }),
    }
}

/// `error`, with where to find what was received.
fn kept(error: Error, samples: u64, directory: &Path) -> Error {
    let kept = format!(" ({samples} samples are kept in {})", directory.display());
    error.map(|e| e.problem += &kept)
}

struct Run {
    growing: Growing,
    clock: Clock,
    steps: Steps,
    standing: Standing,
    /// Tick of the first sample.
    begun: Option<u64>,
    heard: Instant,
    unit_id: String,
    /// What had been heard on the line before it began.
    before: LineCount,
}

impl Run {
    fn receive(
        &mut self,
        session: &mut Session,
        options: &RecordOptions,
        look: &mut impl FnMut(&Standing) -> Wish,
    ) -> Result<()> {
        let raw = Request::Stream {
            raw: true,
            compensated: false,
        };
        session.begin_stream(raw)?;
        let rate_hz = f64::from(session.who().sample_rate_hz);
        let wanted = options
            .duration
            .map(|d| (d.as_secs_f64() * rate_hz).round() as u64);
        loop {
            match session.event()? {
                Some(Event::Raw(batch)) => {
                    self.take(session.port(), &batch, wanted)?;
                    if self.is_done(wanted) {
                        return Ok(());
                    }
                }
                Some(Event::Started(who)) => {
                    if who.unit_id != self.unit_id {
                        let problem =
                            format!("another device is at the port now ({})", who.unit_id);
                        return Err(Error::new(
                            session.port(),
                            problem,
                            "record each for itself",
                        ));
                    }
                    self.clock.restarted(Some(who.start.clone()));
                    session.done(raw, "to stream")?;
                }
                Some(_) => {}
                None if self.heard.elapsed() > SILENCE => {
                    // It may have restarted, and its greeting been lost.
                    session.hello()?;
                    session.done(raw, "to stream")?;
                    self.standing.resumed += 1;
                    self.heard = Instant::now();
                }
                None => {}
            }
            self.standing.line = session.count().since(&self.before);
            let wish = look(&self.standing);
            for _ in 0..wish.marks {
                self.steps.mark();
            }
            if wish.end {
                return Ok(());
            }
        }
    }

    fn is_done(&self, wanted: Option<u64>) -> bool {
        let next = self.clock.next();
        wanted.is_some_and(|wanted| self.begun.is_some_and(|begun| next - begun >= wanted))
    }

    fn take(&mut self, port: &str, samples: &Samples, wanted: Option<u64>) -> Result<()> {
        let silence = self.heard.elapsed();
        self.heard = Instant::now();
        let arrival = self.clock.arrive(samples.head.first, silence);
        let first = arrival.tick;
        let begun = *self.begun.get_or_insert(first);
        if arrival.missing > 0 {
            self.standing.missing += arrival.missing;
            self.standing.gaps += 1;
        }
        if let Some(start) = arrival.restart {
            self.standing.restarts.push(Restart {
                t_s: self.clock.seconds(first),
                start: start.map_or("its greeting was lost".into(), |s: Started| s.to_string()),
            });
        }
        let room = wanted.map_or(u64::MAX, |wanted| (begun + wanted).saturating_sub(first));
        let count = samples
            .values
            .len()
            .min(usize::try_from(room).unwrap_or(usize::MAX));
        let mut batch = Batch {
            first_row: self.growing.rows(),
            ..Batch::default()
        };
        for (tick, sample) in (first..).zip(&samples.values[..count]) {
            batch.t_s.push(self.clock.seconds(tick));
            if let Some(step) = self.steps.at(self.clock.length(tick - begun)) {
                batch.step.push(step);
                self.standing.step = (step >= 0).then_some(step);
                self.standing.dwells = self.standing.dwells.max((step + 1) as u32);
            }
            batch.temp_c.push(f64::from(samples.head.temp_c));
            let values = sample.gyro.iter().chain(sample.accel.iter());
            for (column, value) in batch.raw.iter_mut().zip(values) {
                if !value.is_finite() {
                    let problem = "the device sent a reading that is not a number";
                    return Err(Error::new(
                        port,
                        problem,
                        "reset the board, and report this",
                    ));
                }
                column.push(f64::from(*value));
            }
        }
        self.clock.passed(samples.values.len());
        if count == 0 {
            return Ok(());
        }
        self.growing.write(&batch)?;
        let standing = &mut self.standing;
        standing.samples += count as u64;
        standing.temp_c = f64::from(samples.head.temp_c);
        standing.flagged.count(samples.head.flags, count as u64);
        standing.first_s.get_or_insert(self.clock.seconds(first));
        standing.last_s = Some(self.clock.seconds(first + count as u64 - 1));
        Ok(())
    }
}
