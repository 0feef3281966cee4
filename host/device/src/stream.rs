//! Receives one of the streams, sample by sample, and summarises it.

use std::time::{Duration, Instant};

use mimu_core::compensation::Sample;
use mimu_core::wire::{BatchHead, Request};
use serde::Serialize;

use super::flagged::Flagged;
use super::reading::shortest;
use super::received::{Event, LineCount};
use super::session::Session;
use mimu_recording::error::Result;

/// Which stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stream {
    /// Raw readings, in the unit of the greeting.
    Raw,
    /// Compensated on the device, rad/s and m/s² in the body frame.
    Compensated,
}

impl Stream {
    /// The request for it.
    pub fn request(self) -> Request<'static> {
        Request::Stream {
            raw: self == Self::Raw,
            compensated: self == Self::Compensated,
        }
    }
}

/// Summary of a stream: the result of `mimu device stream`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Streamed {
    /// Which stream.
    pub stream: Stream,
    /// Samples.
    pub samples: u64,
    /// Samples missing between the first and the last.
    pub missing: u64,
    /// Number of the first sample.
    pub first: Option<u32>,
    /// The last temperature, °C.
    pub temp_c: f64,
    /// Samples per second by the board's crystal, from the last batch.
    pub rate_hz: f64,
    /// The last readings of the thermometers; for the raw stream only.
    pub thermometers: Vec<Thermometer>,
    /// Faults that the device flags.
    #[serde(flatten)]
    pub flagged: Flagged,
    /// Statistics of the gyro.
    pub gyro: Moments,
    /// Statistics of the accelerometer.
    pub accel: Moments,
    /// Counts of what was received on the line.
    pub line: LineCount,
}

/// Reading of a thermometer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Thermometer {
    /// Its place.
    pub place: String,
    /// Its temperature, °C.
    pub temp_c: f64,
}

/// Mean and standard deviation of the samples of a triad, x, y, z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moments {
    /// Unit of mean and standard deviation.
    pub unit: String,
    /// Means.
    pub mean: [f64; 3],
    /// Standard deviations.
    pub deviation: [f64; 3],
}

impl Streamed {
    /// Before the first sample; `raw_unit` is that of the raw stream.
    pub(super) fn new(stream: Stream, raw_unit: &str) -> Self {
        let units = match stream {
            Stream::Raw => [raw_unit, raw_unit],
            Stream::Compensated => ["rad/s", "m/s^2"],
        };
        let [gyro, accel] = units.map(|unit| Moments {
            unit: unit.to_owned(),
            mean: [0.0; 3],
            deviation: [0.0; 3],
        });
        Self {
            stream,
            samples: 0,
            missing: 0,
            first: None,
            temp_c: 0.0,
            rate_hz: f64::NAN,
            thermometers: Vec::new(),
            flagged: Flagged::default(),
            gyro,
            accel,
            line: LineCount::default(),
        }
    }
}

/// How often a stream is requested before its first sample.
const ASKED: u32 = 4;

/// The summary of `duration` of the raw stream.
pub fn look(session: &mut Session, duration: Duration) -> Result<Streamed> {
    stream(
        session,
        Stream::Raw,
        Some(duration),
        || false,
        |_, _, _| Ok(()),
    )
}

/// Receives samples for `duration` of the device's time, or until `stop` returns true. `take` gets each sample with its number.
pub fn stream(
    session: &mut Session,
    which: Stream,
    duration: Option<Duration>,
    mut stop: impl FnMut() -> bool,
    mut take: impl FnMut(&BatchHead, u32, &Sample<f32>) -> Result<()>,
) -> Result<Streamed> {
    let who = session.who().clone();
    let wanted = duration.map(|d| (d.as_secs_f64() * who.sample_rate_hz).round() as u64);
    let mut found = Streamed::new(which, &who.raw_unit);
    let mut expected: Option<u32> = None;
    let mut last = Instant::now();
    let before = session.count();
    session.begin_stream(which.request())?;
    let mut asked = 1;
    'all: while !stop() {
        let event = match session.stream_event(last, "stream") {
            // A board that is still starting, or that has just restarted, has not kept the request.
            Err(_) if expected.is_none() && asked < ASKED => {
                session.begin_stream(which.request())?;
                (asked, last) = (asked + 1, Instant::now());
                continue;
            }
            event => event?,
        };
        let batch = match (event, which) {
            (Some(Event::Raw(batch)), Stream::Raw)
            | (Some(Event::Compensated(batch)), Stream::Compensated) => batch,
            _ => continue,
        };
        last = Instant::now();
        found.temp_c = f64::from(batch.head.temp_c);
        found.rate_hz = batch.head.rate_hz();
        let readings = who.thermometers.iter().zip(&batch.temperatures_c);
        found.thermometers.clear();
        found
            .thermometers
            .extend(readings.map(|(place, temp_c)| Thermometer {
                place: place.clone(),
                temp_c: shortest(*temp_c),
            }));
        for (k, sample) in (0..).zip(&batch.values) {
            let number = batch.head.first.wrapping_add(k);
            let lost = number.wrapping_sub(expected.unwrap_or(number));
            found.missing += u64::from(lost);
            found.first.get_or_insert(number);
            if wanted.is_some_and(|wanted| found.samples + found.missing >= wanted) {
                break 'all;
            }
            expected = Some(number.wrapping_add(1));
            found.samples += 1;
            found.flagged.count(batch.head.flags, 1);
            // Welford's method: with a bias of volts and noise of microvolts, plain sums would lose the noise. Until the end, `deviation` contains
            // sums of squares.
            let triads = [
                (&mut found.gyro, &sample.gyro),
                (&mut found.accel, &sample.accel),
            ];
            for (moments, values) in triads {
                for (i, value) in values.iter().map(|v| f64::from(*v)).enumerate() {
                    let off = value - moments.mean[i];
                    moments.mean[i] += off / found.samples as f64;
                    moments.deviation[i] += off * (value - moments.mean[i]);
                }
            }
            take(&batch.head, number, sample)?;
        }
    }
    session.done(Request::Stop, "to stop streaming")?;
    session.forget_events();
    let freedom = found.samples.saturating_sub(1).max(1) as f64;
    for moments in [&mut found.gyro, &mut found.accel] {
        moments.deviation = moments.deviation.map(|s| (s / freedom).sqrt());
    }
    found.line = session.count().since(&before);
    Ok(found)
}
