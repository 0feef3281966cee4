//! A pseudo-terminal that replaces the serial port.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The controlling side of a pseudo-terminal whose other side is opened like a serial port.
#[derive(Debug)]
pub struct Terminal {
    side: File,
    path: PathBuf,
}

impl Terminal {
    /// A pseudo-terminal in raw mode: bytes pass as they are, and what is sent is not echoed.
    ///
    /// Errors: the system has no terminal available.
    pub fn open() -> io::Result<Self> {
        // A program that a test starts must not inherit it: a port that disappears would still be open there.
        let side = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&side)?;
        unlockpt(&side)?;
        let name = ptsname(&side, Vec::new())?;
        let path = PathBuf::from(name.to_string_lossy().into_owned());
        fcntl_setfl(&side, fcntl_getfl(&side)? | OFlags::NONBLOCK)?;

        // The mode belongs to the terminal and stays after this is closed. Opening it once also lets the system report from then on whether any
        // program has it open.
        let other = File::options()
            .read(true)
            .write(true)
            .custom_flags(OFlags::NOCTTY.bits() as i32)
            .open(&path)?;
        let mut mode = tcgetattr(&other)?;
        mode.make_raw();
        tcsetattr(&other, OptionalActions::Now, &mode)?;
        Ok(Self {
            side: File::from(side),
            path,
        })
    }

    /// The path to open.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether any program has it open.
    pub fn is_open(&self) -> bool {
        !self.ready(PollFlags::OUT, 0).contains(PollFlags::HUP)
    }

    /// Waits until it accepts bytes again, is closed, or so many milliseconds have passed.
    pub fn wait_for_room(&self, ms: u32) {
        self.ready(PollFlags::OUT, ms);
    }

    /// Waits until bytes were written to it, it is closed, or so many milliseconds have passed.
    pub fn wait_for_bytes(&self, ms: u32) {
        self.ready(PollFlags::IN, ms);
    }

    fn ready(&self, what: PollFlags, ms: u32) -> PollFlags {
        let mut wanted = [PollFd::new(&self.side, what)];
        let timeout = Timespec {
            tv_sec: i64::from(ms / 1000),
            tv_nsec: i64::from(ms % 1000) * 1_000_000,
        };
        match poll(&mut wanted, Some(&timeout)) {
            Ok(_) => wanted[0].revents(),
            // If interrupted, nothing is ready yet.
            Err(_) => PollFlags::empty(),
        }
    }

    /// Reads what was written to it, up to the length of `into`, and returns the number of bytes: zero if there are none or no program has it open.
    ///
    /// Errors: the terminal is broken.
    pub fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match self.side.read(into) {
            Ok(count) => Ok(count),
            Err(e) if e.kind() == ErrorKind::WouldBlock || e.kind() == ErrorKind::Interrupted => {
                Ok(0)
            }
            // Linux returns this for a terminal that no program has open.
            Err(e) if e.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error()) => Ok(0),
            Err(e) => Err(e),
        }
    }

    /// Writes as many bytes as the terminal accepts, and returns their number.
    ///
    /// Errors: the terminal is broken.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.side.write(bytes) {
            Ok(count) => Ok(count),
            Err(e) if e.kind() == ErrorKind::WouldBlock || e.kind() == ErrorKind::Interrupted => {
                Ok(0)
            }
            Err(e) => Err(e),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(path: &Path) -> File {
        File::options().read(true).write(true).open(path).unwrap()
    }

    #[test]
    fn bytes_pass_both_ways_as_they_are_and_without_an_echo() {
        let mut terminal = Terminal::open().unwrap();
        let mut port = open(terminal.path());
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(terminal.write(&all).unwrap(), 256);
        let mut back = vec![0; 256];
        port.read_exact(&mut back).unwrap();
        assert_eq!(back, all);

        port.write_all(&all).unwrap();
        let mut there: Vec<u8> = Vec::new();
        while there.len() < 256 {
            let mut some = [0; 64];
            let count = terminal.read(&mut some).unwrap();
            there.extend(&some[..count]);
        }
        assert_eq!(there, all);
        assert_eq!(terminal.read(&mut back).unwrap(), 0, "an echo");
    }

    #[test]
    fn it_is_open_while_somebody_has_it_open_and_raw_again_for_the_next() {
        let mut terminal = Terminal::open().unwrap();
        assert!(!terminal.is_open());
        for _ in 0..2 {
            let mut port = open(terminal.path());
            assert!(terminal.is_open());
            terminal.write(b"\n\x03\x11").unwrap();
            let mut back = [0; 3];
            port.read_exact(&mut back).unwrap();
            assert_eq!(&back, b"\n\x03\x11");
            drop(port);
            assert!(!terminal.is_open());
            assert_eq!(terminal.read(&mut back).unwrap(), 0);
        }
    }

    #[test]
    fn it_is_full_some_time_when_nobody_reads() {
        let mut terminal = Terminal::open().unwrap();
        let _port = open(terminal.path());
        let mut taken = 0;
        while taken < 10_000_000 {
            match terminal.write(&[0x55; 1000]).unwrap() {
                0 => break,
                count => taken += count,
            }
        }
        assert!((1000..1_000_000).contains(&taken), "{taken}");
    }
}
