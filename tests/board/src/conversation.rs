//! The host's end of the serial line, for tests: calls and received messages, in virtual time.

use mimu_board::running::Board;
use mimu_core::wire::{
    BatchHead, CHUNK, Call, Counts, Decoder, Event, MAX_FRAME, Message, Refusal, Reply, Request,
    Verdict, encode,
};

use crate::MS;

/// Longest virtual time for an answer, ms: erasing a sector takes 1 to 2 s.
const PATIENCE_MS: u64 = 10_000;

/// Result of a call.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// Done, with an empty reply.
    Done,
    /// Not done.
    Refused(Refusal),
    /// Part of the stored calibration: length of the whole, and the part.
    Stored(u32, Vec<u8>),
    /// A greeting: hash of the calibration in use, and the start as text.
    Greeting {
        /// `None`: there is no calibration.
        hash: Option<u64>,
        /// Why the device started.
        start: String,
    },
    /// Result of the self-test.
    SelfTest(Vec<Tested>),
    /// Any other reply, as text.
    Other(String),
}

/// A row of the self-test.
#[derive(Debug, Clone, PartialEq)]
pub struct Tested {
    /// What was tested.
    pub name: String,
    /// What was measured.
    pub value: f32,
    /// Whether it passes.
    pub verdict: Verdict,
}

/// A received sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Number since sampling began.
    pub number: u32,
    /// Time by the crystal since sampling began, s.
    pub t_s: f64,
    /// Its integers.
    pub counts: Counts,
    /// True time between samples according to its batch, ns.
    pub period_ns: u32,
    /// Flags of its batch.
    pub flags: u16,
}

/// A board and the host at its line.
pub struct Conversation {
    /// The board.
    pub board: Board,
    decoder: Decoder,
    next_id: u16,
    answers: Vec<(u16, Answer)>,
    /// Samples of the raw stream since they were last taken.
    pub samples: Vec<Sample>,
    /// Samples and batches that the device has lost, according to the last batch.
    pub lost: (u32, u32),
    /// Head of the last raw batch, and the temperatures of its first three thermometers, °C.
    pub last: Option<(BatchHead, [f32; 3])>,
}

impl Conversation {
    /// With a board that runs already or will run.
    pub fn new(board: Board) -> Self {
        Self {
            board,
            decoder: Decoder::new(),
            next_id: 0,
            answers: Vec::new(),
            samples: Vec::new(),
            lost: (0, 0),
            last: None,
        }
    }

    /// Number of garbled frames.
    pub fn garbled(&self) -> u32 {
        self.decoder.garbled()
    }

    /// Runs for a virtual duration, ns, and processes what arrives.
    pub fn run_for(&mut self, ns: u64) {
        self.board.run_for(ns).unwrap();
        self.listen();
    }

    /// Processes what has arrived.
    pub fn listen(&mut self) {
        for (_, byte) in self.board.receive() {
            let Some(frame) = self.decoder.push(byte) else {
                continue;
            };
            let message = frame.message().expect("a whole frame holds a message");
            match message {
                Message::Greeting { id, greeting } => {
                    let hash = greeting.stored.map(|stored| stored.hash);
                    let start = format!("{:?}", greeting.start);
                    self.answers.push((id, Answer::Greeting { hash, start }));
                }
                Message::Reply { id, reply } => {
                    let answer = match reply {
                        Reply::Done => Answer::Done,
                        Reply::Stored { length, bytes, .. } => {
                            Answer::Stored(length, bytes.to_vec())
                        }
                        Reply::SelfTest(test) => {
                            assert!(test.is_whole());
                            let rows = test.rows().map(|row| Tested {
                                name: row.name.to_owned(),
                                value: row.value,
                                verdict: row.verdict,
                            });
                            Answer::SelfTest(rows.collect())
                        }
                        other => Answer::Other(format!("{other:?}")),
                    };
                    self.answers.push((id, answer));
                }
                Message::Refused { id, refusal } => {
                    self.answers.push((id, Answer::Refused(refusal)));
                }
                Message::Event(Event::Raw(batch)) => {
                    assert!(batch.is_whole(), "{batch:?}");
                    self.lost = (batch.head.samples_lost, batch.head.batches_dropped);
                    let mut temps_c = [f32::NAN; 3];
                    for (to, temp_c) in temps_c.iter_mut().zip(batch.temperatures_c()) {
                        *to = temp_c;
                    }
                    self.last = Some((batch.head, temps_c));
                    let of = batch.counts().zip(batch.head.times_ns());
                    self.samples
                        .extend(of.map(|((number, counts), t_ns)| Sample {
                            number,
                            t_s: t_ns as f64 * 1e-9,
                            counts,
                            period_ns: batch.head.period_ns,
                            flags: batch.head.flags,
                        }));
                }
                Message::Event(_) => {}
            }
        }
    }

    /// Sends a request without waiting. Returns its id.
    pub fn send(&mut self, request: Request<'_>) -> u16 {
        self.next_id += 1;
        let id = self.next_id;
        let mut frame = [0; MAX_FRAME];
        let length = encode(&Call { id, request }, &mut frame).unwrap();
        self.board.send(&frame[..length]);
        id
    }

    /// The answer to an id, if it has come.
    pub fn answer(&mut self, id: u16) -> Option<Answer> {
        let at = self.answers.iter().position(|(of, _)| *of == id)?;
        Some(self.answers.remove(at).1)
    }

    /// Sends a request and waits for the answer.
    ///
    /// # Panics
    ///
    /// If no answer comes.
    pub fn ask(&mut self, request: Request<'_>) -> Answer {
        let id = self.send(request);
        for _ in 0..PATIENCE_MS {
            self.run_for(MS);
            if let Some(answer) = self.answer(id) {
                return answer;
            }
        }
        panic!("no answer to {request:?} in {PATIENCE_MS} ms of virtual time");
    }

    /// Waits for the greeting that the device sends by itself after its start.
    ///
    /// # Panics
    ///
    /// If none comes.
    pub fn greeting(&mut self) -> Answer {
        for _ in 0..PATIENCE_MS {
            self.run_for(MS);
            if let Some(answer) = self.answer(0) {
                return answer;
            }
        }
        panic!("no greeting in {PATIENCE_MS} ms of virtual time");
    }

    /// Sends a calibration without the commit.
    pub fn upload(&mut self, bytes: &[u8]) {
        let begin = Request::UploadBegin {
            length: bytes.len() as u32,
            hash: mimu_core::stored::hash(bytes),
            other_unit: false,
        };
        assert_eq!(self.ask(begin), Answer::Done);
        for (k, part) in bytes.chunks(CHUNK).enumerate() {
            let chunk = Request::UploadChunk {
                offset: (k * CHUNK) as u32,
                bytes: part,
            };
            assert_eq!(self.ask(chunk), Answer::Done);
        }
    }

    /// The calibration in use, byte by byte; `None` if there is none.
    pub fn download(&mut self) -> Option<Vec<u8>> {
        let mut all = Vec::new();
        loop {
            let request = Request::Download {
                offset: all.len() as u32,
                length: CHUNK as u16,
            };
            match self.ask(request) {
                Answer::Stored(length, part) => {
                    all.extend(part);
                    if all.len() as u32 >= length {
                        return Some(all);
                    }
                }
                Answer::Refused(Refusal::NoCalibration) => return None,
                other => panic!("{other:?}"),
            }
        }
    }
}
