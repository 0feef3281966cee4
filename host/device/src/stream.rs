//! Receives one of the streams, sample by sample, and summarises it.

use std::time::{Duration, Instant};

use mimu_core::compensation::Sample;
use mimu_core::wire::{BatchHead, Request};
use serde::Serialize;

use super::flagged::Flagged;
use super::received::{Event, LineCount};
use super::session::Session;
use mimu_recording::error::Result;

/// Which stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stream {
    /// Raw readings, V at the sensors.
    Raw,
    /// Compensated on the device, rad/s and m/s² in the body frame.
    Compensated,
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
    /// Last temperatures by the TEMP pins of gyro x, y, z, °C; for the raw stream only.
    pub gyro_temps_c: Option<[f32; 3]>,
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

/// Mean and standard deviation of the samples of a triad, x, y, z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moments {
    /// Unit of mean and standard deviation.
    pub unit: &'static str,
    /// Means.
    pub mean: [f64; 3],
    /// Standard deviations.
    pub deviation: [f64; 3],
}

impl Streamed {
    pub(super) fn new(stream: Stream) -> Self {
        let units = match stream {
            Stream::Raw => ["V", "V"],
            Stream::Compensated => ["rad/s", "m/s^2"],
        };
        let [gyro, accel] = units.map(|unit| Moments {
            unit,
            mean: [0.0; 3],
            deviation: [0.0; 3],
        });
        Self {
            stream,
            samples: 0,
            missing: 0,
            first: None,
            temp_c: 0.0,
            gyro_temps_c: None,
            flagged: Flagged::default(),
            gyro,
            accel,
            line: LineCount::default(),
        }
    }
}

/// Receives samples for `duration` of the device's time, or until `stop` returns true. `take` gets each sample with its number.
pub fn stream(
    session: &mut Session,
    which: Stream,
    duration: Option<Duration>,
    mut stop: impl FnMut() -> bool,
    mut take: impl FnMut(&BatchHead, u32, &Sample<f32>) -> Result<()>,
) -> Result<Streamed> {
    let rate_hz = f64::from(session.who().sample_rate_hz);
    let wanted = duration.map(|d| (d.as_secs_f64() * rate_hz).round() as u64);
    let mut found = Streamed::new(which);
    let mut expected: Option<u32> = None;
    let mut last = Instant::now();
    let before = session.count();
    let request = Request::Stream {
        raw: which == Stream::Raw,
        compensated: which == Stream::Compensated,
    };
    session.begin_stream(request)?;
    'all: while !stop() {
        let batch = match (session.stream_event(last, "stream")?, which) {
            (Some(Event::Raw(batch)), Stream::Raw)
            | (Some(Event::Compensated(batch)), Stream::Compensated) => batch,
            _ => continue,
        };
        last = Instant::now();
        found.temp_c = f64::from(batch.head.temp_c);
        found.gyro_temps_c = batch.gyro_temps_c;
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
