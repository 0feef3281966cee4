//! A line that is lost while a recording is made, and comes back.

use std::time::{Duration, Instant};

use mimu_recording::error::{Error, Result};

use crate::heard::LineCount;
use crate::port::ports;
use crate::session::Session;

/// Time between two looks for the port.
const PAUSE: Duration = Duration::from_millis(100);

/// What was heard on the line since the recording began, over all of its sessions.
#[derive(Debug, Default)]
pub(super) struct Heard {
    /// On lines before this one.
    earlier: LineCount,
    /// Heard on this one before it was recorded.
    before: LineCount,
}

impl From<LineCount> for Heard {
    fn from(before: LineCount) -> Self {
        Self {
            earlier: LineCount::default(),
            before,
        }
    }
}

impl Heard {
    /// All, if that on the present line is `count`.
    pub fn total(&self, count: LineCount) -> LineCount {
        self.earlier.and(&count.since(&self.before))
    }

    /// The line on which this was heard is gone; on the new one `before` was heard so far.
    pub fn lost(&mut self, count: LineCount, before: LineCount) {
        self.earlier = self.total(count);
        self.before = before;
    }
}

/// Waits for the port of a lost session, or another one at which the same unit is now, until `go_on` is false or the time is over. `None`:
/// it is not to go on. `lost` is the error that the session ended with.
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
        // Plugged in again, a board may be given another name.
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
