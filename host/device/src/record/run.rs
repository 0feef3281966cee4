//! A recording in progress.

use std::time::{Duration, Instant};

use mimu_recording::{Batch, Columns, Error, Growing, Manifest, Restart, Result, SampleFormat};

use super::clock::{Clock, seconds};
use super::known::Known;
use super::line;
use super::steps::Steps;
use super::{RecordOptions, RecordingState, UserRequest};
use crate::identity::Started;
use crate::reading::shortest;
use crate::received::{Event, Samples};
use crate::session::Session;
use crate::stream::Stream;

/// Silence after which the device is asked to greet and stream again.
const SILENCE: Duration = Duration::from_secs(2);

/// State of a recording in progress.
pub(super) struct Run {
    pub growing: Growing,
    pub clock: Clock,
    pub steps: Steps,
    pub known: Option<Known>,
    pub state: RecordingState,
    /// Time of the first sample, ns.
    pub begun_ns: Option<u64>,
    /// When the last samples came.
    pub heard: Instant,
    /// When the device was last asked to stream again.
    pub asked: Instant,
    pub unit_id: String,
    /// Starts of the device since its last power failure.
    pub starts: u32,
    pub line: line::LineTotals,
}

impl Run {
    /// Creates the recording, to which `manifest` belongs until its end.
    pub fn begin(
        session: &Session,
        options: &RecordOptions,
        known: Option<Known>,
        manifest: &Manifest,
    ) -> Result<Self> {
        let who = session.who();
        let columns = Columns {
            step: options.steps != Steps::Detected,
            temp_c: true,
            gyro: true,
            accel: true,
            reference: known.as_ref().map_or([false; 6], Known::columns),
            ..Columns::default()
        };
        Ok(Self {
            growing: Growing::create(&options.directory, columns, manifest)?,
            clock: Clock::default(),
            steps: options.steps.clone(),
            known,
            state: RecordingState::default(),
            begun_ns: None,
            heard: Instant::now(),
            asked: Instant::now(),
            unit_id: who.unit_id.clone(),
            starts: who.starts,
            // A program that was killed may have left half a frame.
            line: line::LineTotals::from(session.count()),
        })
    }

    pub fn receive(
        &mut self,
        session: &mut Session,
        options: &RecordOptions,
        look: &mut impl FnMut(&RecordingState) -> UserRequest,
    ) -> Result<()> {
        session.begin_stream(Stream::Raw.request())?;
        let wanted = self.steps.end().into_iter().chain(options.duration).min();
        loop {
            match self.hear(session, options.reconnect, wanted) {
                Ok(true) => return Ok(()),
                Ok(false) => {}
                Err(lost) if session.is_lost() => {
                    if !self.reconnect(session, options.reconnect, &lost, look)? {
                        return Ok(());
                    }
                }
                Err(error) => return Err(error),
            }
            self.state.line = self.line.total(session.count());
            if self.asks_to_end(look) || self.steps.is_done() {
                return Ok(());
            }
        }
    }

    /// Reports the state, and applies the person's requests. Returns whether the recording is to end.
    pub fn asks_to_end(&mut self, look: &mut impl FnMut(&RecordingState) -> UserRequest) -> bool {
        let request = look(&self.state);
        for _ in 0..request.marks {
            self.steps.mark();
        }
        request.end
    }

    fn drop_step(&mut self, step: Option<i32>) {
        let dropped = &mut self.state.dropped;
        dropped.extend(step.filter(|step| !dropped.contains(step)));
    }

    /// Discards a turn that was not recorded to its end: its angle is unknown.
    pub fn drop_open_turn(&mut self) {
        self.drop_step(self.steps.running().filter(|step| self.is_turn(*step)));
    }

    fn is_turn(&self, step: i32) -> bool {
        self.known.as_ref().is_some_and(|known| known.is_turn(step))
    }

    /// Processes the next event. Returns whether the recording is complete.
    fn hear(
        &mut self,
        session: &mut Session,
        patience: Duration,
        wanted: Option<Duration>,
    ) -> Result<bool> {
        match session.event()? {
            Some(Event::Raw(batch)) => {
                self.take(session.port(), &batch, wanted)?;
                return Ok(self.is_done(wanted));
            }
            Some(Event::Started(who)) => {
                if who.unit_id != self.unit_id {
                    let problem = format!("another device is at the port now ({})", who.unit_id);
                    return Err(Error::new(
                        session.port(),
                        problem,
                        "record each device separately",
                    ));
                }
                self.starts = who.starts;
                self.clock.restarted(Some(who.start.clone()));
                session.done(Stream::Raw.request(), "to stream")?;
            }
            Some(_) => {}
            None if self.heard.elapsed() > SILENCE && self.asked.elapsed() > SILENCE => {
                self.ask_again(session, patience)?;
            }
            None => {}
        }
        Ok(false)
    }

