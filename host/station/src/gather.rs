//! Samples of a unit at rest: from a recording, or from a unit at a port.

use std::time::{Duration, Instant};

use mimu_core::compensation::Affine;
use mimu_device::TestResult;
use mimu_recording::error::{Error, Result};
use mimu_recording::{Batch, Manifest, RawUnit, Recording, Reference, SensorSettings};
use mimu_wizard::source::{Source, SourceEvent};

/// Standard uncertainty of the rate of a board that writes lines, as a share: the reader finds it to 100 ppm.
const RATE_OF_LINES: f64 = 1e-4;
/// The same for a mimu device, whose rate the crystal shows to 20 ppm.
const RATE_OF_DEVICE: f64 = 2e-5;
/// A board may take this many times the length of the measurement, and this much more, to send its samples.
const SLOWER: f64 = 2.0;
const PATIENCE: Duration = Duration::from_secs(10);

/// A measurement of a unit at a port.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Take {
    /// Its length, s.
    pub seconds: f64,
    /// Time left out before it, s: hands leave the unit, and lines are on their way.
    pub skip_s: f64,
    /// Local gravity, m/s², with its standard uncertainty.
    pub gravity: [f64; 2],
}

/// What a unit sent, and what it is.
#[derive(Debug, Clone)]
pub struct Samples {
    /// The samples; time stamps by the clock of the unit, s.
    pub batch: Batch,
    /// Name of the unit.
    pub unit: String,
    /// The recording or the port, for messages.
    pub place: String,
    /// Unit of the readings.
    pub raw_unit: RawUnit,
    /// Local gravity, m/s², with its standard uncertainty.
    pub gravity: [f64; 2],
    /// The sensors as they are set, if that is known.
    pub sensors: Option<SensorSettings>,
    /// Model of gyro and accelerometer by the board, raw to SI.
    pub nominal: Option<[Affine<f64>; 2]>,
    /// Rate that the reader of the port found, Hz, with its standard uncertainty; `None` if the time stamps are the unit's own.
    pub rate_hz: Option<[f64; 2]>,
    /// What the board's self-test measured; empty if it has none.
    pub self_test: Vec<TestResult>,
}

impl Samples {
    /// The first `seconds` of a recording, or all of it. `gravity`: m/s² with its standard uncertainty; otherwise that of the manifest, as exact.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn of_recording(
        recording: &Recording,
        seconds: Option<f64>,
        gravity: Option<[f64; 2]>,
    ) -> Result<Self> {
        let mut all = Batch::default();
        recording.for_each_batch(
            |_| {},
            |batch| {
                let begin = all.t_s.first().or(batch.t_s.first()).copied();
                let end = begin.unwrap_or(0.0) + seconds.unwrap_or(f64::INFINITY);
                let rows = batch.t_s.iter().take_while(|t| **t < end).count();
                all.t_s.extend(&batch.t_s[..rows]);
                let extend = |to: &mut Vec<f64>, from: &[f64]| {
                    to.extend(from.iter().take(rows));
                };
                extend(&mut all.temp_c, &batch.temp_c);
                for (to, from) in all.raw.iter_mut().zip(&batch.raw) {
                    extend(to, from);
                }
                Ok(())
            },
        )?;
        let manifest = &recording.manifest;
        Ok(Self {
            batch: all,
            unit: manifest.device.clone(),
            place: recording.directory.display().to_string(),
            raw_unit: manifest.raw_unit,
            gravity: gravity.unwrap_or([manifest.gravity_mps2, 0.0]),
            sensors: manifest.recorded.as_ref().and_then(|r| r.sensors.clone()),
            nominal: None,
            rate_hz: None,
            self_test: Vec::new(),
        })
    }

    /// Samples of the unit at a port.
    ///
    /// # Errors
    /// The line is lost, the board restarts, or it takes far too long.
    pub fn of_source(
        source: &mut dyn Source,
        place: &str,
        Take {
            seconds,
            skip_s,
            gravity,
        }: Take,
    ) -> Result<Self> {
        let unit = source.unit().clone();
        let mut batch = Batch::default();
        let (begun, mut first) = (Instant::now(), None);
        let patience = PATIENCE + Duration::from_secs_f64(SLOWER * (seconds + skip_s));
        let skip = (skip_s * unit.rate_hz).round() as u64;
        let wanted = (seconds * unit.rate_hz).round() as u64;
        loop {
            match source.next()? {
                SourceEvent::Samples(chunk) if !chunk.self_test => {
                    let first = *first.get_or_insert(chunk.tick + skip);
                    for (tick, row) in (chunk.tick..).zip(&chunk.values) {
                        // Before the measurement, or after it.
                        let Some(tick) = tick.checked_sub(first).filter(|t| *t < wanted) else {
                            continue;
                        };
                        batch.t_s.push(tick as f64 / unit.rate_hz);
                        batch.temp_c.push(chunk.temp_c);
                        for (to, value) in batch.raw.iter_mut().zip(row) {
                            to.push(*value);
                        }
                    }
                    if chunk.tick + chunk.values.len() as u64 >= first + wanted {
                        break;
                    }
                }
                SourceEvent::Restarted(why) => {
                    let problem = format!("the board restarted during the measurement: {why}");
                    return Err(Error::device(
                        place,
                        problem,
                        "check its supply, and measure again",
                    ));
                }
                _ => {}
            }
            if begun.elapsed() > patience {
                let problem = format!(
                    "after {:.0} s it has sent {} of {wanted} samples",
                    begun.elapsed().as_secs_f64(),
                    batch.len()
                );
                return Err(Error::device(
                    place,
                    problem,
                    "check the cable, and measure again",
                ));
            }
        }
        if batch.temp_c.iter().all(|t| t.is_nan()) {
            batch.temp_c.clear();
        }
        let share = if unit.is_device {
            RATE_OF_DEVICE
        } else {
            RATE_OF_LINES
        };
        Ok(Self {
            batch,
            unit: unit.name,
            place: place.to_owned(),
            raw_unit: unit.raw_unit,
            gravity,
            sensors: unit.sensors,
            nominal: unit.nominal,
            rate_hz: Some([unit.rate_hz, share * unit.rate_hz]),
            self_test: Vec::new(),
        })
    }

    /// Whether the unit has a gyro (0) or an accelerometer (1).
    pub fn has(&self, sensor: usize) -> bool {
        (0..3).all(|axis| !self.batch.raw[3 * sensor + axis].is_empty())
    }

    /// A manifest for samples at rest at `rate_hz`.
    pub(crate) fn manifest(&self, rate_hz: f64) -> Manifest {
        Manifest::new(
            &self.unit,
            rate_hz,
            self.gravity[0],
            self.raw_unit,
            Reference::Gravity,
        )
    }
}
