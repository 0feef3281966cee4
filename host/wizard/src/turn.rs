//! A session that never blocks: where it has to wait it pauses, and whoever drives it goes on with it when something may have come.
//!
//! What a session does is one story from the greeting to the last dwell, and it is written as one, as asynchronous functions. There is no
//! runtime. A command waits a little and goes on ([`complete`]); a page goes on when the board or the person has said something.

use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::{Duration, Instant};

/// Nothing has come: so long a command looks at nothing.
const IDLE: Duration = Duration::from_millis(4);

/// Pauses once: whoever drives the session goes on with it later.
pub async fn pause() {
    let mut paused = false;
    std::future::poll_fn(move |_| match std::mem::replace(&mut paused, true) {
        true => Poll::Ready(()),
        false => Poll::Pending,
    })
    .await;
}

/// Pauses for at least so long.
pub async fn rest(time: Duration) {
    let since = Instant::now();
    while since.elapsed() < time {
        pause().await;
    }
}

/// Goes on with a session until it pauses; what it has come to, if it has ended.
pub fn go_on<F: Future + ?Sized>(session: std::pin::Pin<&mut F>) -> Option<F::Output> {
    // Nobody is woken: the driver of the session knows when something has come.
    let mut context = Context::from_waker(Waker::noop());
    match session.poll(&mut context) {
        Poll::Ready(done) => Some(done),
        Poll::Pending => None,
    }
}

/// Drives a session to its end, and waits in this thread where it pauses.
pub fn complete<F: Future>(session: F) -> F::Output {
    let mut session = pin!(session);
    loop {
        match go_on(session.as_mut()) {
            Some(done) => return done,
            None => std::thread::sleep(IDLE),
        }
    }
}
