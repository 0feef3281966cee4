//! A unit at its port: a separate thread receives its data, and reopens the port when it has vanished.

use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use mimu_device::Session;
use mimu_recording::error::{Argument, Error, Result};

use crate::source::{Chunk, Heard, Opener, Source, Unit};

/// Time between two tries to open a port again.
const AGAIN: Duration = Duration::from_millis(300);

/// What a station has to say.
#[derive(Debug)]
pub enum StationEvent {
    /// Samples.
    Samples(Chunk),
    /// The device has restarted, and why.
    Restarted(String),
    /// Something that a person should know.
    Note(String),
    /// The line is lost, and why.
    Lost(Error),
    /// Another unit is at the port.
    Other(Error),
    /// The line is back.
    Back(Box<Unit>),
}

type Errand = Box<dyn FnOnce(&mut Option<Box<dyn Source>>) + Send>;

/// A unit at its port.
pub struct Station {
    /// Who it is.
    pub unit: Unit,
    news: Receiver<StationEvent>,
    errands: Option<Sender<Errand>>,
    thread: Option<JoinHandle<()>>,
}

impl Station {
    /// Opens it. `next`: the first tick that it may use. `wanted`: only a unit with this id.
    pub fn open(mut opener: Opener, next: u64, wanted: Option<&str>) -> Result<Self> {
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
        Ok(Self {
            unit,
            news,
            errands: Some(errands),
            thread: Some(thread),
        })
    }

    /// What has come; `None` if nothing has.
    pub fn news(&mut self) -> Result<Option<StationEvent>> {
        match self.news.try_recv() {
            Ok(StationEvent::Back(unit)) => {
                self.unit = (*unit).clone();
                Ok(Some(StationEvent::Back(unit)))
            }
            Ok(news) => Ok(Some(news)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(broken()),
        }
    }

    /// Does something with the session; what comes meanwhile is not samples. An error where there is no device, or it is gone.
    pub fn with<T: Send + 'static>(
        &self,
        errand: impl FnOnce(&mut Session) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        self.of(|source| source.device(), errand)
    }

    /// The same for short calls, by which no sample is lost.
    pub fn aside<T: Send + 'static>(
        &self,
        errand: impl FnOnce(&mut Session) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        self.of(|source| source.aside(), errand)
    }

    fn of<T: Send + 'static>(
        &self,
        session: impl FnOnce(&mut dyn Source) -> Option<&mut Session> + Send + 'static,
        errand: impl FnOnce(&mut Session) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        let (back, answer) = channel();
        let errand: Errand = Box::new(move |source| {
            let done = match source.as_mut().and_then(|s| session(s.as_mut())) {
                Some(session) => errand(session),
                None => Err(Error::device(
                    "device",
                    "the line to the device is lost, or it is not a mimu device",
                    "plug it in again and run the same command: the session resumes",
                )),
            };
            let _ = back.send(done);
        });
        let sent = self
            .errands
            .as_ref()
            .is_some_and(|e| e.send(errand).is_ok());
        match sent.then(|| answer.recv()) {
            Some(Ok(done)) => done,
            _ => Err(broken()),
        }
    }
}

impl Drop for Station {
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

/// Why a unit is not the one.
fn other(found: &str, wanted: &str) -> Error {
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
    tell: &Sender<StationEvent>,
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
                Ok(Heard::Nothing) => continue,
                Ok(Heard::Restarted(why)) => StationEvent::Restarted(why),
                Ok(Heard::Note(words)) => StationEvent::Note(words),
                Ok(Heard::Samples(chunk)) => {
                    next = chunk.tick + chunk.values.len() as u64;
                    StationEvent::Samples(chunk)
                }
                Err(error) => {
                    source = None;
                    StationEvent::Lost(error)
                }
            },
            None => match opener(next) {
                Ok(open) if open.unit().id == id => {
                    let unit = open.unit().clone();
                    source = Some(open);
                    told_other.clear();
                    StationEvent::Back(Box::new(unit))
                }
                Ok(open) => {
                    let found = open.unit().id.clone();
                    drop(open);
                    std::thread::sleep(AGAIN);
                    if told_other == found {
                        continue;
                    }
                    told_other.clone_from(&found);
                    StationEvent::Other(other(&found, id))
                }
                Err(_) => {
                    std::thread::sleep(AGAIN);
                    continue;
                }
            },
        };
        if tell.send(news).is_err() {
            return;
        }
    }
}
