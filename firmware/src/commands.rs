//! Requests of the host, and the answers.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::uid::uid;
use embassy_time::Instant;
use mimu_core::Sensor;
use mimu_core::stored::{self, MAX_LENGTH, NODES, ROOM, Stored};
use mimu_core::wire::{
    CHUNK, Call, Capabilities, Counters, Decoder, Greeting, MAGIC, Message, PROTOCOL, Prior,
    Refusal, Reply, Request, StoredInfo, TestTable, Triad, effects_of_this_build, flags,
};

use crate::bank::Bank;
use crate::board;
use crate::flash::{self, Flash};
use crate::front_end::FrontEnd;
use crate::link::{FrameSender, Input, send};
use crate::liveness::Progress;
use crate::pipeline::{Pipeline, Shared, Streams};
use crate::protection::{banks_swapped, brown_out_level, may_store};
use crate::restart::Before;
use crate::sampling::Tally;
use crate::slots::Slots;
use crate::source::{Source, usable};
use crate::upload::Upload;

/// Requests whose answer was begun, and answers that are ready to be sent.
pub static ANSWERED: Progress = Progress::new();

/// Everything that a request may need.
pub struct Commands<'a> {
    /// The path of the samples.
    pub pipeline: &'a Shared<board::Source>,
    /// Counters of sampling.
    pub tally: &'a Tally,
    /// Stored calibrations.
    pub slots: Slots<Flash>,
    /// Front end to be stored with the next calibration.
    pub front_end: FrontEnd,
    /// Upload in progress.
    pub upload: Upload<'a>,
    /// Summary of the calibration in use.
    pub stored: Option<StoredInfo>,
    /// What the self-test needs.
    pub self_test: board::SelfTest,
    /// Why the device started.
    pub before: &'a Before,
    /// Time since power-on at the start of sampling, ms, if it is known.
    pub powered_for_ms: Option<u32>,
    /// Where answers go.
    pub replies: FrameSender,
}

/// Summary of a calibration for the greeting.
pub fn info(length: u32, hash: u64, stored: &Stored) -> StoredInfo {
    StoredInfo {
        length,
        hash,
        nodes: stored.compensator.table.len() as u8,
        effects: stored.effect_count,
        unit_id: stored.origin.unit_id.unwrap_or_default(),
        created_s: stored.origin.created_s.unwrap_or_default(),
    }
}

/// Number of refused calls, and number of times that bytes were lost before the decoder.
#[derive(Default)]
struct Received {
    refused: u32,
    overruns: u32,
    garbled: u32,
}

