//! A session that never blocks: it pauses when it has to wait, and its driver resumes it when something may have arrived.
//!
//! A session is one sequence from the greeting to the last dwell, so it is written as one, in asynchronous functions, without a runtime. A command
//! waits a little and resumes ([`complete`]); a page resumes when the board or the user has sent something.

use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::{Duration, Instant};

/// Sleep of a command between two resumptions.
const IDLE: Duration = Duration::from_millis(4);

/// Pauses once, until the driver resumes the session.
pub async fn pause() {
    let mut paused = false;
    std::future::poll_fn(move |_| match std::mem::replace(&mut paused, true) {
        true => Poll::Ready(()),
        false => Poll::Pending,
    })
    .await;
}

/// Pauses for at least this time.
pub async fn rest(time: Duration) {
    let since = Instant::now();
    while since.elapsed() < time {
        pause().await;
    }
}

/// Resumes a session until it pauses. Returns its result if it has ended.
pub fn go_on<F: Future + ?Sized>(session: std::pin::Pin<&mut F>) -> Option<F::Output> {
    // No waker is needed: the driver knows when something has arrived.
    let mut context = Context::from_waker(Waker::noop());
    match session.poll(&mut context) {
        Poll::Ready(done) => Some(done),
        Poll::Pending => None,
    }
}

/// Drives a session to its end. This thread sleeps while the session pauses.
pub fn complete<F: Future>(session: F) -> F::Output {
    let mut session = pin!(session);
    loop {
        match go_on(session.as_mut()) {
            Some(done) => return done,
            None => std::thread::sleep(IDLE),
        }
    }
}
