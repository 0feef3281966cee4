//! Writes lines of text into a pseudo-terminal, at a given pace.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::device::terminal::Terminal;

/// A board that writes until it is dropped or has no more lines.
pub struct Playback {
    path: String,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Playback {
    /// Writes so many lines per second, and waits if they are not read.
    pub fn begin(lines: Vec<String>, per_second: f64) -> Self {
        let (mut terminal, path) = Terminal::open();
        let end = Arc::new(AtomicBool::new(false));
        let ended = end.clone();
        let write = move || {
            let mut began = None;
            for (k, line) in (0..).zip(&lines) {
                // It writes nothing until a program has the port open.
                while began.is_none() && !ended.load(Ordering::Relaxed) {
                    if terminal.is_open() {
                        began = Some(Instant::now());
                    }
                    std::thread::sleep(Duration::from_millis(5));
                }
                let due = Duration::from_secs_f64(f64::from(k) / per_second);
                let early = began.map_or(due, |b| due.saturating_sub(b.elapsed()));
                if early > Duration::from_millis(2) {
                    std::thread::sleep(early);
                }
                let mut rest = line.as_bytes();
                while !rest.is_empty() {
                    if ended.load(Ordering::Relaxed) {
                        return;
                    }
                    rest = &rest[terminal.write(rest)..];
                }
            }
            while !ended.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(5));
            }
        };
        Self {
            path,
            end,
            thread: Some(std::thread::spawn(write)),
        }
    }

    /// The path that is opened like a serial port.
    pub fn path(&self) -> &str {
        &self.path
    }
}

impl Drop for Playback {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
