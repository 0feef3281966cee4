//! A mimu device as a source of samples.

use std::time::{Duration, Instant};

use mimu::signal::increment::pause_periods;
use mimu_core::wire::flags;
use mimu_device::record::shortest;
use mimu_device::{Event, Identity, Samples, Session, Started, Stream, look};
use mimu_recording::{RawUnit, Result};

use crate::source::{Chunk, Source, SourceEvent, Unit};

/// Silence after which the device is asked to greet and stream again.
const SILENCE: Duration = Duration::from_secs(2);
/// Change of the sample rate within a [`LOOK`] below which it is used.
const SETTLED: f64 = 20e-6;
/// Time between two looks at the sample rate, and most of them.
const LOOK: Duration = Duration::from_secs(1);
const LOOKS: u32 = 8;

/// The raw stream of a device.
#[derive(Debug)]
pub struct DeviceSource {
    session: Session,
    unit: Unit,
    streaming: bool,
    heard: Instant,
    /// Tick of the sample with number 0, and tick of the next sample.
    zero: i64,
    next: u64,
    /// What has to be added to the crystal's time, ns.
    zero_ns: i64,
    /// Whether the next sample begins a new count.
    anew: bool,
    /// Time since power-on at the start of sampling, s.
    powered_for_s: Option<f64>,
}

impl DeviceSource {
    /// Opens the port, or the only one where a device answers. `next`: the first tick that it may use.
    pub fn open(port: Option<&str>, next: u64) -> Result<Self> {
        let mut session = Session::open(port)?;
        let rate_hz = settled_rate_hz(&mut session)?;
        let who = session.who();
        let mut told = vec![format!(
            "{}, firmware {}, unit {}",
            who.board, who.firmware, who.unit_id
        )];
        told.push(match &who.stored {
            None => "it stores no calibration".into(),
            Some(held) => format!("it stores the calibration {}", held.hash),
        });
        told.push(format!("last reset cause: {}", who.start));
        told.extend(who.warnings.iter().cloned());
        let unit = Unit {
            id: who.unit_id.clone(),
            name: mimu_device::unit_name(&who.unit_id),
            raw_unit: who.raw_unit(session.port())?,
            sensors: Some(who.settings()),
            rate_hz,
            has_mag: false,
            nominal: Some(who.nominal()),
            told,
            is_device: true,
            start: unless_power_on(&who.start),
        };
        Ok(Self {
            powered_for_s: powered_for_s(who),
            session,
            unit,
            streaming: false,
            heard: Instant::now(),
            zero: 0,
            next,
            zero_ns: 0,
            anew: true,
        })
    }

    fn take(&mut self, samples: &Samples) -> Result<SourceEvent> {
        self.heard = Instant::now();
        let number = i64::from(samples.head.first);
        let crystal_ns = 1000 * samples.head.tick_us as i64;
        // After a restart of the count the elapsed time is unknown. It is assumed to be so long that no turn is integrated across it.
        let back = self.zero + number < self.next as i64;
        if self.anew || back {
            let pause = match self.next {
                0 => 1,
                _ => pause_periods(self.unit.rate_hz),
            };
            let tick = self.next + pause;
            self.zero = tick as i64 - number;
            self.zero_ns = (1e9 * tick as f64 / self.unit.rate_hz).round() as i64 - crystal_ns;
            self.anew = false;
        }
        let tick = (self.zero + number) as u64;
        let values = samples.rows(self.session.port())?;
        self.next = tick + values.len() as u64;
        Ok(SourceEvent::Samples(Chunk {
            tick,
            values,
            mag: Vec::new(),
            temp_c: shortest(samples.head.temp_c),
            saturated: samples.head.flags & flags::SATURATED != 0,
            self_test: samples.head.flags & flags::SELF_TEST != 0,
            crystal_ns: Some([
                (crystal_ns + self.zero_ns) as u64,
                u64::from(samples.head.period_ns),
            ]),
            power_on_s: self.powered_for_s.map(|s| self.zero_ns as f64 / 1e9 - s),
        }))
    }
}

/// The sample rate by the board's crystal, Hz. A digital sensor has a clock of its own, whose rate the board knows to 0.1 % at its first sample and to
/// 20 ppm some seconds later.
fn settled_rate_hz(session: &mut Session) -> Result<f64> {
    let raw_unit = session.who().raw_unit(session.port())?;
    let mut rate_hz = session.who().sample_rate_hz;
    if raw_unit != RawUnit::Count {
        return Ok(rate_hz);
    }
    for _ in 0..LOOKS {
        let seen = look(session, LOOK)?;
        let before_hz = std::mem::replace(&mut rate_hz, seen.rate_hz);
        if (rate_hz / before_hz - 1.0).abs() < SETTLED {
            break;
        }
    }
    Ok(rate_hz)
}

fn powered_for_s(who: &Identity) -> Option<f64> {
    who.powered_for_ms.map(|ms| f64::from(ms) / 1000.0)
}

fn unless_power_on(start: &Started) -> Option<String> {
    (*start != Started::PowerOn).then(|| start.to_string())
}

impl Source for DeviceSource {
    fn unit(&self) -> &Unit {
        &self.unit
    }

    fn next(&mut self) -> Result<SourceEvent> {
        if !self.streaming {
            self.session.begin_stream(Stream::Raw.request())?;
            (self.streaming, self.heard) = (true, Instant::now());
        }
        match self.session.event()? {
            Some(Event::Raw(samples)) => self.take(&samples),
            Some(Event::Started(who)) => {
                self.anew = true;
                self.powered_for_s = powered_for_s(&who);
                self.unit.start = unless_power_on(&who.start);
                self.streaming = false;
                Ok(SourceEvent::Restarted(who.start.to_string()))
            }
            Some(_) => Ok(SourceEvent::Nothing),
            None if self.heard.elapsed() > SILENCE => {
                // It may have restarted, and its greeting may be lost.
                self.session.hello()?;
                self.streaming = false;
                Ok(SourceEvent::Nothing)
            }
            None => Ok(SourceEvent::Nothing),
        }
    }

    fn device(&mut self) -> Option<&mut Session> {
        self.streaming = false;
        Some(&mut self.session)
    }
}