impl Commands<'_> {
    /// Sends the greeting, then answers requests forever.
    pub async fn serve(mut self, mut input: Input) -> ! {
        self.greet(0).await;
        let mut decoder = Decoder::new();
        let mut received = Received::default();
        let mut bytes = [0; 64];
        loop {
            let Some(count) = input.receive(&mut bytes).await else {
                received.overruns = received.overruns.wrapping_add(1);
                continue;
            };
            for byte in &bytes[..count] {
                received.garbled = decoder.garbled();
                let Some(frame) = decoder.push(*byte) else {
                    continue;
                };
                let reset = match frame.call() {
                    Some(call) => {
                        self.answer(&call, &mut received).await;
                        call.request == Request::ResetCounters
                    }
                    None => {
                        let id = frame.id().unwrap_or_default();
                        received.refused = received.refused.wrapping_add(1);
                        self.refuse(id, Refusal::Unknown).await;
                        false
                    }
                };
                if reset {
                    decoder.reset_garbled();
                }
            }
        }
    }

    async fn refuse(&mut self, id: u16, refusal: Refusal) {
        send(&mut self.replies, &Message::Refused { id, refusal }).await;
    }

    async fn answer(&mut self, call: &Call<'_>, received: &mut Received) {
        let id = call.id;
        let (mut part, mut table) = ([0; CHUNK], TestTable::new());
        // Not the answer's transmission: a host that reads nothing at a USB port is no fault of the device.
        ANSWERED.begin();
        let outcome = match call.request {
            Request::Hello => {
                ANSWERED.complete();
                return self.greet(id).await;
            }
            Request::Download { offset, length } => self.download(offset, length, &mut part).await,
            Request::UploadCommit => self.commit().await.map(|()| Reply::Done),
            Request::SelfTest => {
                let run = self.self_test.run(self.pipeline, &mut table).await;
                run.map(|()| Reply::SelfTest(table.result()))
            }
            Request::Counters => Ok(Reply::Counters(self.counters(received))),
            Request::ResetCounters => {
                self.reset_counters(received);
                Ok(Reply::Done)
            }
            request => self.at_once(request),
        };
        ANSWERED.complete();
        match outcome {
            Ok(reply) => send(&mut self.replies, &Message::Reply { id, reply }).await,
            Err(refusal) => {
                received.refused = received.refused.wrapping_add(1);
                self.refuse(id, refusal).await;
            }
        }
    }

    /// Requests that need no waiting.
    fn at_once(&mut self, request: Request<'_>) -> Result<Reply<'static>, Refusal> {
        let pipeline = self.pipeline;
        match request {
            Request::Stream { raw, compensated } => pipeline.lock(|p| {
                let mut p = p.borrow_mut();
                if compensated && !p.is_calibrated() {
                    return Err(Refusal::NoCalibration);
                }
                p.stream(Streams { raw, compensated });
                Ok(())
            })?,
            Request::Stop => pipeline.lock(|p| p.borrow_mut().stream(Streams::default())),
            Request::UploadBegin {
                length,
                hash,
                other_unit,
            } => self.upload.begin(length, hash, other_unit)?,
            Request::UploadChunk { offset, bytes } => self.upload.chunk(offset, bytes)?,
            Request::KalmanStart {
                sensor,
                noise,
                prior,
            } => self.start_bank(sensor, noise, prior)?,
            Request::KalmanInput { sensor, input } => {
                if !self.with_bank(sensor, |bank| bank.set_input(input))? {
                    return Err(Refusal::BadNumber);
                }
            }
            Request::KalmanKeep { sensor } => self.with_bank(sensor, Bank::keep)?,
            Request::KalmanBack { sensor } => self.with_bank(sensor, Bank::back)?,
            Request::KalmanEnd { sensor } => {
                let bank = pipeline.lock(|p| p.borrow_mut().banks[sensor].take());
                let bank = bank.ok_or(Refusal::NoBank)?;
                return Ok(Reply::Kalman(bank.state()));
            }
            // The caller handles the others.
            _ => return Err(Refusal::Unknown),
        }
        Ok(Reply::Done)
    }

    fn start_bank(&mut self, sensor: Sensor, noise: [f32; 3], prior: Prior) -> Result<(), Refusal> {
        let bank = Bank::new(sensor, noise, prior).ok_or(Refusal::BadNumber)?;
        self.pipeline
            .lock(|p| p.borrow_mut().banks[sensor] = Some(bank));
        Ok(())
    }

    fn with_bank<T>(
        &self,
        sensor: Sensor,
        errand: impl FnOnce(&mut Bank) -> T,
    ) -> Result<T, Refusal> {
        self.pipeline.lock(|p| {
            let bank = &mut p.borrow_mut().banks[sensor];
            bank.as_mut().map(errand).ok_or(Refusal::NoBank)
        })
    }

    async fn commit(&mut self) -> Result<(), Refusal> {
        self.upload.check(&uid())?;
        may_store()?;
        let bytes = self.upload.bytes();
        let kept = &mut self.front_end;
        (self.pipeline).lock(|p| p.borrow().source().keep(kept));
        let storing = |on| {
            let set = |p: &RefCell<Pipeline<_>>| p.borrow_mut().flag(flags::STORING, on);
            self.pipeline.lock(set);
        };
        storing(true);
        let kept = self.slots.store(bytes, &self.front_end).await;
        storing(false);
        // A supply that has begun to fail since then is the reason.
        kept.map_err(|_| may_store().err().unwrap_or(Refusal::FlashFailed))?;
        let unusable = self.slots.younger_unusable();
        self.pipeline.lock(|p| {
            let mut p = p.borrow_mut();
            p.flag(flags::YOUNGER_UNUSABLE, unusable);
            // The converter's present factors were stored with it.
            p.flag(flags::OWN_FACTORS, false);
        });
        self.use_stored()?;
        self.upload.end();
        Ok(())
    }

    /// A separate function, because the future of `commit` would otherwise keep room for the decoded calibration.
    #[inline(never)]
    fn use_stored(&mut self) -> Result<(), Refusal> {
        let bytes = self.upload.bytes();
        let stored = usable(bytes).map_err(Refusal::NotUsable)?;
        self.stored = Some(info(bytes.len() as u32, stored::hash(bytes), &stored));
        self.pipeline.lock(|p| p.borrow_mut().calibrate(stored));
        Ok(())
    }

    async fn download<'b>(
        &mut self,
        offset: u32,
        wanted: u16,
        part: &'b mut [u8; CHUNK],
    ) -> Result<Reply<'b>, Refusal> {
        let (length, _) = self.slots.in_use().ok_or(Refusal::NoCalibration)?;
        if offset > length {
            return Err(Refusal::WrongOffset { expected: length });
        }
        let count = (length - offset).min(u32::from(wanted)).min(CHUNK as u32);
        let part = &mut part[..count as usize];
        let read = self.slots.part(offset as usize, part).await;
        read.ok_or(Refusal::FlashFailed)?;
        Ok(Reply::Stored {
            offset,
            length,
            bytes: part,
        })
    }

    async fn greet(&mut self, id: u16) {
        let usb = match cfg!(feature = "usb") {
            true => Capabilities::USB,
            false => Capabilities(0),
        };
        let measured_hz = self.pipeline.lock(|p| p.borrow().rate_hz());
        let triads = board::Source::TRIADS.map(|triad| Triad {
            rate_hz: measured_hz.unwrap_or(triad.rate_hz),
            ..triad
        });
        let greeting = Greeting {
            magic: MAGIC,
            protocol: PROTOCOL,
            firmware: env!("MIMU_FIRMWARE_VERSION"),
            board: board::NAME,
            unit_id: uid(),
            capabilities: Capabilities::TEMPERATURE_NODES
                .and(Capabilities::TERMS)
                .and(Capabilities::KALMAN)
                .and(board::CAPABILITIES)
                .and(usb),
            effects: effects_of_this_build(),
            effects_room: ROOM as u8,
            nodes_room: NODES as u8,
            stored_room: MAX_LENGTH as u32,
            triads,
            thermometers: board::Source::PLACES,
            start: self.before.start(),
            starts: self.before.starts(),
            stored: self.stored,
            slots: self.slots.state(),
            powered_for_ms: self.powered_for_ms,
            brown_out_level: Some(brown_out_level()),
            banks_swapped: banks_swapped(),
            wrong_register: self.tally.wrong_register(),
            nominal_hz: board::Source::TRIADS.gyro.rate_hz,
            rate_measured: measured_hz.is_some(),
        };
        send(&mut self.replies, &Message::Greeting { id, greeting }).await;
    }

    fn counters(&self, received: &Received) -> Counters {
        let of = |counter: &AtomicU32| counter.load(Ordering::Relaxed);
        let losses = self.pipeline.lock(|p| p.borrow().losses());
        Counters {
            uptime_ms: Instant::now().as_millis() as u32,
            samples: of(&self.tally.samples),
            last: of(&self.tally.last),
            late: of(&self.tally.late),
            converter_overruns: of(&self.tally.converter_overruns),
            stalls: of(&self.tally.stalls),
            queue_overruns: of(&self.tally.queue_overruns),
            batches_dropped: losses.batches,
            frames_garbled: received.garbled,
            receiver_overruns: received.overruns,
            refused: received.refused,
            flash_corrected: of(&flash::CORRECTED),
            flash_uncorrectable: of(&flash::UNCORRECTABLE),
            longest_us: of(&self.tally.longest_us),
        }
    }

    fn reset_counters(&mut self, received: &mut Received) {
        for counter in [
            &self.tally.samples,
            &self.tally.late,
            &self.tally.converter_overruns,
            &self.tally.stalls,
            &self.tally.queue_overruns,
            &self.tally.longest_us,
            &flash::CORRECTED,
            &flash::UNCORRECTABLE,
        ] {
            counter.store(0, Ordering::Relaxed);
        }
        self.pipeline.lock(|p| p.borrow_mut().reset_losses());
        *received = Received::default();
    }
}
