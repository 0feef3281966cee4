//! A text connection to a table or a chamber, over TCP or a serial port.

use std::io::{BufRead as _, BufReader, Write};
use std::net::TcpStream;
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
    pub fn tcp(address: &str, timeout: Duration) -> Result<Self> {
        let broken =
            |e: std::io::Error| Error::device(address, e, "check that it is on and reachable");
        let stream = TcpStream::connect(address).map_err(broken)?;
        stream
            .set_read_timeout(Some(Duration::from_millis(50)))
            .map_err(broken)?;
        stream.set_nodelay(true).map_err(broken)?;
        let read = stream.try_clone().map_err(broken)?;
        Ok(Self {
            read: BufReader::new(Box::new(read)),
            write: Box::new(stream),
            name: address.to_owned(),
            timeout,
        })
    }

    pub fn serial(port: &str, baud: u32, timeout: Duration) -> Result<Self> {
        let (read, write) = mimu_device::serial_pair(port, baud, Duration::from_millis(50))?;
        Ok(Self {
            read: BufReader::new(read),
            write,
            name: port.to_owned(),
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
