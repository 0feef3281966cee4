//! Whether a task that serves the host still makes progress.
//!
//! The watchdog is fed for samples, which come whatever the line does. A transmitter that waits for an interrupt that never comes would leave a device
//! that samples, is fed, and never answers. A task therefore counts what it begins and what it completes. Idle tasks have completed all that they began.

use core::sync::atomic::{AtomicU32, Ordering};

/// Work that a task was given, and work that it completed. Both wrap.
#[derive(Debug, Default)]
pub struct Progress {
    begun: AtomicU32,
    done: AtomicU32,
}

impl Progress {
    /// Nothing begun.
    pub const fn new() -> Self {
        Self {
            begun: AtomicU32::new(0),
            done: AtomicU32::new(0),
        }
    }

    /// A piece of work waits or is begun.
    pub fn begin(&self) {
        self.begun.fetch_add(1, Ordering::Relaxed);
    }

    /// One of those is complete.
    pub fn complete(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }
}

/// Looks at a [`Progress`] at regular times.
#[derive(Debug)]
pub struct Overseer {
    /// Rounds without progress that count as stuck.
    most: u32,
    done: u32,
    without: u32,
}

impl Overseer {
    /// Stuck is who completes nothing in `most` rounds although there is work.
    pub const fn new(most: u32) -> Self {
        Self {
            most,
            done: 0,
            without: 0,
        }
    }

    /// Call it once in each round.
    pub fn is_stuck(&mut self, progress: &Progress) -> bool {
        let done = progress.done.load(Ordering::Relaxed);
        let idle = progress.begun.load(Ordering::Relaxed) == done;
        self.without = match idle || done != self.done {
            true => 0,
            false => self.without.saturating_add(1),
        };
        self.done = done;
        self.without >= self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_waits_for_work_or_completes_some_is_not_stuck() {
        let (progress, mut overseer) = (Progress::new(), Overseer::new(3));
        assert!((0..10).all(|_| !overseer.is_stuck(&progress)));
        for _ in 0..10 {
            // One is always waiting, and one is completed in each round.
            progress.begin();
            progress.begin();
            progress.complete();
            assert!(!overseer.is_stuck(&progress));
            progress.complete();
        }
    }

    #[test]
    fn who_completes_nothing_in_three_rounds_is_stuck_until_he_does() {
        let (progress, mut overseer) = (Progress::new(), Overseer::new(3));
        progress.begin();
        let told = [(); 4].map(|()| overseer.is_stuck(&progress));
        assert_eq!(told, [false, false, true, true]);
        progress.complete();
        assert!(!overseer.is_stuck(&progress));
    }
}
