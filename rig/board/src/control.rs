//! Lines of text over TCP, each answered by a line. Never blocks.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};

/// Longest line, bytes. The longest command takes a tenth of it.
const LONGEST: usize = 1000;

/// Largest number of simultaneous clients.
const MOST: usize = 16;

/// A client with more unread bytes of answers is dropped.
const UNREAD: usize = 1 << 16;

/// The listener for commands, and its clients.
#[derive(Debug)]
pub(crate) struct Control {
    listener: TcpListener,
    address: SocketAddr,
    clients: Vec<Client>,
}

/// A client that sends commands.
#[derive(Debug)]
struct Client {
    stream: TcpStream,
    received: Vec<u8>,
    unsent: Vec<u8>,
    /// No more input follows: it is dropped after its last answer.
    ended: bool,
}

impl Control {
    /// Listens at an address such as `127.0.0.1:0`; port 0 selects any free port.
    ///
    /// Errors: not an address, or it is in use.
    pub(crate) fn bind(address: &str) -> Result<Self, String> {
        let refused = |e: io::Error| {
            format!(
                "{address}: {e}; give the control an address of this machine and a free port, as 127.0.0.1:0"
            )
        };
        let listener = TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        Ok(Self {
            listener,
            address,
            clients: Vec::new(),
        })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers every line that has arrived.
    ///
    /// Errors: those of `answer` for which there is no answer line.
    pub(crate) fn poll(
        &mut self,
        answer: &mut dyn FnMut(&str) -> Result<String, String>,
    ) -> Result<(), String> {
        // A client that gives up before it is accepted does not matter.
        while let Ok((stream, _)) = self.listener.accept() {
            // If there are too many clients, the connection of a new one is closed.
            if self.clients.len() < MOST && stream.set_nonblocking(true).is_ok() {
                // Without this, an answer may be delayed by 40 ms.
                let _ = stream.set_nodelay(true);
                self.clients.push(Client {
                    stream,
                    received: Vec::new(),
                    unsent: Vec::new(),
                    ended: false,
                });
            }
        }
        for client in &mut self.clients {
            client.listen();
            while let Some(line) = client.line() {
                let answer = match line {
                    Some(line) => answer(&line)?,
                    None => {
                        client.ended = true;
                        "ERR the line is too long; send one command on each".into()
                    }
                };
                client.unsent.extend(answer.bytes().chain(*b"\n"));
            }
            client.speak();
        }
        let wanted = |c: &Client| c.unsent.len() < UNREAD && !(c.ended && c.unsent.is_empty());
        self.clients.retain(wanted);
        Ok(())
    }
}

impl Client {
    /// Reads what has arrived, up to the limit of one poll.
    fn listen(&mut self) {
        let mut some = [0; LONGEST];
        if self.ended {
            return;
        }
        match self.stream.read(&mut some) {
            Ok(0) => {
                self.ended = true;
                // An unterminated last line counts too.
                if !self.received.is_empty() {
                    self.received.push(b'\n');
                }
            }
            Ok(count) => self.received.extend(&some[..count]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => {
                self.ended = true;
                self.received.clear();
                self.unsent.clear();
            }
        }
    }

    /// The next line without its end; the inner value is `None` if the line is too long.
    fn line(&mut self) -> Option<Option<String>> {
        match self.received.iter().position(|&byte| byte == b'\n') {
            Some(end) => {
                let line: Vec<u8> = self.received.drain(..=end).collect();
                Some(Some(String::from_utf8_lossy(&line).trim().to_owned()))
            }
            None if self.received.len() > LONGEST => {
                self.received.clear();
                Some(None)
            }
            None => None,
        }
    }

    fn speak(&mut self) {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(0) => break,
                Ok(count) => drop(self.unsent.drain(..count)),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                    break;
                }
                Err(_) => {
                    self.ended = true;
                    self.unsent.clear();
                }
            }
        }
    }
}
