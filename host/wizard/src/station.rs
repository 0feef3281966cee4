//! A unit and its line. For a port, a separate thread receives the data, and reopens the port if it has vanished.

use std::pin::Pin;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use mimu_device::Session;
use mimu_recording::error::{Argument, Error, Result};

use crate::source::{Opener, Source, SourceEvent, Unit};

/// Interval between attempts to reopen a port.
const AGAIN: Duration = Duration::from_millis(300);

/// A task for the session of a mimu device, if there is one.
pub type Errand = Box<dyn FnOnce(&mut Option<Box<dyn Source>>) + Send>;

/// The line to a unit. Its functions never wait.
pub trait Line {
    /// The next event; `None` if there is none.
    fn news(&mut self) -> Result<Option<SourceEvent>>;

    /// Passes a task to the device's thread; `false` if there is none.
    fn errand(&self, _: Errand) -> bool {
        false
    }
}

/// A station being opened.
pub type Connecting = Pin<Box<dyn Future<Output = Result<Station>>>>;

/// Connects a session with a unit. Arguments: the first tick that it may use, and the id of the required unit, if any.
pub type Connect = Box<dyn FnOnce(u64, Option<String>) -> Connecting>;

/// Connects a session with a unit at a port, and starts a thread for that port.
pub fn at_port(opener: Opener) -> Connect {
    Box::new(|next, wanted| {
        let opened = Station::open(opener, next, wanted.as_deref());
        Box::pin(std::future::ready(opened))
    })
}

/// A unit and its line.
pub struct Station {
    /// The unit.
    pub unit: Unit,
    line: Box<dyn Line>,
}

/// A port and its thread.
struct Threaded {
    news: Receiver<SourceEvent>,
    errands: Option<Sender<Errand>>,
    thread: Option<JoinHandle<()>>,
}

impl Line for Threaded {
    fn news(&mut self) -> Result<Option<SourceEvent>> {
        match self.news.try_recv() {
            Ok(news) => Ok(Some(news)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(broken()),
        }
    }

    fn errand(&self, errand: Errand) -> bool {
        self.errands
            .as_ref()
            .is_some_and(|e| e.send(errand).is_ok())
    }
}

impl Station {
    /// The station of a unit that was identified on this line.
    pub fn over(unit: Unit, line: Box<dyn Line>) -> Self {
        Self { unit, line }
    }

    /// Opens a port. `next`: the first tick that it may use. `wanted`: id of the required unit.
    fn open(mut opener: Opener, next: u64, wanted: Option<&str>) -> Result<Self> {
        let source = opener(next)?;
        let unit = source.unit().clone();
        if let Some(wanted) = wanted.filter(|w| *w != unit.id) {
            return Err(other(&unit.id, wanted));
        }
        let (tell, news) = channel();
        let (errands, to_do) = channel();
        let id = unit.id.clone();
        let run = move || listen(source, &mut opener, &id, next, &tell, &to_do);
        let thread = std::thread::Builder::new()
            .name("station".into())
            .spawn(run)
            .map_err(|e| Error::new("station", e, "close other programs"))?;
        let line = Threaded {
            news,
            errands: Some(errands),
            thread: Some(thread),
        };
        Ok(Self::over(unit, Box::new(line)))
    }

    /// The next event; `None` if there is none.
    pub fn news(&mut self) -> Result<Option<SourceEvent>> {
        let news = self.line.news()?;
        if let Some(SourceEvent::Back(unit)) = &news {
            self.unit = (**unit).clone();
        }
        Ok(news)
    }

    /// Runs a task with the session. The samples meanwhile are lost. Fails if there is no device, or if it is gone.
    pub fn with<T: Send + 'static>(
        &self,
        errand: impl FnOnce(&mut Session) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (back, answer) = channel();
        let errand: Errand = Box::new(move |source| {
            let done = match source.as_mut().and_then(|s| s.device()) {
                Some(session) => errand(session),
                None => Err(Error::device(
                    "device",
                    "the line to the device is lost, or it is not a mimu device",
                    "plug it in again and run the same command: the session resumes",
                )),
            };
            let _ = back.send(done);
        });
        match self.line.errand(errand).then(|| answer.recv()) {
            Some(Ok(done)) => done,
            _ => Err(broken()),
        }
    }
}

impl Drop for Threaded {
    fn drop(&mut self) {
        self.errands = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn broken() -> Error {
    Error::new(
        "station",
        "the thread that listens has ended",
        "report this",
    )
}

/// Error if another unit than the required one is at the port.
pub(crate) fn other(found: &str, wanted: &str) -> Error {
    Error::device(
        "port",
        format!("unit {found} is at the port, but the session belongs to unit {wanted}"),
        format!("plug unit {wanted} in, or start another session in another folder"),
    )
    .about(Argument::Output)
}

fn listen(
    source: Box<dyn Source>,
    opener: &mut Opener,
    id: &str,
    mut next: u64,
    tell: &Sender<SourceEvent>,
    to_do: &Receiver<Errand>,
) {
    let mut source = Some(source);
    let mut told_other = String::new();
    loop {
        match to_do.try_recv() {
            Ok(errand) => {
                errand(&mut source);
                continue;
            }
            Err(TryRecvError::Disconnected) => return,
            Err(TryRecvError::Empty) => {}
        }
        let news = match &mut source {
            Some(open) => match open.next() {
                Ok(SourceEvent::Nothing) => continue,
                Ok(event) => event,
                Err(error) => {
                    source = None;
                    SourceEvent::Lost(error)
                }
            },
            None => match opener(next) {
                Ok(open) if open.unit().id == id => {
                    let unit = open.unit().clone();
                    source = Some(open);
                    told_other.clear();
                    SourceEvent::Back(Box::new(unit))
                }
                Ok(open) => {
                    let found = open.unit().id.clone();
                    drop(open);
                    std::thread::sleep(AGAIN);
                    if told_other == found {
                        continue;
                    }
                    told_other.clone_from(&found);
                    SourceEvent::Other(other(&found, id))
                }
                Err(_) => {
                    std::thread::sleep(AGAIN);
                    continue;
                }
            },
        };
        if let SourceEvent::Samples(chunk) = &news {
            next = chunk.end();
        }
        if tell.send(news).is_err() {
            return;
        }
    }
}
