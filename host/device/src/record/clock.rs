//! Places the device's samples in the time of the recording, which never decreases.

use std::time::Duration;

use mimu::signal::increment::pause_periods;
use mimu_core::wire::BatchHead;

use crate::identity::Started;

/// Times of samples, ns since the device began to sample, by its crystal. After a restart the device's time starts again from 0, and its numbers wrap
/// after 49 days.
#[derive(Debug, Default)]
pub(super) struct Clock {
    /// What comes next, if no sample is lost.
    next: Option<Next>,
    /// What the device's time lacks since its last restart, ns.
    before_ns: u64,
    restarted: Option<Option<Started>>,
    /// The line was lost and is back; the value is the reset cause that the device reports.
    reconnected: Option<Started>,
    /// Sum of the periods of all samples, ns, and their number.
    periods_ns: f64,
    samples: u64,
}

/// The next sample, if none is lost.
#[derive(Debug, Clone, Copy)]
struct Next {
    ns: u64,
    number: u32,
}

/// Silence allowed before the first batch after a reconnection, in addition to the time without a line, s.
const DELAY_S: f64 = 1.0;
/// Largest relative difference between the clocks of device and PC.
const DRIFT: f64 = 0.01;

/// Position of a received batch.
#[derive(Debug, PartialEq)]
pub(super) struct Arrival {
    /// Time of its first sample, ns.
    pub ns: u64,
    /// Samples missing before it.
    pub missing: u64,
    /// Set if it is the first batch after a restart; the reset cause, if the device reported it.
    pub restart: Option<Option<Started>>,
}

impl Clock {
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

    /// Places a batch that was received `silence` after the previous one.
    pub fn arrive(&mut self, head: &BatchHead, silence: Duration) -> Arrival {
        let device_ns = head.tick_us.saturating_mul(1000);
        let Some(next) = self.next else {
            return Arrival {
                ns: device_ns,
                missing: 0,
                restart: None,
            };
        };
        let ahead = head.first.wrapping_sub(next.number);
        let back = ahead > u32::MAX / 2;
        let reconnected = self.reconnected.take();
        let anew = reconnected.is_some() && began_anew(head, ahead, silence);
        let restart = match self.restarted.take() {
            None if back || anew => Some(reconnected),
            told => told,
        };
        if restart.is_some() {
            // Only the PC's clock knows how long the restart took: at least so long that no turn is integrated across it.
            let rate_hz = head.rate_hz();
            let away_s = silence
                .as_secs_f64()
                .max(pause_periods(rate_hz) as f64 / rate_hz);
            let ns = next.ns + (away_s * 1e9) as u64;
            self.before_ns = ns.saturating_sub(device_ns);
        }
        Arrival {
            // The crystal's time of a sample that the device estimates anew with each batch may differ by microseconds: never by a period.
            ns: (self.before_ns + device_ns)
                .max(next.ns.saturating_sub(u64::from(head.period_ns) / 2)),
            missing: match restart {
                Some(_) => 0,
                None => u64::from(ahead),
            },
            restart,
        }
    }

    /// Advances by the samples of the batch, which were placed at `ns`.
    pub fn passed(&mut self, head: &BatchHead, ns: u64, samples: usize) {
        let count = samples as u64;
        self.samples += count;
        self.periods_ns += f64::from(head.period_ns) * count as f64;
        self.next = Some(Next {
            ns: ns + count * u64::from(head.period_ns),
            number: head.first.wrapping_add(samples as u32),
        });
    }

    /// Time of the next sample, ns.
    pub fn next_ns(&self) -> u64 {
        self.next.map_or(0, |next| next.ns)
    }

    /// Samples per second by the device's crystal; `None` before the first.
    pub fn rate_hz(&self) -> Option<f64> {
        (self.samples > 0).then(|| 1e9 * self.samples as f64 / self.periods_ns)
    }
}

/// Whether a device that begins this batch has restarted while the line was lost. If it continued, its number is ahead by the elapsed time; if it
/// restarted, its number is at most the elapsed time.
fn began_anew(head: &BatchHead, ahead: u32, silence: Duration) -> bool {
    let rate_hz = head.rate_hz();
    let away = silence.as_secs_f64() * rate_hz;
    let room = DRIFT * away + DELAY_S * rate_hz;
    f64::from(head.first) <= away + room && (f64::from(ahead) - away).abs() > room
}

