//! The port of a board that writes lines of text, read by a thread that waits for bytes.

use std::io::{ErrorKind, Read};
use std::time::{Duration, Instant};

use mimu_device::serial_pair;
use mimu_recording::error::{Error, Result};

use crate::source::{Source, SourceEvent, Unit};
use crate::text::{NOTHING_S, Text, TextBoard};

/// Longest wait of a read. All bytes of a read get the same time of arrival.
const POLL: Duration = Duration::from_millis(5);

/// Opens a board, and reopens it after it was lost. The rate found first is kept, because it defines the time.
#[derive(Debug, Clone)]
pub struct TextOpener {
    text: Text,
    rate_hz: Option<f64>,
    patience_s: f64,
}

impl TextOpener {
    /// For a board. `rate_hz`: rate of the resumed session, if any.
    pub fn new(text: Text, rate_hz: Option<f64>) -> Self {
        Self {
            text,
            rate_hz,
            patience_s: NOTHING_S,
        }
    }

    /// Opens it, and waits until its rate is known. `next`: the first tick that it may use.
    ///
    /// Errors: the port does not open, or within 5 s no line matches the description.
    pub fn open(&mut self, next: u64) -> Result<TextSource> {
        let board = TextBoard::new(&self.text, self.rate_hz, next, 0.0);
        let mut source = TextSource {
            input: serial_pair(&self.text.port, self.text.baud, POLL)?.0,
            port: self.text.port.clone(),
            began: Instant::now(),
            board: board.with_patience(self.patience_s),
        };
        while !source.board.is_open(source.now_s())? {
            source.read()?;
        }
        self.rate_hz = Some(source.board.unit().rate_hz);
        Ok(source)
    }
}

/// Source of a board that writes lines.
pub struct TextSource {
    input: Box<dyn Read + Send>,
    port: String,
    began: Instant,
    board: TextBoard,
}

impl TextSource {
    fn now_s(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn read(&mut self) -> Result<()> {
        let mut bytes = [0; 4096];
        let count = match self.input.read(&mut bytes) {
            // A port that was unplugged, or a peer that closed the connection, reports end of file.
            Ok(0) => return Err(self.gone()),
            Ok(count) => count,
            Err(e) => match e.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => 0,
                _ => return Err(self.gone()),
            },
        };
        self.board.take(&bytes[..count], self.now_s());
        Ok(())
    }

    fn gone(&self) -> Error {
        Error::device(
            &self.port,
            "the port has vanished",
            "check the cable and the board",
        )
    }
}

impl Source for TextSource {
    fn unit(&self) -> &Unit {
        self.board.unit()
    }

