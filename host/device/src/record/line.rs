//! Handles a line that is lost during a recording and comes back.

use std::time::{Duration, Instant};

use mimu_recording::error::{Error, Result};

use crate::port::ports;
use crate::received::LineCount;
use crate::session::Session;

/// Interval of the search for the port.
const PAUSE: Duration = Duration::from_millis(100);

/// Counts of the line since the recording began, over all sessions.
#[derive(Debug, Default)]
pub(super) struct LineTotals {
    /// Counts of earlier sessions.
    earlier: LineCount,
    /// Counts of this session before the recording.
    before: LineCount,
}

impl From<LineCount> for LineTotals {
    fn from(before: LineCount) -> Self {
        Self {
            earlier: LineCount::default(),
            before,
        }
    }
}

impl LineTotals {
    /// Total counts; `count` is the present session's.
    pub fn total(&self, count: LineCount) -> LineCount {
        self.earlier.and(&count.since(&self.before))
    }

    /// Starts a new session: the lost one ends with `count`, and the new one has received `before` so far.
    pub fn lost(&mut self, count: LineCount, before: LineCount) {
        self.earlier = self.total(count);
        self.before = before;
    }
}

/// Waits until the unit answers again at the port of the lost session or at another one. Ends when `go_on` returns false (`None`) or the time is
/// over; `lost` is the error that ended the session.
pub(super) fn wait_for(
    port: &str,
    unit_id: &str,
    patience: Duration,
    lost: &Error,
    mut go_on: impl FnMut() -> bool,
) -> Result<Option<Session>> {
    let until = Instant::now() + patience;
    let mut foreign = None;
    while Instant::now() < until {
        if !go_on() {
            return Ok(None);
        }
        std::thread::sleep(PAUSE);
        // A board that is plugged in again may get another name.
        let others = ports().of_boards.into_iter().filter(|name| name != port);
        for name in std::iter::once(port.to_owned()).chain(others) {
            match Session::open(Some(&name)) {
                Ok(session) if session.who().unit_id == unit_id => return Ok(Some(session)),
                Ok(session) if name == port => foreign = Some(session.who().unit_id.clone()),
                _ => {}
            }
        }
    }
    let waited = patience.as_secs_f64();
    Err(lost.clone().map(|e| {
        e.problem += &match &foreign {
            Some(other) => format!(", and another device is at the port now ({other})"),
            None if patience.is_zero() => String::new(),
            None => format!(", and has not come back within {waited} s"),
        };
    }))
}
