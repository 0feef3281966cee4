//! A pseudo-terminal that replaces a serial port.
//!
//! It uses `rustix` instead of `serialport`: every program that a test starts inherits the pairs of `serialport`, so a port that disappears here
//! would still be open there.

use std::fs::File;
use std::io::{ErrorKind, Read as _, Write as _};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The device's side.
pub struct Terminal(File);

impl Terminal {
    /// A terminal in raw mode, and the path that is opened like a serial port.
    pub fn open() -> (Self, String) {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let side = openpt(flags).expect("a pseudo-terminal");
        grantpt(&side).unwrap();
        unlockpt(&side).unwrap();
        let path = ptsname(&side, Vec::new()).unwrap().into_string().unwrap();
        fcntl_setfl(&side, fcntl_getfl(&side).unwrap() | OFlags::NONBLOCK).unwrap();
        // The mode stays when the other side is closed. Opening it once lets the system report from then on whether it is open.
        let other = File::options().read(true).write(true).open(&path).unwrap();
        let mut mode = tcgetattr(&other).unwrap();
        mode.make_raw();
        tcsetattr(&other, OptionalActions::Now, &mode).unwrap();
        (Self(File::from(side)), path)
    }

    /// Waits up to 2 ms for these events, and returns those that occurred.
    fn wait(&self, what: PollFlags) -> PollFlags {
        let mut wanted = [PollFd::new(&self.0, what)];
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: 2_000_000,
        };
        let _ = poll(&mut wanted, Some(&timeout));
        let is = wanted[0].revents();
        if is.contains(PollFlags::HUP) {
            // No program has it open; poll returns at once in this case.
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        is
    }

    /// Whether any program has it open.
    pub fn is_open(&self) -> bool {
        !self.wait(PollFlags::OUT).contains(PollFlags::HUP)
    }

    /// Reads the bytes sent to it, waiting at most 2 ms.
    pub fn read(&mut self, into: &mut [u8]) -> usize {
        self.wait(PollFlags::IN);
        self.0.read(into).unwrap_or(0)
    }

    /// Sends some of `bytes` and returns how many: all of them are lost while no program has it open.
    pub fn write(&mut self, bytes: &[u8]) -> usize {
        if self.wait(PollFlags::OUT).contains(PollFlags::HUP) {
            return bytes.len();
        }
        match self.0.write(bytes) {
            Ok(count) => count,
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => 0,
            Err(_) => bytes.len(),
        }
    }
}
