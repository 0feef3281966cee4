//! Boards at their ports, measured together. Each has a thread that reads its port all the time, so that no old sample enters a measurement.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use mimu_core::wire::Capabilities;
use mimu_device::{TestResult, self_test};
use mimu_recording::error::{Error, Result};
use mimu_wizard::source::{Opener, Source};

use crate::gather::{Samples, Take};

/// Time between two reports of progress.
const TICK: Duration = Duration::from_millis(100);

/// A board and its thread.
struct Board {
    commands: Sender<Take>,
    thread: Option<JoinHandle<()>>,
    /// Whether it still answers.
    alive: bool,
}

/// Boards at their ports.
pub struct Boards {
    boards: Vec<Board>,
    answers: Receiver<(usize, Result<Samples>)>,
}

impl Boards {
    /// Opens boards at ports with these names, each in a thread. A port that does not open shows in the first measurement.
    ///
    /// # Errors
    /// The system has no threads left.
    pub fn open(openers: Vec<(String, Opener)>) -> Result<Self> {
        let (tell, answers) = channel();
        let mut boards = Vec::new();
        for (k, (place, opener)) in openers.into_iter().enumerate() {
            let (commands, to_do) = channel();
            let tell = tell.clone();
            let thread = std::thread::Builder::new()
                .name(format!("board {}", k + 1))
                .spawn(move || work(k, &place, opener, &to_do, &tell))
                .map_err(|e| Error::new("station", e, "close other programs"))?;
            boards.push(Board {
                commands,
                thread: Some(thread),
                alive: true,
            });
        }
        Ok(Self { boards, answers })
    }

    /// Measures all boards that still answer; `done` gets the index and the samples of each as soon as it is complete, and `None` ten times a second
    /// meanwhile.
    pub fn take(&mut self, take: Take, mut done: impl FnMut(Option<(usize, Result<Samples>)>)) {
        let mut waiting = 0;
        for board in self.boards.iter_mut().filter(|board| board.alive) {
            board.alive = board.commands.send(take).is_ok();
            waiting += usize::from(board.alive);
        }
        // The channel is disconnected if every thread has ended; each has then told why.
        while waiting > 0 {
            match self.answers.recv_timeout(TICK) {
                Ok((k, samples)) => {
                    self.boards[k].alive &= samples.is_ok();
                    waiting -= 1;
                    done(Some((k, samples)));
                }
                Err(RecvTimeoutError::Timeout) => done(None),
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }
}

impl Drop for Boards {
    fn drop(&mut self) {
        for board in &mut self.boards {
            // The thread ends when its commands do.
            board.commands = channel().0;
            if let Some(thread) = board.thread.take() {
                let _ = thread.join();
            }
        }
    }
}

/// Opens board `k` and carries out commands; meanwhile its samples are read and dropped. After an error it answers the next command with it, and ends.
fn work(
    k: usize,
    place: &str,
    mut opener: Opener,
    to_do: &Receiver<Take>,
    tell: &Sender<(usize, Result<Samples>)>,
) {
    let fail = |error: Error| {
        if to_do.recv().is_ok() {
            let _ = tell.send((k, Err(error)));
        }
    };
    let opened = opener(0).and_then(|mut source| {
        let tested = test(source.as_mut())?;
        Ok((source, tested))
    });
    let (mut source, tested) = match opened {
        Ok(opened) => opened,
        Err(error) => return fail(error),
    };
    loop {
        match to_do.try_recv() {
            Ok(take) => {
                let samples =
                    Samples::of_source(source.as_mut(), place, take).map(|samples| Samples {
                        self_test: tested.clone(),
                        ..samples
                    });
                let failed = samples.is_err();
                if tell.send((k, samples)).is_err() || failed {
                    return;
                }
            }
            Err(TryRecvError::Disconnected) => return,
            Err(TryRecvError::Empty) => {
                if let Err(error) = source.next() {
                    return fail(error);
                }
            }
        }
    }
}

/// The board's own self-test, if it has one.
fn test(source: &mut dyn Source) -> Result<Vec<TestResult>> {
    let Some(session) = source.device() else {
        return Ok(Vec::new());
    };
    if !session.who().capabilities.contains(Capabilities::SELF_TEST) {
        return Ok(Vec::new());
    }
    let port = session.port().to_owned();
    let found = self_test(session)?;
    match found.moved {
        None => Ok(found.results),
        Some(moved) => Err(Error::device(
            port,
            format!("the unit moved during its self-test: {moved}"),
            "let it lie still, and measure again",
        )),
    }
}
