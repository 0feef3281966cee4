//! A board behind a pseudo-terminal, for any program that opens serial ports.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::control::Control;
use crate::flash::BANK;
use crate::interference::Interference;
use crate::port::Port;
use crate::running::{Board, STORE};

mod commands;

use commands::BenchState;
pub use commands::COMMANDS;

/// Speed of virtual time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// Follows the wall clock, as closely as the machine can.
    Wall,
    /// As fast as the machine allows, but never ahead of the reader: time stands still while no program has the terminal open, and while bytes wait
    /// to be read.
    Fast,
}

/// Longest virtual time until a firmware sends its first byte, ms.
const START_MS: u32 = 2000;

/// Virtual time until a digital board streams, ns: it first measures the rate of its sensor.
const MEASURING_NS: u64 = 800_000_000;

/// Virtual time between two polls of the terminal, ns: the longest delay of a request.
const SLICE_NS: u64 = 1_000_000;

/// The same at the fast pace: at 1 ms, a thousand handovers between two threads per virtual second would cost a fifth of the time.
const FAST_SLICE_NS: u64 = 5_000_000;

/// A board that is later than this at the wall's pace stays behind. Shorter delays, as other programs cause them, are caught up.
const MOST_LATE: Duration = Duration::from_millis(20);

/// Bytes that may wait for the line to the device. The rest stays in the terminal, which holds up the sender as a port's driver would.
const WAITING: usize = 256;

/// Counts of bytes by their fate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    /// From the device: read, or waiting in the terminal.
    pub delivered: u64,
    /// From the device while the terminal was not open.
    pub unheard: u64,
    /// From the device while the terminal was full. Only at the wall's pace: a serial line cannot wait.
    pub lost: u64,
    /// To the device.
    pub sent: u64,
    /// To the device while its supply was off.
    pub unpowered: u64,
    /// From the device, and changed by the bench.
    pub garbled: u64,
}

impl fmt::Display for Traffic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            delivered,
            unheard,
            lost,
            sent,
            unpowered,
            garbled,
        } = self;
        write!(
            f,
            "{delivered} {unheard} {lost} {sent} {unpowered} {garbled}"
        )
    }
}

/// A board with its terminal.
#[derive(Debug)]
pub struct Served {
    board: Board,
    port: Port,
    control: Option<Control>,
    bench: BenchState,
    interference: Interference,
    store: Option<StoreFile>,
    pace: Pace,
    traffic: Traffic,
    /// Bytes from the device that the terminal has not taken yet.
    waiting: Vec<u8>,
    /// When it began, by the wall clock and by the board's clock, ns.
    began: Instant,
    first_ns: u64,
    /// Total delay relative to the wall clock.
    behind: Duration,
}

impl Served {
    /// Puts a board that has not yet run behind a terminal. If `store` is given, this file keeps the stored flash contents: it is read if it exists,
    /// and created otherwise. The firmware reads the flash once, at its start.
    ///
    /// Errors: no terminal available; the file cannot be read or created, or is of another kind.
    pub fn new(mut board: Board, pace: Pace, store: Option<&Path>) -> Result<Self, String> {
        let store = match store {
            Some(path) => {
                let (file, bytes) = StoreFile::open(path)?;
                board.set_store(bytes)?;
                Some(file)
            }
            None => None,
        };
        let first_ns = board.state().ns;
        Ok(Self {
            board,
            port: Port::new()?,
            control: None,
            bench: BenchState::new(0),
            interference: Interference::new(0),
            store,
            pace,
            traffic: Traffic::default(),
            waiting: Vec::new(),
            began: Instant::now(),
            first_ns,
            behind: Duration::ZERO,
        })
    }

    /// Runs the board until its firmware has sent something and measures, like a board that was plugged in before its port is opened. Executing this takes seconds
    /// on a busy machine; otherwise the program that opens the port would wait for its answer that long.
    ///
    /// Errors: the emulator gave up.
    pub fn start(&mut self) -> Result<(), String> {
        let mut spoken = false;
        for _ in 0..START_MS {
            self.board.run_for(SLICE_NS)?;
            let quiet = self.board.receive().is_empty();
            if spoken && quiet {
                break;
            }
            spoken |= !quiet;
        }
        if self.board.is_digital() {
            self.board.run_for(MEASURING_NS)?;
            self.board.receive();
        }
        self.began = Instant::now();
        self.first_ns = self.board.state().ns;
        Ok(())
    }

    /// Takes commands at a TCP address of this machine such as `127.0.0.1:0`, where port 0 selects any free port. They are answered while the board
    /// steps or waits. The seed is reported in the identity, and decides which bytes the faults change.
    ///
    /// Returns the address on which it listens.
    ///
    /// Errors: not an address, or it is in use.
    pub fn listen(&mut self, address: &str, seed: u64) -> Result<SocketAddr, String> {
        let control = Control::bind(address)?;
        let address = control.address();
        self.control = Some(control);
        self.bench = BenchState::new(seed);
        self.interference = Interference::new(seed);
        Ok(address)
    }

    /// Makes a symbolic link to the terminal. After the line was unplugged, it points to the new terminal.
    ///
    /// Errors: the name belongs to something else.
    pub fn link(&mut self, link: &Path) -> Result<(), String> {
        self.port.link(link)
    }

    /// The path to open: the link, if there is one.
    pub fn path(&self) -> &Path {
        self.port.path()
    }

    /// Counts of bytes so far.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// The board.
    pub fn board(&mut self) -> &mut Board {
        &mut self.board
    }

