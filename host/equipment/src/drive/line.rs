//! A text connection to a table, over TCP or a serial port.

use std::io::{BufRead as _, BufReader, Write};
use std::time::{Duration, Instant};

use mimu_recording::error::{Error, Result};

/// Sends lines and reads lines.
pub(super) struct Line {
    read: BufReader<Box<dyn std::io::Read + Send>>,
    write: Box<dyn Write + Send>,
    pub name: String,
    timeout: Duration,
}

impl Line {
    pub fn open(port: &str, baud: u32, timeout: Duration) -> Result<Self> {
        let (read, write) = mimu_device::serial_pair(port, baud, Duration::from_millis(50))?;
        Ok(Self {
            read: BufReader::new(read),
            write,
            name: port.trim_start_matches("tcp://").to_owned(),
            timeout,
        })
    }

    pub fn say(&mut self, text: &str) -> Result<()> {
        let line = format!("{text}\n");
        let said = self.write.write_all(line.as_bytes());
        let said = said.and_then(|()| self.write.flush());
        said.map_err(|e| Error::device(&self.name, e, "check the line"))
    }

    pub fn answer(&mut self, to: &str) -> Result<String> {
        use std::io::ErrorKind as Io;
        let until = Instant::now() + self.timeout;
        let mut bytes = Vec::new();
        loop {
            match self.read.read_until(b'\n', &mut bytes) {
                Ok(0) => {
                    let problem = "it has closed the connection";
                    return Err(Error::device(&self.name, problem, "check it"));
                }
                Ok(_) if bytes.ends_with(b"\n") => {
                    return Ok(String::from_utf8_lossy(&bytes).trim().to_owned());
                }
                Ok(_) => {}
                Err(e) if matches!(e.kind(), Io::TimedOut | Io::WouldBlock | Io::Interrupted) => {}
                Err(e) => return Err(Error::device(&self.name, e, "check the line")),
            }
            if Instant::now() > until {
                let problem = format!("it does not answer {to:?}");
                return Err(Error::device(&self.name, problem, "check it"));
            }
        }
    }
}