/// Time in seconds: for a board whose samples are whole milliseconds apart, the nearest floating-point number.
pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT_ONCE: Duration = Duration::ZERO;
    const MS: u64 = 1_000_000;

    /// A batch of a board that samples every millisecond; its time did not wrap.
    fn head(number: u64) -> BatchHead {
        BatchHead {
            first: number as u32,
            tick_us: 1000 * number,
            period_ns: MS as u32,
            samples_lost: 0,
            batches_dropped: 0,
            temp_c: 25.0,
            flags: 0,
        }
    }

    /// Receives a batch of so many samples; time of its first, ms, missing samples, restart.
    fn receive(
        clock: &mut Clock,
        number: u64,
        samples: usize,
        silence: Duration,
    ) -> (u64, u64, Option<Option<Started>>) {
        let head = head(number);
        let arrival = clock.arrive(&head, silence);
        clock.passed(&head, arrival.ns, samples);
        assert_eq!(arrival.ns % MS, 0);
        (arrival.ns / MS, arrival.missing, arrival.restart)
    }

    #[test]
    fn a_missing_batch_is_a_gap_and_moves_nothing_after_it() {
        let mut clock = Clock::default();
        assert_eq!(receive(&mut clock, 500, 20, AT_ONCE), (500, 0, None));
        assert_eq!(receive(&mut clock, 520, 20, AT_ONCE), (520, 0, None));
        assert_eq!(receive(&mut clock, 580, 20, AT_ONCE), (580, 40, None));
        assert_eq!(seconds(580 * MS), 0.58);
        assert_eq!(clock.rate_hz(), Some(1000.0));
    }

    #[test]
    fn numbers_that_begin_anew_after_49_days_go_on() {
        let mut clock = Clock::default();
        let last = u64::from(u32::MAX) - 9;
        receive(&mut clock, last, 20, AT_ONCE);
        let after = (1 << 32) + 10;
        assert_eq!(receive(&mut clock, after, 20, AT_ONCE), (after, 0, None));
    }

    #[test]
    fn after_a_lost_line_the_device_s_own_clock_counts_unless_it_began_anew() {
        let away = Duration::from_secs(20);
        let arrival = |recorded: usize, number: u64| {
            let mut clock = Clock::default();
            receive(&mut clock, 0, recorded, AT_ONCE);
            clock.reconnected(Started::PowerOn);
            let (ms, missing, restart) = receive(&mut clock, number, 20, away);
            (ms, missing, restart.is_some())
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
        let mut clock = Clock::default();
        receive(&mut clock, 5000, 20, AT_ONCE);
        clock.restarted(Some(Started::Watchdog));
        let away = Duration::from_millis(700);
        let arrival = receive(&mut clock, 40, 20, away);
        assert_eq!(arrival, (5720, 0, Some(Some(Started::Watchdog))));
        assert_eq!(receive(&mut clock, 60, 20, AT_ONCE).0, 5740);
        // The greeting was lost, but the lower number shows the restart.
        let arrival = receive(&mut clock, 20, 20, AT_ONCE);
        assert_eq!((arrival.1, arrival.2), (0, Some(None)));
    }

    #[test]
    fn a_sensor_with_a_clock_of_its_own_is_placed_by_the_crystal() {
        let mut clock = Clock::default();
        let batch = |number: u32, tick_us| BatchHead {
            first: number,
            tick_us,
            period_ns: 1_030_000,
            ..head(0)
        };
        let first = batch(0, 5_000_000);
        let at = clock.arrive(&first, AT_ONCE);
        assert_eq!(at.ns, 5_000_000_000);
        clock.passed(&first, at.ns, 20);
        // Twenty periods later, and a microsecond by a new estimate of the line.
        let second = batch(20, 5_020_599);
        let at = clock.arrive(&second, AT_ONCE);
        assert_eq!((at.ns, at.missing), (5_020_599_000, 0));
        clock.passed(&second, at.ns, 20);
        assert!((clock.rate_hz().unwrap() - 1e3 / 1.03).abs() < 1e-9);
    }
}
