//! Calls and their answers.

use std::time::Instant;

use mimu_core::stored::{self, MAX_LENGTH, ROOM};
use mimu_core::wire::{
    Call, Capabilities, Counters, Greeting, Message, Refusal, Reply, Request, Slot, StoredInfo,
    TestRow, TestTable, Verdict,
};

use super::{Device, UNIT_ID};

impl Device {
    pub(super) fn greeting(&mut self, id: u16) {
        let held = self.seen.lock().unwrap().stored.clone();
        let stored = held.as_ref().map(|bytes| {
            // A calibration in another layout may have been stored by another version of the firmware.
            let decoded = stored::decode(bytes).ok();
            let of = |number: fn(&stored::Stored) -> u8| decoded.as_ref().map_or(1, number);
            let origin = decoded.as_ref().map(|d| &d.origin);
            StoredInfo {
                length: bytes.len() as u32,
                hash: stored::hash(bytes),
                nodes: of(|d| d.compensator.table.len() as u8),
                effects: of(|d| d.effect_count),
                unit_id: origin.and_then(|o| o.unit_id).unwrap_or_default(),
                created_s: origin.and_then(|o| o.created_s).unwrap_or_default(),
            }
        });
        let first = match stored {
            Some(_) => Slot::Whole { generation: 1 },
            None => Slot::Empty,
        };
        let greeting = Greeting {
            magic: self.script.magic,
            protocol: self.script.protocol,
            firmware: "9.8.7",
            board: "a script",
            unit_id: UNIT_ID,
            capabilities: Capabilities::TEMPERATURE_NODES
                .and(Capabilities::TERMS)
                .and(Capabilities::KALMAN)
                .and(Capabilities::SELF_TEST),
            effects: self.script.effects,
            effects_room: ROOM as u8,
            nodes_room: 16,
            stored_room: MAX_LENGTH as u32,
            triads: self.script.triads,
            thermometers: "gyro_x,gyro_y,gyro_z",
            start: self.script.start,
            starts: 3,
            stored,
            slots: [first, Slot::Empty],
            powered_for_ms: self.script.powered_for_ms,
            brown_out_level: Some(3),
            banks_swapped: false,
            wrong_register: self.script.wrong_register,
            nominal_hz: self.script.triads.gyro.rate_hz,
            rate_measured: true,
        };
        let message = Message::Greeting { id, greeting };
        match id {
            0 => self.frame(&message, false),
            _ => self.send(&message),
        }
    }

    pub(super) fn restart(&mut self) {
        self.begin_anew();
        self.greeting(0);
    }

    pub(super) fn begin_anew(&mut self) {
        (self.began, self.next) = (Instant::now(), 0);
        (self.streams, self.upload) = ((false, false), None);
        self.calibrated = None;
    }

    pub(super) fn answer(&mut self, call: &Call<'_>) {
        let name = format!("{:?}", call.request);
        let end = name.find([' ', '{']).unwrap_or(name.len());
        self.seen
            .lock()
            .unwrap()
            .requests
            .push(name[..end].to_string());
        let id = call.id;
        if call.request == Request::Hello {
            return self.greeting(id);
        }
        if let Request::UploadChunk { offset, .. } = call.request
            && self.script.restart_at_chunk == Some(offset)
        {
            self.script.restart_at_chunk = None;
            return self.restart();
        }
        let held = self.seen.lock().unwrap().stored.clone();
        let table = self.self_test();
        let reply = match call.request {
            Request::SelfTest => Ok(Reply::SelfTest(table.result())),
            Request::Download { offset, length } => match &held {
                None => Err(Refusal::NoCalibration),
                Some(bytes) => {
                    let from = (offset as usize).min(bytes.len());
                    let to = (from + usize::from(length)).min(bytes.len());
                    Ok(Reply::Stored {
                        offset,
                        length: bytes.len() as u32,
                        bytes: &bytes[from..to],
                    })
                }
            },
            request => self.does(request, held.as_deref()),
        };
        match reply {
            Ok(reply) => self.send(&Message::Reply { id, reply }),
            Err(refusal) => self.send(&Message::Refused { id, refusal }),
        }
    }

    /// Some rows of an analog board's self-test.
    fn self_test(&self) -> TestTable {
        let mut table = TestTable::new();
        for (name, value, unit, limits) in [
            ("gyro z, ST1", -0.27, "V", [-0.45, -0.15]),
            ("gyro z, ST2", 0.27, "V", [0.15, 0.45]),
            ("accel x, null", 1.65, "V", [1.43, 1.87]),
            ("accel z, null", 1.65, "V", [1.43, 1.87]),
            ("temperature y", 26.0, "\u{b0}C", [-55.0, 100.0]),
            ("supply", 3.3, "V", [3.135, 3.465]),
        ] {
            let row = TestRow::within(name, value, unit, limits);
            let verdict = match name {
                _ if self.script.self_test_fails.contains(&name) => Verdict::Failed,
                "accel x, null" => Verdict::NotShown,
                _ => row.verdict,
            };
            assert!(table.push(&TestRow { verdict, ..row }));
        }
        table
    }

    pub(super) fn does(
        &mut self,
        request: Request<'_>,
        held: Option<&[u8]>,
    ) -> Result<Reply<'static>, Refusal> {
        match request {
            Request::Stream { raw, compensated } => {
                if compensated && held.is_none() {
                    return Err(Refusal::NoCalibration);
                }
                self.streams = (raw, compensated);
                self.streamed_from.get_or_insert(self.next);
            }
            Request::Stop => self.streams = (false, false),
            Request::Counters => {
                return Ok(Reply::Counters(Counters {
                    samples: self.next,
                    late: 17,
                    ..Counters::default()
                }));
            }
            Request::UploadBegin {
                length,
                hash,
                other_unit,
            } => {
                self.insists = other_unit;
                self.upload = Some((length as usize, hash, Vec::new()));
            }
            Request::UploadChunk { offset, bytes } => {
                let Some((_, _, received)) = &mut self.upload else {
                    return Err(Refusal::NoUpload);
                };
                if offset as usize > received.len() {
                    let expected = received.len() as u32;
                    return Err(Refusal::WrongOffset { expected });
                }
                received.truncate(offset as usize);
                received.extend_from_slice(bytes);
            }
            Request::UploadCommit => {
                let Some((length, hash, received)) = self.upload.clone() else {
                    return Err(Refusal::NoUpload);
                };
                if let Some(refusal) = self.script.refuse_commit {
                    return Err(refusal);
                }
                if received.len() < length {
                    let received = received.len() as u32;
                    return Err(Refusal::Incomplete { received });
                }
                let found = stored::hash(&received);
                if found != hash {
                    return Err(Refusal::WrongHash { found });
                }
                let stored = stored::decode(&received).map_err(Refusal::NotUsable)?;
                let sensors = stored.origin.check_sensors(&self.script.triads);
                sensors.map_err(Refusal::NotUsable)?;
                let other = stored.origin.unit_id.filter(|id| *id != UNIT_ID);
                if let (Some(unit_id), false) = (other, self.insists) {
                    return Err(Refusal::OtherUnit { unit_id });
                }
                self.upload = None;
                self.calibrated = None;
                self.seen.lock().unwrap().stored = Some(received);
            }
            Request::ResetCounters => {}
            _ => return Err(Refusal::Unknown),
        }
        Ok(Reply::Done)
    }
}