    /// Asks a silent device to greet and stream again: it may have restarted, and its greeting may be lost. The time without samples goes on, because
    /// after a restart only this computer's clock knows how long it was.
    ///
    /// Errors: it has not answered for `patience`. Until then it may be without power although its port is there, as behind an ST-LINK.
    fn ask_again(&mut self, session: &mut Session, patience: Duration) -> Result<()> {
        let greeted = session.hello().map(|who| (who.starts, who.start.clone()));
        self.asked = Instant::now();
        match greeted {
            Ok((starts, start)) => {
                if starts != self.starts {
                    self.starts = starts;
                    self.clock.restarted(Some(start));
                } else {
                    // After a power failure the starts are counted anew.
                    self.clock.reconnected(start);
                }
                session.done(Stream::Raw.request(), "to stream")?;
                self.state.resumed += 1;
                self.state.waiting = false;
                Ok(())
            }
            Err(_) if !session.is_lost() && self.heard.elapsed() < patience => {
                self.state.waiting = true;
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Waits until the unit is back; returns `false` if the person stops.
    fn reconnect(
        &mut self,
        session: &mut Session,
        patience: Duration,
        lost: &Error,
        look: &mut impl FnMut(&RecordingState) -> UserRequest,
    ) -> Result<bool> {
        self.state.waiting = true;
        let (port, unit_id) = (session.port().to_owned(), self.unit_id.clone());
        let go_on = || !self.asks_to_end(look);
        let Some(again) = line::wait_for(&port, &unit_id, patience, lost, go_on)? else {
            return Ok(false);
        };
        self.state.waiting = false;
        self.state.reconnected += 1;
        self.line.lost(session.count(), again.count());
        *session = again;
        let who = session.who();
        let start = who.start.clone();
        if who.starts != self.starts {
            self.clock.restarted(Some(start));
            self.starts = who.starts;
        } else {
            self.clock.reconnected(start);
        }
        session.begin_stream(Stream::Raw.request())?;
        Ok(true)
    }

    /// Writes the recording, with what `manifest` lacks until its end.
    pub fn finish(
        mut self,
        manifest: &mut Manifest,
        format: SampleFormat,
        finishing: impl Fn(f64),
    ) -> Result<RecordingState> {
        if let Some(recorded) = &mut manifest.recorded {
            recorded.missing = self.state.missing;
            recorded.restarts = self.state.restarts.clone();
        }
        manifest.dropped_steps = self.state.dropped.clone();
        if let Some(known) = &self.known {
            manifest.turn_steps = known.turns();
            self.state.warnings.extend(known.unused());
        }
        let rate_hz = self.clock.rate_hz().unwrap_or(manifest.sample_rate_hz);
        manifest.sample_rate_hz = rate_hz;
        let turning = self.known.as_mut().filter(|known| known.has_turns());
        let mut complete =
            turning.map(|known| move |batch: &mut Batch| known.complete(batch, rate_hz));
        let complete = complete.as_mut().map(|c| c as &mut dyn FnMut(&mut Batch));
        self.growing.finish(manifest, format, complete, finishing)?;
        Ok(self.state)
    }

    /// Time from the first sample, by the device.
    fn since_begun(&self, ns: u64) -> Duration {
        Duration::from_nanos(ns.saturating_sub(self.begun_ns.unwrap_or(ns)))
    }

    fn is_done(&self, wanted: Option<Duration>) -> bool {
        let passed = self.since_begun(self.clock.next_ns());
        wanted.is_some_and(|wanted| passed >= wanted)
    }

    fn take(&mut self, port: &str, samples: &Samples, wanted: Option<Duration>) -> Result<()> {
        let silence = self.heard.elapsed();
        self.heard = Instant::now();
        self.state.waiting = false;
        let head = &samples.head;
        let arrival = self.clock.arrive(head, silence);
        let first_ns = arrival.ns;
        self.begun_ns.get_or_insert(first_ns);
        if arrival.missing > 0 {
            self.state.missing += arrival.missing;
            self.state.gaps += 1;
        }
        if (arrival.missing > 0 || arrival.restart.is_some())
            && let Some(step) = self.steps.at(self.since_begun(first_ns))
        {
            // A turn with a gap has an unknown angle.
            self.drop_step(Some(step).filter(|step| self.is_turn(*step)));
        }
        if let Some(start) = arrival.restart {
            self.state.restarts.push(Restart {
                t_s: seconds(first_ns),
                start: start.map_or("its greeting was lost".into(), |s: Started| s.to_string()),
            });
        }
        let period_ns = u64::from(head.period_ns);
        let times_ns = (0..).map(|k| first_ns + k * period_ns);
        let within = |ns: &u64| wanted.is_none_or(|wanted| self.since_begun(*ns) < wanted);
        let count = times_ns
            .clone()
            .take(samples.values.len())
            .take_while(within)
            .count();
        let mut batch = Batch {
            first_row: self.growing.rows(),
            ..Batch::default()
        };
        for (ns, row) in times_ns.zip(&samples.rows(port)?[..count]) {
            batch.t_s.push(seconds(ns));
            if let Some(step) = self.steps.at(self.since_begun(ns)) {
                batch.step.push(step);
                if let Some(known) = &mut self.known {
                    let input = known.next(step);
                    for ((column, value), there) in
                        batch.reference.iter_mut().zip(input).zip(known.columns())
                    {
                        column.extend(there.then_some(value));
                    }
                }
                self.state.step = (step >= 0).then_some(step);
                self.state.dwells = self.state.dwells.max((step + 1) as u32);
            }
            batch.temp_c.push(shortest(samples.head.temp_c));
            for (column, value) in batch.raw.iter_mut().zip(row) {
                column.push(*value);
            }
        }
        self.clock.passed(head, first_ns, samples.values.len());
        if count == 0 {
            return Ok(());
        }
        self.growing.write(&batch)?;
        let state = &mut self.state;
        state.samples += count as u64;
        state.temp_c = shortest(samples.head.temp_c);
        state.flagged.count(samples.head.flags, count as u64);
        state.first_s.get_or_insert(seconds(first_ns));
        state.last_s = batch.t_s.last().copied();
        Ok(())
    }
}
