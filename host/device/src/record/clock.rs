//! Converts the device's sample numbers into ticks that never decrease.

use std::time::Duration;

use mimu::signal::increment::pause_periods;

use crate::identity::Started;

/// Counts ticks of one sample period since the device began to sample. Ticks have 64 bits: the device's numbers wrap after 49 days, and start again
/// from 0 after a restart.
#[derive(Debug)]
pub(super) struct Clock {
    rate_hz: f64,
    /// Tick and number of the next sample, if none is lost.
    next: Option<(u64, u32)>,
    restarted: Option<Option<Started>>,
    /// The line was lost and is back; the value is the reset cause that the device reports.
    reconnected: Option<Started>,
}

/// Silence allowed before the first batch after a reconnection, in addition to the time without a line, s.
const DELAY_S: f64 = 1.0;
/// Largest relative difference between the clocks of device and PC.
const DRIFT: f64 = 0.01;

/// Position of a received batch.
#[derive(Debug, PartialEq)]
pub(super) struct Arrival {
    /// Tick of its first sample.
    pub tick: u64,
    /// Samples missing before it.
    pub missing: u64,
    /// Set if it is the first batch after a restart; the reset cause, if the device reported it.
    pub restart: Option<Option<Started>>,
}

impl Clock {
    pub fn new(rate_hz: u32) -> Self {
        Self {
            rate_hz: f64::from(rate_hz),
            next: None,
            restarted: None,
            reconnected: None,
        }
    }

    /// The device has sent a greeting: its numbers start again.
    pub fn restarted(&mut self, start: Option<Started>) {
        // A greeting before the first sample interrupts nothing.
        if self.next.is_some() {
            self.restarted = Some(start);
        }
    }

    /// The line is back. Whether the device continued meanwhile follows from its next sample number.
    pub fn reconnected(&mut self, start: Started) {
        self.reconnected = Some(start);
    }

    /// Whether a device that begins a batch with this number has restarted while the line was lost. If it continued, its number is ahead by
    /// the elapsed time; if it restarted, its number is at most the elapsed time.
    fn began_anew(&self, number: u32, ahead: u32, silence: Duration) -> bool {
        let away = silence.as_secs_f64() * self.rate_hz;
        let room = DRIFT * away + DELAY_S * self.rate_hz;
        f64::from(number) <= away + room && (f64::from(ahead) - away).abs() > room
    }

    /// Places a batch that begins with this number, received `silence` after the previous one.
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
        let reconnected = self.reconnected.take();
        let anew = reconnected.is_some() && self.began_anew(number, ahead, silence);
        let restart = match self.restarted.take() {
            None if back || anew => Some(reconnected),
            told => told,
        };
        let (tick, missing) = match restart {
            // Only the PC's clock knows how long the restart took: at least so long that no turn is integrated across it.
            Some(_) => (
                next + ((silence.as_secs_f64() * self.rate_hz) as u64)
                    .max(pause_periods(self.rate_hz)),
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

    /// Advances by the samples of the batch.
    pub fn passed(&mut self, samples: usize) {
        if let Some((tick, number)) = &mut self.next {
            *tick += samples as u64;
            *number = number.wrapping_add(samples as u32);
        }
    }

    /// Tick of the next sample.
    pub fn next(&self) -> u64 {
        self.next.map_or(0, |(tick, _)| tick)
    }

    /// Duration of so many ticks.
    pub fn length(&self, ticks: u64) -> Duration {
        let rate_hz = (self.rate_hz as u128).max(1);
        let nanoseconds = u128::from(ticks) * 1_000_000_000 / rate_hz;
        Duration::from_nanos(u64::try_from(nanoseconds).unwrap_or(u64::MAX))
    }

    /// Time of a tick, s: the nearest floating-point number to n/rate.
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
    fn after_a_lost_line_the_device_s_own_clock_counts_unless_it_began_anew() {
        let away = Duration::from_secs(20);
        let arrival = |recorded: u32, number: u32| {
            let mut clock = Clock::new(1000);
            clock.arrive(0, AT_ONCE);
            clock.passed(recorded as usize);
            clock.reconnected(Started::PowerOn);
            let arrival = clock.arrive(number, away);
            (arrival.tick, arrival.missing, arrival.restart.is_some())
        };
        // The device continued for 20 s, 20.1 s by its own clock.
        assert_eq!(arrival(5_000, 25_100), (25_100, 20_100, false));
        // The device was without power, and has been on for 15 s. Its number exceeds the old one, but belongs to a new count.
        assert_eq!(arrival(5_000, 15_000), (25_000, 0, true));
        assert_eq!(arrival(60_000, 300), (80_000, 0, true));
        // The device's time stood still, as for an emulated device without a reader.
        assert_eq!(arrival(60_000, 60_040), (60_040, 40, false));
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
        // The greeting was lost, but the lower number shows the restart.
        let arrival = clock.arrive(20, AT_ONCE);
        assert_eq!((arrival.restart, arrival.missing), (Some(None), 0));
    }
}
