//! A scripted device at the other end of a pseudo-terminal. It speaks the protocol documented in `core::wire`, and misbehaves on request.
//!
//! It shares no code with the host. Its readings follow a formula ([`sums`]), so a test can tell what must arrive.

mod answers;
mod samples;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mimu_core::PerSensor;
use mimu_core::wire::WrongRegister;
use mimu_core::wire::{
    Decoder, MAGIC, MAX_FRAME, Message, PROTOCOL, Refusal, Reply, Start, Triad, Version,
    effects_of_this_build, encode,
};

use super::terminal::Terminal;
use samples::Calibrated;

pub const GYRO_VOLTS: f32 = 4.2e-5;
pub const ACCEL_VOLTS: f32 = 2.518e-5;
/// The sensors of an analog board.
pub const GYRO: Triad<'static> = Triad {
    part: "ADXRS300",
    unit: "V",
    bits: 18,
    range: 5.235_988,
    null: 2.5,
    per_si: 0.286_478_9,
    rate_hz: 1000.0,
    filter: "40 Hz",
};
pub const ACCEL: Triad<'static> = Triad {
    part: "MMA7260QT",
    unit: "V",
    bits: 18,
    range: 14.709_975,
    null: 1.65,
    per_si: 0.081_577_3,
    rate_hz: 1000.0,
    filter: "1.6 kHz",
};

pub const TEMP_C: f32 = 31.25;
pub const UNIT_ID: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0xab];

/// Integers of sample n, sums of codes: about 2.5 and 1.65 V, with pseudo-noise.
pub fn sums(n: u32) -> [i32; 6] {
    std::array::from_fn(|i| {
        let mixed = (n ^ 0x9e37_79b9_u32.wrapping_mul(i as u32 + 1)).wrapping_mul(0x85eb_ca6b);
        let noise = ((mixed >> 13) % 64) as i32;
        [59_000, 60_000, 61_000, 65_000, 66_000, 70_000][i] + noise
    })
}

/// An event that happens once, when a sample is due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Act {
    /// Its batch is not sent.
    Drop,
    /// A byte in the frame of its batch is changed.
    Garble,
    /// The device restarts: it counts from 0 again and keeps only its calibration.
    Restart,
    /// Nothing is sampled any more.
    Hold,
    /// The port disappears.
    Vanish,
    /// The cable is pulled, and plugged in again after `away_ms`: a different port of the same name. The device continues meanwhile.
    Unplug { away_ms: u64 },
}

/// Behaviour at the port.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Behaviour {
    /// A device.
    Device,
    /// Nothing.
    Silence,
    /// Bytes of something else.
    Garbage,
    /// Intact frames that are not greetings.
    Stranger,
}

#[derive(Debug, Clone)]
pub struct Script {
    pub behaviour: Behaviour,
    pub protocol: Version,
    pub magic: [u8; 4],
    pub effects: u32,
    /// Its sensors.
    pub triads: PerSensor<Triad<'static>>,
    /// Raw units per unit of its integers.
    pub scale: PerSensor<f32>,
    /// Time between samples by its crystal, ns.
    pub period_ns: u32,
    pub stored: Option<Vec<u8>>,
    /// One answer in so many is lost, and one is garbled; 0 for none.
    pub losing: u32,
    pub refuse_commit: Option<Refusal>,
    /// It restarts instead of accepting the chunk at this offset, once.
    pub restart_at_chunk: Option<u32>,
    /// By sample number since the stream began, in order, so that the start-up time of a program does not matter.
    pub acts: Vec<(u32, Act)>,
    /// Samples per millisecond.
    pub speed: f64,
    /// Added to the compensated gyro x, rad/s: a computing error of the device.
    pub bent: f32,
    /// Names of the rows of its self-test that fail.
    pub self_test_fails: &'static [&'static str],
    /// Cause of its start.
    pub start: Start<'static>,
    /// Name of the port, if it is not the terminal's: a constant name while terminals change.
    pub link: Option<PathBuf>,
    /// Time since power-on at its first sample.
    pub powered_for_ms: Option<u32>,
    /// Register of its sensor that is wrong.
    pub wrong_register: Option<WrongRegister>,
    /// Flags of all its batches.
    pub flags: u16,
    /// The next batch is not sent; then it is no more set.
    pub lose: Arc<AtomicBool>,
}

impl Default for Script {
    fn default() -> Self {
        Self {
            behaviour: Behaviour::Device,
            protocol: PROTOCOL,
            magic: MAGIC,
            effects: effects_of_this_build(),
            triads: PerSensor {
                gyro: GYRO,
                accel: ACCEL,
            },
            scale: PerSensor {
                gyro: GYRO_VOLTS,
                accel: ACCEL_VOLTS,
            },
            period_ns: 1_000_000,
            stored: None,
            losing: 0,
            refuse_commit: None,
            restart_at_chunk: None,
            acts: Vec::new(),
            speed: 1.0,
            bent: 0.0,
            self_test_fails: &[],
            powered_for_ms: Some(0),
            wrong_register: None,
            flags: 0,
            lose: Arc::default(),
            start: Start::Panic {
                file: "src/x.rs",
                line: 7,
            },
            link: None,
        }
    }
}