    fn next(&mut self) -> Result<SourceEvent> {
        if let Some(heard) = self.board.ready() {
            return Ok(heard);
        }
        self.read()?;
        self.board.next(self.now_s())
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::io::Write as _;
    use std::net::TcpListener;

    use mimu::signal::increment::pause_periods;
    use mimu_recording::RawUnit;

    use super::*;
    use crate::text_line::Columns;

    fn board(columns: &str, writes: Vec<String>, stays: Duration) -> TextOpener {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp://{}", listener.local_addr().unwrap());
        // Writes the texts one after the other, and closes each connection after this time.
        std::thread::spawn(move || {
            for text in writes {
                let mut line = listener.accept().unwrap().0;
                let _ = line.write_all(text.as_bytes());
                std::thread::sleep(stays);
            }
        });
        let text = Text {
            port,
            baud: 115_200,
            columns: Columns::parse(columns).unwrap(),
            raw_unit: RawUnit::Count,
            name: None,
            clock_trusted: true,
        };
        TextOpener {
            patience_s: 60.0,
            ..TextOpener::new(text, None)
        }
    }

    /// Lines with a clock, whose readings are their numbers; `odd` replaces some of them.
    fn numbered(rate_hz: f64, count: usize, odd: impl Fn(usize) -> Option<String>) -> String {
        let mut text = String::from("cut\n");
        for k in 0..count {
            let t_us = (1e6 * k as f64 / rate_hz).round();
            match odd(k) {
                None => writeln!(text, "{t_us},{k},0,4096,1,2,3").unwrap(),
                Some(other) => text.push_str(&other),
            }
        }
        text
    }

    /// All samples (tick and number) until the line is lost, and all notes.
    fn all(source: &mut TextSource) -> (Vec<(u64, usize)>, Vec<String>) {
        let (mut samples, mut notes) = (Vec::new(), Vec::new());
        while let Ok(heard) = source.next() {
            match heard {
                SourceEvent::Samples(chunk) => {
                    let numbered = (chunk.tick..).zip(&chunk.values);
                    samples.extend(numbered.map(|(tick, v)| (tick, v[3] as usize)));
                }
                SourceEvent::Restarted(words) | SourceEvent::Note(words) => notes.push(words),
                _ => {}
            }
        }
        (samples, notes)
    }

    const CLOCKED: &str = "t_us,ax,ay,az,gx,gy,gz";

    #[test]
    fn lines_that_are_lost_or_garbled_are_missing_ticks_and_are_counted() {
        let odd = |k: usize| match k {
            300 => Some(String::new()),
            400 => Some("4000000,4\u{fffd}\n".into()),
            k if (500..540).contains(&k) => Some("#\n".into()),
            _ => None,
        };
        let mut opener = board(CLOCKED, vec![numbered(100.0, 1000, odd)], Duration::ZERO);
        let mut source = opener.open(50).unwrap();
        assert!((source.unit().rate_hz - 100.0).abs() < 1e-6);
        let (samples, notes) = all(&mut source);
        assert_eq!(samples[0], (51, 0));
        assert!(samples.iter().all(|(tick, k)| *tick == 51 + *k as u64));
        let numbers: Vec<usize> = samples.iter().map(|s| s.1).collect();
        let whole = (0..numbers.len() + 42).filter(|k| odd(*k).is_none());
        assert_eq!(numbers, whole.collect::<Vec<_>>());
        let told = [source.unit().told.clone(), notes].concat().join("; ");
        assert!(told.contains("are not data"), "{told}");
        assert_eq!(source.board.refused(), 41);
    }

    #[test]
    fn a_port_that_comes_back_goes_on_behind_the_last_sample_at_the_same_rate() {
        let first = numbered(250.0, 2000, |_| None);
        // By itself, the second connection would find another rate.
        let second = numbered(251.0, 2000, |_| None);
        let mut opener = board(CLOCKED, vec![first, second], Duration::ZERO);
        let mut source = opener.open(0).unwrap();
        let (samples, _) = all(&mut source);
        let next = samples.last().unwrap().0 + 1;
        let mut again = opener.open(next).unwrap();
        assert_eq!(again.unit().rate_hz, source.unit().rate_hz);
        let (samples, _) = all(&mut again);
        // No turn is integrated across the time without a port.
        assert_eq!(samples[0], (next + pause_periods(250.0), 0));
        assert!(samples.windows(2).all(|p| p[1].0 > p[0].0));
    }

    #[test]
    fn a_board_that_restarts_is_told_of_and_its_ticks_never_go_back() {
        let text = numbered(100.0, 1200, |_| None).repeat(2);
        let mut source = board(CLOCKED, vec![text], Duration::ZERO).open(0).unwrap();
        let (samples, notes) = all(&mut source);
        assert_eq!(notes, ["its clock has gone back"]);
        assert!(samples.windows(2).all(|p| p[1].0 > p[0].0));
        assert!(samples.len() > 2300, "{}", samples.len());
    }

    /// A board that writes a hundred lines a second, for three seconds.
    fn paced(columns: &str, unit_s: f64) -> Result<TextSource> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp://{}", listener.local_addr().unwrap());
        std::thread::spawn(move || {
            let mut line = listener.accept().unwrap().0;
            for k in 0..300 {
                // One of them is garbled.
                let t = if k == 1 {
                    9e9
                } else {
                    (0.01 * f64::from(k) / unit_s).round()
                };
                if writeln!(line, "{t},0,0,4096,1,2,3").is_err() {
                    return;
                }
                if k % 10 == 9 {
                    std::thread::sleep(Duration::from_millis(100));
                }
            }
        });
        let text = Text {
            port,
            baud: 115_200,
            columns: Columns::parse(columns).unwrap(),
            raw_unit: RawUnit::Count,
            name: None,
            clock_trusted: true,
        };
        TextOpener::new(text, None).open(0)
    }

    #[test]
    fn stamps_in_another_unit_are_refused_with_the_column_that_they_are() {
        for (names, unit_s, is) in [("t_ms", 1e-6, "t_us"), ("t_us", 1e-3, "t_ms")] {
            let error = paced(&CLOCKED.replace("t_us", names), unit_s)
                .err()
                .unwrap();
            let error = error.to_string();
            assert!(
                error.contains(&format!("as if its column were {is}")),
                "{error}"
            );
        }
    }

    #[test]
    fn where_nothing_fits_the_error_shows_the_first_lines() {
        let text = "cut\nMPU6050 OK\n1,2,3\n1,2,3\n1,2,3\n".to_string();
        let mut opener = board("ax,ay,az,gx,gy,gz", vec![text], Duration::from_secs(60));
        opener.patience_s = 5.0;
        let opened = opener.open(0);
        let error = opened.err().unwrap().to_string();
        let wanted = "no line within 5 s is 6 numbers, ax,ay,az,gx,gy,gz; the first are \"MPU6050 OK\", \"1,2,3\", \"1,2,3\"";
        assert!(error.contains(wanted), "{error}");
    }
}
