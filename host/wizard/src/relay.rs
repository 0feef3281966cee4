//! A board of another maker at a port that the caller reads, such as a web page. The caller relays the bytes with their times of arrival. This module
//! never waits or starts a thread.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, TryRecvError};

use mimu_recording::error::{Error, Result};

use crate::source::SourceEvent;
use crate::station::{Connect, Line, Station, other};
use crate::text::{Text, TextBoard};
use crate::turn::pause;

/// Bytes or an event of the port.
#[derive(Debug, Clone, PartialEq)]
pub enum Arrival {
    /// The port was opened.
    Opened,
    /// Bytes were received.
    Bytes(Vec<u8>),
    /// The port was closed or has vanished, and why.
    Lost(String),
    /// Only time has passed.
    Nothing,
}

/// An arrival with its time, s.
pub type Stamped = (f64, Arrival);

/// Connects the session with a board whose arrivals are sent to `arrivals`. `rate_hz`: rate of the resumed session, if any.
pub fn relayed(text: Text, rate_hz: Option<f64>, arrivals: Receiver<Stamped>) -> Connect {
    Box::new(move |next, wanted| {
        let mut line = RelayedText {
            text,
            rate_hz,
            next,
            arrivals,
            board: None,
            greeted: false,
            ready: VecDeque::new(),
            told: None,
        };
        Box::pin(async move {
            loop {
                match line.news()? {
                    Some(SourceEvent::Back(unit)) => {
                        if let Some(wanted) = wanted.filter(|w| *w != unit.id) {
                            return Err(other(&unit.id, &wanted));
                        }
                        return Ok(Station::over(*unit, Box::new(line)));
                    }
                    Some(SourceEvent::Lost(why)) => return Err(why),
                    Some(_) => {}
                    None => pause().await,
                }
            }
        })
    })
}

/// Turns relayed lines into events of a station.
struct RelayedText {
    text: Text,
    rate_hz: Option<f64>,
    next: u64,
    arrivals: Receiver<Stamped>,
    /// `None` while the port is closed or silent.
    board: Option<TextBoard>,
    /// Whether the present board's greeting was reported.
    greeted: bool,
    ready: VecDeque<SourceEvent>,
    /// Why the line is lost; reported once.
    told: Option<String>,
}

impl Line for RelayedText {
    fn news(&mut self) -> Result<Option<SourceEvent>> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Ok(Some(event));
            }
            match self.arrivals.try_recv() {
                Ok((at_s, what)) => self.take(at_s, what),
                Err(TryRecvError::Empty) => return Ok(None),
                Err(TryRecvError::Disconnected) => {
                    let problem = "nobody relays what the board writes any more";
                    return Err(Error::device(&self.text.port, problem, "report this"));
                }
            }
        }
    }
}

impl RelayedText {
    fn take(&mut self, at_s: f64, what: Arrival) {
        let bytes = match what {
            Arrival::Lost(why) => {
                let remedy =
                    "check the cable, plug the board in, and connect it again: the session goes on";
                return self.lost(Error::device(&self.text.port, why, remedy));
            }
            Arrival::Opened => return self.open(at_s),
            // A board that was silent sends again.
            Arrival::Bytes(bytes) => {
                if self.board.is_none() {
                    self.open(at_s);
                }
                bytes
            }
            Arrival::Nothing => Vec::new(),
        };
        let Some(board) = &mut self.board else {
            return;
        };
        board.take(&bytes, at_s);
        if let Err(why) = self.listen(at_s) {
            self.lost(why);
        }
    }

    fn open(&mut self, at_s: f64) {
        self.greeted = false;
        self.board = Some(TextBoard::new(&self.text, self.rate_hz, self.next, at_s));
    }

    /// Processes what the board has sent.
    fn listen(&mut self, at_s: f64) -> Result<()> {
        let Some(board) = &mut self.board else {
            return Ok(());
        };
        if !board.is_open(at_s)? {
            return Ok(());
        }
        if !self.greeted {
            let unit = board.unit().clone();
            (self.greeted, self.told) = (true, None);
            self.rate_hz = Some(unit.rate_hz);
            self.ready.push_back(SourceEvent::Back(Box::new(unit)));
        }
        loop {
            match board.next(at_s)? {
                SourceEvent::Nothing => return Ok(()),
                event => {
                    if let SourceEvent::Samples(chunk) = &event {
                        self.next = chunk.end();
                    }
                    self.ready.push_back(event);
                }
            }
        }
    }

