//! The device's sample numbers as ticks that never go back.

use std::time::Duration;

use crate::who::Started;

/// Ticks of one sample period since the device began to sample: 64 bits, where its own numbers begin anew after 49 days; and over a
/// restart, where they begin anew too.
#[derive(Debug)]
pub(super) struct Clock {
    rate_hz: f64,
    /// Tick and number of the sample that comes next if none is lost.
    next: Option<(u64, u32)>,
    restarted: Option<Option<Started>>,
}

/// Where a batch has arrived.
#[derive(Debug, PartialEq)]
pub(super) struct Arrival {
    /// Of its first sample.
    pub tick: u64,
    /// Samples that are missing before it.
    pub missing: u64,
    /// It is the first after a restart; why that was, if the device has said so.
    pub restart: Option<Option<Started>>,
}

impl Clock {
    pub fn new(rate_hz: u32) -> Self {
        Self {
            rate_hz: f64::from(rate_hz),
            next: None,
            restarted: None,
        }
    }

    /// The device has greeted: what comes next counts anew.
    pub fn restarted(&mut self, start: Option<Started>) {
        // A greeting before the first sample breaks nothing.
        if self.next.is_some() {
            self.restarted = Some(start);
        }
    }

    /// A batch that begins with this number has arrived, so long after the one before.
    pub fn arrive(&mut self, number: u32, silence: Duration) -> Arrival {
        let Some((next, expected)) = self.next else {
            self.next = Some((u64::from(number), number));
            let tick = u64::from(number);
            return Arrival {
                tick,
                missing: 0,
                restart: None,
            };
        };
        let ahead = number.wrapping_sub(expected);
        let back = ahead > u32::MAX / 2;
        let restart = match self.restarted.take() {
            None if back => Some(None),
            told => told,
        };
        let (tick, missing) = match restart {
            // Only the PC's clock knows how long it took. At least a tick, so that the gap is seen.
            Some(_) => (
                next + ((silence.as_secs_f64() * self.rate_hz) as u64).max(1),
                0,
            ),
            None => (next + u64::from(ahead), u64::from(ahead)),
        };
        self.next = Some((tick, number));
        Arrival {
            tick,
            missing,
            restart,
        }
    }

    /// So many samples have been there since the arrival.
    pub fn passed(&mut self, samples: usize) {
        if let Some((tick, number)) = &mut self.next {
            *tick += samples as u64;
            *number = number.wrapping_add(samples as u32);
        }
    }

    /// Tick of the sample that comes next.
    pub fn next(&self) -> u64 {
        self.next.map_or(0, |(tick, _)| tick)
    }

    /// So many ticks.
    pub fn length(&self, ticks: u64) -> Duration {
        let rate_hz = (self.rate_hz as u128).max(1);
        let nanoseconds = u128::from(ticks) * 1_000_000_000 / rate_hz;
        Duration::from_nanos(u64::try_from(nanoseconds).unwrap_or(u64::MAX))
    }

    /// A tick in seconds, to the last bit the nearest number to n/rate.
    pub fn seconds(&self, tick: u64) -> f64 {
        tick as f64 / self.rate_hz
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT_ONCE: Duration = Duration::ZERO;

    #[test]
    fn a_missing_batch_is_a_gap_and_moves_nothing_after_it() {
        let mut clock = Clock::new(1000);
        assert_eq!(clock.arrive(500, AT_ONCE).tick, 500);
        clock.passed(20);
        assert_eq!(clock.arrive(520, AT_ONCE).missing, 0);
        clock.passed(20);
        let arrival = clock.arrive(580, AT_ONCE);
        assert_eq!(
            (arrival.tick, arrival.missing, arrival.restart),
            (580, 40, None)
        );
        assert_eq!(clock.seconds(580), 0.58);
    }

    #[test]
    fn numbers_that_begin_anew_after_49_days_go_on() {
        let mut clock = Clock::new(1000);
        clock.arrive(u32::MAX - 9, AT_ONCE);
        clock.passed(20);
        let arrival = clock.arrive(10, AT_ONCE);
        assert_eq!((arrival.tick, arrival.missing), ((1 << 32) + 10, 0));
    }

    #[test]
    fn a_restart_is_a_gap_of_the_time_that_passed_here() {
        let mut clock = Clock::new(1000);
        clock.arrive(5000, AT_ONCE);
        clock.passed(20);
        clock.restarted(Some(Started::Watchdog));
        let arrival = clock.arrive(40, Duration::from_millis(700));
        assert_eq!(arrival.tick, 5720);
        assert_eq!(arrival.restart, Some(Some(Started::Watchdog)));
        clock.passed(20);
        assert_eq!(clock.arrive(60, AT_ONCE).tick, 5740);
        // The greeting was lost; the numbers tell.
        let arrival = clock.arrive(20, AT_ONCE);
        assert_eq!((arrival.restart, arrival.missing), (Some(None), 0));
    }
}