    /// Answers the commands that have arrived, then runs a slice of virtual time, or waits.
    ///
    /// Errors: the emulator, the terminal or the file gave up.
    pub fn step(&mut self) -> Result<(), String> {
        if let Some(mut control) = self.control.take() {
            let answered = control.poll(&mut |line| self.answer(line));
            self.control = Some(control);
            answered?;
        }
        if self.pace == Pace::Fast && !(self.port.is_open() && self.waiting.is_empty()) {
            if !self.port.is_open() {
                // Poll returns at once if the terminal is not open.
                std::thread::sleep(Duration::from_millis(1));
            }
            self.port.wait_for_room(10);
            return self.deliver();
        }
        self.collect()?;
        let slice_ns = match self.pace {
            Pace::Wall => SLICE_NS,
            Pace::Fast => FAST_SLICE_NS,
        };
        let state = self.board.run_for(slice_ns)?;
        let bytes = self.board.receive();
        let mut bytes: Vec<u8> = bytes.iter().map(|&(_, byte)| byte).collect();
        if self.port.is_open() {
            self.traffic.garbled += self.interference.pass(&mut bytes);
        }
        self.waiting.extend(bytes);
        self.deliver()?;
        self.keep()?;
        if self.bench.is_off() {
            // Nothing is converted, but the unit moves. Without this, all of the motion would be computed at once at the end.
            self.board.front(|front, ns| front.advance(ns))?;
        }
        if self.pace == Pace::Wall {
            self.keep_pace(state.ns);
        }
        Ok(())
    }

    /// Waits for the wall clock. A late board does not hurry, because a real crystal does not: at three times its rate, it would send faster than a
    /// host must be able to read.
    fn keep_pace(&mut self, now_ns: u64) {
        let due = self.began + Duration::from_nanos(now_ns - self.first_ns);
        let now = Instant::now();
        std::thread::sleep(due.saturating_duration_since(now));
        let late = now.saturating_duration_since(due);
        if late > MOST_LATE {
            self.began += late;
            self.behind += late;
        }
    }

    /// How far the board has fallen behind the wall clock, at its pace.
    pub fn behind(&self) -> Duration {
        self.behind
    }

    /// Writes the changes of the flash to the file.
    fn keep(&mut self) -> Result<(), String> {
        if self.store.is_none() {
            return Ok(());
        }
        let changed = self.board.changed()?;
        self.keep_spans(&changed)
    }

    /// Writes ranges of the flash (first address, bytes) to the file.
    fn keep_spans(&mut self, spans: &[(u64, u64)]) -> Result<(), String> {
        if let Some(store) = &mut self.store {
            for &(first, length) in spans.iter().filter(|(first, _)| *first >= STORE) {
                let bytes = self.board.memory(first, length as usize)?;
                store.write(first - STORE, &bytes)?;
            }
        }
        Ok(())
    }

    /// From the terminal to the line.
    fn collect(&mut self) -> Result<(), String> {
        let mut some = [0; WAITING];
        if self.bench.is_off() {
            self.traffic.unpowered += self.port.read(&mut some)? as u64;
            return Ok(());
        }
        let room = WAITING.saturating_sub(self.board.unsent());
        let count = self.port.read(&mut some[..room])?;
        self.board.send(&some[..count]);
        self.traffic.sent += count as u64;
        Ok(())
    }

    /// From the line to the terminal.
    fn deliver(&mut self) -> Result<(), String> {
        if !self.port.is_open() {
            self.traffic.unheard += self.waiting.len() as u64;
            self.waiting.clear();
            return Ok(());
        }
        while !self.waiting.is_empty() {
            let count = self.port.write(&self.waiting)?;
            if count == 0 {
                break;
            }
            self.waiting.drain(..count);
            self.traffic.delivered += count as u64;
        }
        if self.pace == Pace::Wall {
            self.traffic.lost += self.waiting.len() as u64;
            self.waiting.clear();
        }
        Ok(())
    }
}

/// A file with the contents of bank 2. Each word and each erased sector is written when it changes in the flash. So to the device the end of this
/// program is like a cut supply.
#[derive(Debug)]
struct StoreFile {
    file: File,
    path: PathBuf,
}

impl StoreFile {
    fn open(path: &Path) -> Result<(Self, Vec<u8>), String> {
        let name = path.display();
        let refused = |e: io::Error| format!("{name}: {e}");
        let mut bytes = Vec::new();
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        let file = match options.open(path) {
            Ok(mut file) => {
                file.read_to_end(&mut bytes).map_err(refused)?;
                if bytes.len() as u64 != BANK {
                    return Err(format!(
                        "{name}: {} bytes, but a stored flash bank has {BANK}; name another file",
                        bytes.len()
                    ));
                }
                file
            }
            Err(e) if e.kind() == ErrorKind::NotFound => {
                bytes = vec![0xFF; BANK as usize];
                let mut file = options.create_new(true).open(path).map_err(refused)?;
                file.write_all(&bytes).map_err(refused)?;
                file
            }
            Err(e) => return Err(refused(e)),
        };
        let path = path.to_owned();
        Ok((Self { file, path }, bytes))
    }

    fn write(&mut self, offset: u64, bytes: &[u8]) -> Result<(), String> {
        let mut write = || {
            self.file.seek(SeekFrom::Start(offset))?;
            self.file.write_all(bytes)
        };
        write().map_err(|e| format!("{}: {e}", self.path.display()))
    }
}