    fn lost(&mut self, why: Error) {
        self.board = None;
        let words = why.to_string();
        // A port with the wrong baud rate causes the same error every five seconds.
        if self.told.as_ref() != Some(&words) {
            self.told = Some(words);
            self.ready.push_back(SourceEvent::Lost(why));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Sender, channel};

    use mimu_recording::RawUnit;

    use super::*;
    use crate::text_line::Columns;
    use crate::turn::go_on;

    fn text(columns: &str) -> Text {
        Text {
            port: "USB".into(),
            baud: 115_200,
            columns: Columns::parse(columns).unwrap(),
            raw_unit: RawUnit::Count,
            name: Some("board".into()),
            clock_trusted: false,
        }
    }

    /// Lines `from..to` of a board that writes 100 per second by its own clock, each stamped when it was written.
    fn speak(to: &Sender<Stamped>, from: u32, until: u32) {
        for k in from..until {
            let line = format!("{},{k},0,4096,1,2,3\n", 10_000 * k);
            let at_s = 0.01 * f64::from(k);
            to.send((at_s, Arrival::Bytes(line.into_bytes()))).unwrap();
        }
    }

    /// All present events of a station, and its samples with ticks and numbers.
    fn all(station: &mut Station) -> (Vec<String>, Vec<(u64, f64)>) {
        let (mut said, mut samples) = (Vec::new(), Vec::new());
        while let Some(event) = station.news().unwrap() {
            match event {
                SourceEvent::Samples(chunk) => {
                    samples.extend((chunk.tick..).zip(chunk.values.iter().map(|v| v[3])));
                }
                SourceEvent::Lost(why) => said.push(why.to_string()),
                SourceEvent::Back(unit) => said.push(format!("{} is back", unit.name)),
                other => said.push(format!("{other:?}")),
            }
        }
        (said, samples)
    }

    #[test]
    fn a_board_is_open_once_its_rate_is_known_and_a_port_that_was_lost_goes_on_behind() {
        let (send, arrivals) = channel();
        let mut opening = relayed(text("t_us,ax,ay,az,gx,gy,gz"), None, arrivals)(50, None);
        send.send((0.0, Arrival::Opened)).unwrap();
        speak(&send, 0, 300);
        assert!(go_on(opening.as_mut()).is_none());
        speak(&send, 300, 600);
        let mut station = go_on(opening.as_mut()).unwrap().unwrap();
        assert!((station.unit.rate_hz - 100.0).abs() < 1e-6);
        let (_, first) = all(&mut station);
        // The first line may be incomplete, and is never used.
        assert_eq!(first[0], (51, 1.0));
        send.send((6.0, Arrival::Lost("the port has vanished".into())))
            .unwrap();
        let (said, none) = all(&mut station);
        assert!(
            none.is_empty() && said[0].starts_with("USB: the port has vanished; check the cable"),
            "{said:?}"
        );
        send.send((20.0, Arrival::Opened)).unwrap();
        speak(&send, 2000, 2100);
        let (said, second) = all(&mut station);
        assert_eq!(said, ["board is back"]);
        assert!(second[0].0 > first[first.len() - 1].0 + 1);
        assert!(
            second
                .windows(2)
                .all(|p| p[1].0 == p[0].0 + 1 && p[1].1 == p[0].1 + 1.0)
        );
    }

    #[test]
    fn silence_is_told_once_and_a_board_that_speaks_again_is_back_by_itself() {
        let (send, arrivals) = channel();
        let mut opening = relayed(text("t_us,ax,ay,az,gx,gy,gz"), None, arrivals)(0, None);
        speak(&send, 0, 600);
        let mut station = go_on(opening.as_mut()).unwrap().unwrap();
        all(&mut station);
        for k in 0..100 {
            send.send((6.0 + 0.2 * f64::from(k), Arrival::Nothing))
                .unwrap();
        }
        let (said, _) = all(&mut station);
        assert_eq!(said.len(), 1);
        assert!(
            said[0].contains("no line of numbers arrived for 5 s"),
            "{said:?}"
        );
        speak(&send, 2700, 2800);
        assert_eq!(all(&mut station).0, ["board is back"]);
    }

    #[test]
    fn a_line_that_is_garbage_is_refused_with_what_it_reads_like() {
        let (send, arrivals) = channel();
        let mut opening = relayed(text("ax,ay,az,gx,gy,gz"), None, arrivals)(0, None);
        for k in 0..70 {
            let garbage = b"\xf3\x00x~\n".to_vec();
            send.send((0.1 * f64::from(k), Arrival::Bytes(garbage)))
                .unwrap();
        }
        let error = go_on(opening.as_mut()).unwrap().err().unwrap().to_string();
        assert!(error.contains("no line within 5 s is 6 numbers"), "{error}");
        assert!(
            error.contains("give the board's bits per second"),
            "{error}"
        );
    }

    #[test]
    fn another_unit_is_refused() {
        let (send, arrivals) = channel();
        let connect = relayed(text("t_us,ax,ay,az,gx,gy,gz"), None, arrivals);
        let mut opening = connect(0, Some("plane-7".into()));
        speak(&send, 0, 600);
        let error = go_on(opening.as_mut()).unwrap().err().unwrap().to_string();
        assert!(
            error.contains("unit board is at the port, but the session belongs to unit plane-7"),
            "{error}"
        );
    }
}
