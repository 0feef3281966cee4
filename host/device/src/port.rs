//! The device's serial port.

use std::io::{ErrorKind as Io, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;

use serialport::{ClearBuffer, ErrorKind, SerialPort, SerialPortInfo, SerialPortType};

use mimu_recording::error::{Error, Result};

/// Baud rate of the line, with 8 data bits, no parity and 1 stop bit; equal to the firmware's `BAUD`. Native USB ignores it.
pub const BAUD: u32 = 1_000_000;

/// Longest wait of a read. It bounds the delay of everything that is checked between reads (Ctrl-C, deadlines).
const POLL: Duration = Duration::from_millis(20);

/// An open port, locked for this program.
pub struct Port {
    name: String,
    serial: Box<dyn SerialPort>,
    lost: bool,
}

impl Port {
    /// Opens the port of this path (`/dev/ttyACM0`, `COM3`).
    pub fn open(name: &str) -> Result<Self> {
        let serial = serialport::new(name, BAUD)
            .timeout(POLL)
            .open()
            .map_err(|error| not_opened(name, &error))?;
        // Bytes that an earlier program left unread must not be taken for answers.
        let _ = serial.clear(ClearBuffer::Input);
        Ok(Self {
            name: name.to_owned(),
            serial,
            lost: false,
        })
    }

    /// Path given to [`Self::open`].
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Reads available bytes, or waits for them up to the poll interval; 0 if none came. An error means that the port is gone.
    pub fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        match self.serial.read(bytes) {
            // A device that was unplugged reports end of file.
            Ok(0) => Err(self.gone()),
            Ok(count) => Ok(count),
            Err(e) if matches!(e.kind(), Io::TimedOut | Io::WouldBlock | Io::Interrupted) => Ok(0),
            Err(_) => Err(self.gone()),
        }
    }

    /// Sends all of `bytes`.
    pub fn write(&mut self, mut bytes: &[u8]) -> Result<()> {
        // A frame takes 5 ms. A line that accepts nothing for this long is stuck.
        let mut patience = 100;
        while !bytes.is_empty() {
            match self.serial.write(bytes) {
                Ok(0) => return Err(self.gone()),
                Ok(count) => bytes = &bytes[count..],
                Err(e) if e.kind() == Io::Interrupted => {}
                Err(e) if matches!(e.kind(), Io::TimedOut | Io::WouldBlock) => {
                    patience -= 1;
                    if patience == 0 {
                        let problem = "the port accepts no bytes";
                        let remedy = "unplug the board and plug it in again";
                        return Err(Error::device(&self.name, problem, remedy));
                    }
                }
                Err(_) => return Err(self.gone()),
            }
        }
        Ok(())
    }

    /// Whether the port has vanished.
    pub fn is_lost(&self) -> bool {
        self.lost
    }

    fn gone(&mut self) -> Error {
        self.lost = true;
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

/// Reading and writing end of a serial port, or of `tcp://HOST:PORT`, for a device other than mimu's. A read waits at most `poll`.
pub fn serial_pair(name: &str, baud: u32, poll: Duration) -> Result<SerialPair> {
    if let Some(address) = name.strip_prefix("tcp://") {
        let connected = TcpStream::connect(address).and_then(|line| {
            line.set_read_timeout(Some(poll))?;
            line.set_nodelay(true)?;
            Ok((line.try_clone()?, line))
        });
        let (read, write) = connected.map_err(|error| {
            let remedy = "check that it is on and reachable, and the address, HOST:PORT";
            Error::device(name, error, remedy)
        })?;
        return Ok((Box::new(read), Box::new(write)));
    }
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

/// USB vendor of ST's debuggers, and those products that have a serial port: ST-LINK/V2-1 with and without a drive, STLINK-V3E, -V3S, -V3 with two
/// ports, -V3E without a drive, -V3PWR (OpenOCD's list, `stlink_usb.c`).
const ST_LINK: (u16, &[u16]) = (
    0x0483,
    &[0x374b, 0x3752, 0x374e, 0x374f, 0x3753, 0x3754, 0x3757],
);
/// The firmware's own USB: `USB_VENDOR` and `USB_PRODUCT` of its design parameters.
const OWN: (u16, &[u16]) = (0x1209, &[0x0001]);

/// The serial ports of this computer.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Ports {
    /// Ports where a board can be: a debugger of ST, or the firmware's own USB.
    pub of_boards: Vec<String>,
    /// The other ports with their descriptions. Nothing is sent to them unless the user names one, because other devices may be there.
    pub others: Vec<String>,
    /// The system does not list its ports, as in a container without `/sys`. A port that the user names can still be opened.
    pub unlisted: bool,
}

/// Where Linux lists its serial ports.
const LISTED: &str = "/sys/class/tty";

/// The serial ports of this computer.
pub fn ports() -> Ports {
    listed_in(Path::new(LISTED))
}

fn listed_in(folder: &Path) -> Ports {
    // `serialport` 4.10 panics if the folder is missing.
    if cfg!(target_os = "linux") && !folder.is_dir() {
        return Ports {
            unlisted: true,
            ..Ports::default()
        };
    }
    serialport::available_ports().map_or_else(
        |_| Ports {
            unlisted: true,
            ..Ports::default()
        },
        sorted,
    )
}

fn sorted(mut all: Vec<SerialPortInfo>) -> Ports {
    all.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    let mut ports = Ports::default();
    for SerialPortInfo {
        port_name,
        port_type,
    } in all
    {
        match port_type {
            SerialPortType::UsbPort(usb) => {
                let is = |(vendor, products): (u16, &[u16])| {
                    usb.vid == vendor && products.contains(&usb.pid)
                };
                if is(ST_LINK) || is(OWN) {
                    ports.of_boards.push(port_name);
                    continue;
                }
                let named = usb.product.map(|product| format!(", {product}"));
                ports.others.push(format!(
                    "{port_name} ({:04x}:{:04x}{})",
                    usb.vid,
                    usb.pid,
                    named.unwrap_or_default()
                ));
            }
            _ => ports.others.push(format!("{port_name} (not USB)")),
        }
    }
    ports
}

impl Ports {
    /// The available ports, as a remedy of an error.
    pub(super) fn listed(&self) -> String {
        match [&self.of_boards[..], &self.others].concat().as_slice() {
            [] if self.unlisted => format!(
                "this system does not list its ports ({LISTED} is missing): name the board's port, such as /dev/ttyACM0"
            ),
            [] => "this computer has no serial port: plug the board in".into(),
            names => format!("name one of {}", names.join(", ")),
        }
    }

    /// The ports that were not tried, as a part of a sentence; empty if there are none.
    pub(super) fn left_alone(&self) -> String {
        match self.others.as_slice() {
            [] => String::new(),
            others => format!(
                ", ignored because they are not mimu boards: {}",
                others.join(", ")
            ),
        }
    }
}

fn not_opened(name: &str, error: &serialport::Error) -> Error {
    // A pseudo-terminal or a board that was just unplugged may fail differently. The message is then the system's.
    let (problem, remedy) = match error.kind() {
        ErrorKind::Io(Io::NotFound) => ("the port does not exist".into(), ports().listed()),
        ErrorKind::Io(Io::PermissionDenied) => (
            "no permission to open the port".into(),
            "join the group that owns the port (`sudo usermod -aG dialout $USER` on Debian) and log in again"
                .into(),
        ),
        // `serialport` reports this for EBUSY and for a lock held by another program.
        ErrorKind::NoDevice => (
            "the port is busy: another program has it open".into(),
            "close that program (a terminal, a recording), or wait until it is done".into(),
        ),
        _ => match std::fs::metadata(name).is_ok_and(|m| m.is_file() || m.is_dir()) {
            true => ("this is not a serial port".into(), ports().listed()),
            false => (
                format!("it cannot be opened as a serial port: {}", error.description),
                ports().listed(),
            ),
        },
    };
    Error::device(name, problem, remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_ports_of_boards_are_tried_and_the_others_are_named() {
        let port = |name: &str, usb: Option<(u16, u16, &str)>| SerialPortInfo {
            port_name: name.into(),
            port_type: match usb {
                None => SerialPortType::Unknown,
                Some((vid, pid, product)) => SerialPortType::UsbPort(serialport::UsbPortInfo {
                    vid,
                    pid,
                    serial_number: None,
                    manufacturer: None,
                    product: Some(product.into()),
                }),
            },
        };
        // A GPS receiver, an Arduino, a multimeter at a serial port of the mainboard.
        let ports = sorted(vec![
            port("ttyUSB0", Some((0x067b, 0x2303, "PL2303"))),
            port("ttyACM1", Some((0x0483, 0x374e, "STLINK-V3"))),
            port("ttyS0", None),
            port("ttyACM2", Some((0x2341, 0x0043, "Uno"))),
            port("ttyACM0", Some((0x1209, 0x0001, "mimu"))),
            // Same vendor, but not a debugger: another device.
            port("ttyACM3", Some((0x0483, 0x5740, "VCP"))),
        ]);
        assert_eq!(ports.of_boards, ["ttyACM0", "ttyACM1"]);
        let others = [
            "ttyACM2 (2341:0043, Uno)",
            "ttyACM3 (0483:5740, VCP)",
            "ttyS0 (not USB)",
            "ttyUSB0 (067b:2303, PL2303)",
        ];
        assert_eq!(ports.others, others);
        assert!(ports.left_alone().contains("ttyACM2 (2341:0043, Uno)"));
    }

    #[test]
    fn a_system_that_does_not_list_its_ports_is_reported() {
        let ports = listed_in(Path::new("/nowhere/class/tty"));
        assert_eq!(ports.unlisted, cfg!(target_os = "linux"));
        if ports.unlisted {
            assert!(ports.listed().contains("/sys/class/tty is missing"));
        }
        assert!(!sorted(Vec::new()).listed().contains("missing"));
    }

    #[test]
    fn every_reason_why_a_port_does_not_open_is_told_apart() {
        for (kind, word) in [
            (ErrorKind::Io(Io::NotFound), "does not exist"),
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
