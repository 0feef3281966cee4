//! A pseudo-terminal that replaces a serial port, for a device that loses what it sends while no program listens.

use std::time::Duration;

/// The device's side.
pub struct Terminal(mimu_board::terminal::Terminal);

impl Terminal {
    /// A terminal in raw mode, and the path that is opened like a serial port.
    pub fn open() -> (Self, String) {
        let side = mimu_board::terminal::Terminal::open().expect("a pseudo-terminal");
        let path = side.path().display().to_string();
        (Self(side), path)
    }

    /// Whether any program has it open.
    pub fn is_open(&self) -> bool {
        self.0.is_open()
    }

    /// Reads the bytes sent to it, waiting at most 2 ms.
    pub fn read(&mut self, into: &mut [u8]) -> usize {
        match self.is_open() {
            true => self.0.wait_for_bytes(2),
            false => std::thread::sleep(Duration::from_millis(2)),
        }
        self.0.read(into).unwrap_or(0)
    }

    /// Sends some of `bytes` and returns how many, waiting at most 2 ms for room.
    pub fn write(&mut self, bytes: &[u8]) -> usize {
        if !self.is_open() {
            return bytes.len();
        }
        self.0.wait_for_room(2);
        self.0.write(bytes).unwrap_or(bytes.len())
    }
}