/// Record of the peer for the tests.
#[derive(Debug, Default)]
pub struct Seen {
    /// Names of the requests.
    pub requests: Vec<String>,
    /// The stored calibration.
    pub stored: Option<Vec<u8>>,
    /// Number of the next sample.
    pub next: u32,
}

pub struct Peer {
    pub path: String,
    pub seen: Arc<Mutex<Seen>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Peer {
    pub fn new(script: Script) -> Self {
        let (port, path) = open(script.link.as_deref());
        let seen = Arc::new(Mutex::new(Seen {
            stored: script.stored.clone(),
            ..Seen::default()
        }));
        let stop = Arc::new(AtomicBool::new(false));
        let device = Device {
            port: Some(port),
            back: None,
            seen: seen.clone(),
            stop: stop.clone(),
            script,
            began: Instant::now(),
            next: 0,
            streams: (false, false),
            streamed_from: None,
            upload: None,
            insists: false,
            answers: 0,
            lost: 0,
            dropped: 0,
            calibrated: None,
        };
        let thread = std::thread::spawn(move || device.run());
        Self {
            path,
            seen,
            stop,
            thread: Some(thread),
        }
    }

    pub fn count(&self, request: &str) -> usize {
        let seen = self.seen.lock().unwrap();
        seen.requests.iter().filter(|r| *r == request).count()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

/// A terminal, and the name to open it by.
fn open(link: Option<&Path>) -> (Terminal, String) {
    let (port, path) = Terminal::open();
    let Some(link) = link else {
        return (port, path);
    };
    let _ = std::fs::remove_file(link);
    std::os::unix::fs::symlink(path, link).unwrap();
    (port, link.display().to_string())
}

struct Device {
    port: Option<Terminal>,
    /// When the port returns.
    back: Option<Instant>,
    seen: Arc<Mutex<Seen>>,
    stop: Arc<AtomicBool>,
    script: Script,
    began: Instant,
    next: u32,
    /// Raw and compensated streams.
    streams: (bool, bool),
    /// First sample of the stream.
    streamed_from: Option<u32>,
    upload: Option<(usize, u64, Vec<u8>)>,
    /// A calibration of another unit is accepted.
    insists: bool,
    answers: u32,
    lost: u32,
    dropped: u32,
    calibrated: Option<Calibrated>,
}

impl Device {
    fn run(mut self) {
        let mut decoder = Decoder::new();
        let mut bytes = [0; 4096];
        while !self.stop.load(Ordering::Relaxed) {
            if self.back.take_if(|back| *back <= Instant::now()).is_some() {
                self.port = Some(open(self.script.link.as_deref()).0);
            }
            let count = match &mut self.port {
                Some(port) => port.read(&mut bytes),
                None => {
                    std::thread::sleep(Duration::from_millis(2));
                    0
                }
            };
            match self.script.behaviour {
                Behaviour::Device => {
                    for byte in &bytes[..count] {
                        let Some(frame) = decoder.push(*byte) else {
                            continue;
                        };
                        match frame.call() {
                            Some(call) => self.answer(&call),
                            None => {
                                let id = frame.id().unwrap_or_default();
                                let refusal = Refusal::Unknown;
                                self.send(&Message::Refused { id, refusal });
                            }
                        }
                    }
                    self.sample();
                }
                Behaviour::Silence => {}
                Behaviour::Garbage if count > 0 => self.write(b"login: \r\nPassword: \xff\x80\r\n"),
                Behaviour::Stranger if count > 0 => {
                    let reply = Reply::Done;
                    self.send(&Message::Reply { id: 0, reply });
                }
                _ => {}
            }
            self.seen.lock().unwrap().next = self.next;
        }
    }

    fn write(&mut self, mut bytes: &[u8]) {
        while let Some(port) = &mut self.port
            && !bytes.is_empty()
            && !self.stop.load(Ordering::Relaxed)
        {
            let count = port.write(bytes);
            bytes = &bytes[count..];
        }
    }

    fn frame(&mut self, message: &Message<'_>, garble: bool) {
        let mut frame = [0; MAX_FRAME];
        let length = encode(message, &mut frame).unwrap();
        if garble {
            // Never a zero, which would only cut the frame in two.
            let byte = &mut frame[length / 2];
            *byte = if *byte == 0x55 { 0xaa } else { 0x55 };
        }
        self.write(&frame[..length]);
    }

    fn send(&mut self, message: &Message<'_>) {
        self.answers += 1;
        let losing = self.script.losing;
        let turn = if losing > 0 { self.answers % losing } else { 1 };
        match losing > 0 && turn == 0 {
            true => {}
            false => self.frame(message, losing > 1 && turn == losing / 2),
        }
    }
}
