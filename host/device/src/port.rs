//! The serial port that the device is at.

use std::io::{ErrorKind as Io, Read as _, Write as _};
use std::time::Duration;

use serialport::{ClearBuffer, ErrorKind, SerialPort, SerialPortType};

use mimu_recording::error::{Error, Result};

/// Speed of the line, 8 data bits, no parity, 1 stop bit. That of the firmware's `BAUD`; over native USB it means nothing.
pub const BAUD: u32 = 1_000_000;

/// Longest time that a read waits: what is looked at between reads (Ctrl-C, deadlines) is then never later than this.
const POLL: Duration = Duration::from_millis(20);

/// A port that is open, for this program alone.
pub struct Port {
    name: String,
    serial: Box<dyn SerialPort>,
}

impl Port {
    /// Opens the port of this path (`/dev/ttyACM0`, `COM3`).
    pub fn open(name: &str) -> Result<Self> {
        let serial = serialport::new(name, BAUD)
            .timeout(POLL)
            .open()
            .map_err(|error| not_opened(name, &error))?;
        // What a program before this one has not read is nobody's answer.
        let _ = serial.clear(ClearBuffer::Input);
        Ok(Self {
            name: name.to_owned(),
            serial,
        })
    }

    /// Path that it was opened by.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Reads what is there, or waits a little for it; 0 if nothing came. An error means that the port is gone.
    pub fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        match self.serial.read(bytes) {
            // A device that was pulled out is at its end for ever.
            Ok(0) => Err(self.gone()),
            Ok(count) => Ok(count),
            Err(e) if matches!(e.kind(), Io::TimedOut | Io::WouldBlock | Io::Interrupted) => Ok(0),
            Err(_) => Err(self.gone()),
        }
    }

    /// Sends all of `bytes`.
    pub fn write(&mut self, mut bytes: &[u8]) -> Result<()> {
        // A frame takes 5 ms; a line that takes nothing for this long is stuck.
        let mut patience = 100;
        while !bytes.is_empty() {
            match self.serial.write(bytes) {
                Ok(0) => return Err(self.gone()),
                Ok(count) => bytes = &bytes[count..],
                Err(e) if e.kind() == Io::Interrupted => {}
                Err(e) if matches!(e.kind(), Io::TimedOut | Io::WouldBlock) => {
                    patience -= 1;
                    if patience == 0 {
                        let problem = "the port takes no bytes";
                        let remedy = "unplug the board and plug it in again";
                        return Err(Error::device(&self.name, problem, remedy));
                    }
                }
                Err(_) => return Err(self.gone()),
            }
        }
        Ok(())
    }

    fn gone(&self) -> Error {
        Error::device(
            &self.name,
            "the port has vanished",
            "check the cable and the board, and run it again",
        )
    }
}

impl std::fmt::Debug for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Port").field(&self.name).finish()
    }
}

/// Both ends of a serial port that anything but a mimu device is at: to read from and to write to. A read waits at most `poll`.
pub fn serial_pair(name: &str, baud: u32, poll: Duration) -> Result<SerialPair> {
    let write = serialport::new(name, baud)
        .timeout(poll)
        .open()
        .map_err(|error| not_opened(name, &error))?;
    let read = write
        .try_clone()
        .map_err(|error| not_opened(name, &error))?;
    Ok((Box::new(read), Box::new(write)))
}

/// See [`serial_pair`].
pub type SerialPair = (
    Box<dyn std::io::Read + Send>,
    Box<dyn std::io::Write + Send>,
);

/// Ports of this computer that a board can be at: those on USB, or all of them if none says that it is.
pub fn ports() -> Vec<String> {
    // A system that cannot list its ports has none to offer; one that is named still opens.
    let all = serialport::available_ports().unwrap_or_default();
    let on_usb =
        |p: &&serialport::SerialPortInfo| matches!(p.port_type, SerialPortType::UsbPort(_));
    let some = all.iter().any(|p| on_usb(&p));
    let mut names: Vec<String> = all
        .iter()
        .filter(|p| !some || on_usb(p))
        .map(|p| p.port_name.clone())
        .collect();
    names.sort();
    names
}

/// The ports as a remedy: what there is to choose from.
pub(super) fn listed(names: &[String]) -> String {
    match names {
        [] => "no serial port is there: plug the board in".into(),
        names => format!("name one of {}", names.join(", ")),
    }
}

fn not_opened(name: &str, error: &serialport::Error) -> Error {
    // A pseudo-terminal or a board that was just pulled out can fail in ways of its own: the system's words then.
    let (problem, remedy) = match error.kind() {
        ErrorKind::Io(Io::NotFound) => ("there is no such port".into(), listed(&ports())),
        ErrorKind::Io(Io::PermissionDenied) => (
            "no permission to open the port".into(),
            "join the group that owns it (`sudo usermod -aG dialout $USER` on Debian) and log in again"
                .into(),
        ),
        // What `serialport` makes of EBUSY, and of a lock that another program holds.
        ErrorKind::NoDevice => (
            "the port is busy: another program has it open".into(),
            "close that program (a terminal, a recording), or wait until it is done".into(),
        ),
        _ => match std::fs::metadata(name).is_ok_and(|m| m.is_file() || m.is_dir()) {
            true => ("this is not a serial port".into(), listed(&ports())),
            false => (
                format!("it cannot be opened as a serial port: {}", error.description),
                listed(&ports()),
            ),
        },
    };
    Error::device(name, problem, remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_why_a_port_does_not_open_is_told_apart() {
        for (kind, word) in [
            (ErrorKind::Io(Io::NotFound), "no such port"),
            (ErrorKind::Io(Io::PermissionDenied), "no permission"),
            (ErrorKind::NoDevice, "busy"),
            (ErrorKind::Unknown, "the system's words"),
        ] {
            let error = serialport::Error::new(kind, "the system's words");
            let line = not_opened("/nowhere/port", &error).to_string();
            assert!(line.contains(word) && line.contains("; "), "{line}");
        }
    }
}
