//! Time of a sensor's samples by the crystal.
//!
//! A digital sensor samples by its own clock, which is off by up to some percent. A poll at the crystal's time T that finds sample n new
//! shows that n was taken at most one period before T: on average half a period. A line through these points is the sensor's clock in
//! units of the crystal's. The scatter of the points is uniform over a period, so the slope of a line over N polls is known to
//! sqrt(12) 0.29 / N^1.5: 28 ppm after a second of polls at 1 kHz, 1 ppm after ten.
//!
//! The line is fitted recursively: the gains are those of a least-squares line while it grows, and are held from [`MEMORY`] samples on, so
//! that it follows the drift of the sensor's clock with temperature.

/// Samples that the line remembers: ten seconds at 1 kHz. The clock of the sensor drifts with the temperature of its die over minutes; noise
/// of 1 ppm is a tenth of what calibrations resolve.
const MEMORY: f64 = 10_000.0;

/// Points that a line keeps over a gap: the rate stays, and the new phase is found within a second.
const RESUMED: f64 = 500.0;

/// Largest error of a sensor's clock, as a fraction of its rate. The data sheet of the ICM-42688-P allows 1 %; a rate beyond this is
/// another rate than the one that was set.
pub const LARGEST_ERROR: f64 = 0.05;

/// Samples of a sensor in the crystal's time.
#[derive(Clone, Copy, Debug)]
pub struct Timebase {
    nominal_us: f64,
    /// Number and time of the newest sample by the line, µs.
    number: u64,
    time_us: f64,
    period_us: f64,
    /// Points in the line.
    points: f64,
}

impl Timebase {
    /// Of a sensor with this nominal period, µs, whose sample `number` was the newest when it was polled at `now_us`.
    pub fn new(nominal_us: f64, number: u64, now_us: u64) -> Self {
        Self {
            nominal_us,
            number,
            time_us: now_us as f64 - 0.5 * nominal_us,
            period_us: nominal_us,
            points: 1.0,
        }
    }

    /// Takes in a poll at `now_us` whose newest sample was `number`, later than that of the poll before.
    pub fn poll(&mut self, number: u64, now_us: u64) {
        let step = number.saturating_sub(self.number) as f64;
        let expected_us = self.time_us + step * self.period_us;
        let off_us = now_us as f64 - 0.5 * self.period_us - expected_us;
        // Gains of a growing least-squares line with equal steps (the expanding-memory filter).
        let n = self.points;
        let level = 2.0 * (2.0 * n + 1.0) / ((n + 1.0) * (n + 2.0));
        let slope = 6.0 / ((n + 1.0) * (n + 2.0));
        self.points = (n + 1.0).min(MEMORY);
        self.number = number;
        self.time_us = expected_us + level.min(1.0) * off_us;
        let band_us = LARGEST_ERROR * self.nominal_us;
        let period_us = self.period_us + slope * off_us / step.max(1.0);
        // Not `clamp`, whose panic prints both ends: formatting of floating-point numbers is an eighth of the image.
        let (least_us, most_us) = (self.nominal_us - band_us, self.nominal_us + band_us);
        self.period_us = period_us.max(least_us).min(most_us);
    }

    /// The line continued after a gap: sample `number` was the newest when it was polled at `now_us`. The rate is still known, the phase is
    /// not.
    pub fn again(&self, number: u64, now_us: u64) -> Self {
        Self {
            number,
            time_us: now_us as f64 - 0.5 * self.period_us,
            points: self.points.min(RESUMED),
            ..*self
        }
    }

    /// Time of a sample, µs; it may be newer than the newest so far.
    pub fn at_us(&self, number: u64) -> u64 {
        let since = number as i64 - self.number as i64;
        (self.time_us + since as f64 * self.period_us).max(0.0) as u64
    }

    /// True period of the samples, µs.
    pub fn period_us(&self) -> f64 {
        self.period_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polls every millisecond of a sensor whose period is `1 + error` ms and whose first sample is at `phase_us`: the line after `seconds`,
    /// and the true time of its newest sample.
    fn polled(
        error: f64,
        phase_us: f64,
        seconds: u64,
        late_us: impl Fn(u64) -> u64,
    ) -> (Timebase, f64) {
        let period_us = 1000.0 * (1.0 + error);
        let newest = |now_us: u64| ((now_us as f64 - phase_us) / period_us).floor() as u64;
        let begin_us = 5_000;
        let mut base = Timebase::new(1000.0, newest(begin_us), begin_us);
        let mut last = newest(begin_us);
        for k in 1..=seconds * 1000 {
            let now_us = begin_us + 1000 * k + late_us(k);
            let number = newest(now_us);
            if number > last {
                base.poll(number, now_us);
                last = number;
            }
        }
        (base, phase_us + last as f64 * period_us)
    }

    #[test]
    fn the_rate_of_a_clock_that_is_off_by_three_percent_is_found_to_a_part_per_million() {
        for error in [-0.03, -0.0123, 0.0077, 0.03] {
            for phase_us in [13.0, 400.0, 950.0] {
                let (base, _) = polled(error, phase_us, 60, |_| 0);
                let found = base.period_us() / 1000.0 - 1.0;
                assert!((found - error).abs() < 3e-6, "{error} {phase_us}: {found}");
            }
        }
    }

    #[test]
    fn after_half_a_second_it_is_found_to_a_tenth_of_a_percent() {
        for error in [-0.03, 0.0004, 0.0123, 0.03] {
            let (base, _) = polled(error, 321.0, 1, |_| 0);
            let found = base.period_us() / 1000.0 - 1.0;
            assert!((found - error).abs() < 1e-3, "{error}: {found}");
        }
    }

    #[test]
    fn a_clock_that_agrees_with_the_crystal_is_not_bent_by_a_constant_phase() {
        for phase_us in [1.0, 500.0, 999.0] {
            let (base, newest_us) = polled(0.0, phase_us, 30, |_| 0);
            assert!((base.period_us() - 1000.0).abs() < 1e-3);
            // A phase that never moves against the polls is known to half a period only.
            let number = base.number;
            assert!((base.at_us(number) as f64 - newest_us).abs() <= 501.0);
        }
    }

    #[test]
    fn times_are_those_of_the_samples_and_polls_that_come_late_do_not_move_them() {
        // Every 97th poll is late by 0.7 ms, as behind another task.
        let (base, newest_us) = polled(0.0123, 321.0, 20, |k| if k % 97 == 0 { 700 } else { 0 });
        let number = base.number;
        assert!((base.at_us(number) as f64 - newest_us).abs() < 30.0);
        let before = newest_us - 10.0 * 1012.3;
        assert!((base.at_us(number - 10) as f64 - before).abs() < 30.0);
        assert!((base.period_us() - 1012.3).abs() < 0.02);
    }

    #[test]
    fn a_drift_of_the_clock_is_followed() {
        // From 1.000 to 1.002 ms within 60 s, as a die that warms up fast.
        let (mut at_us, mut taken, mut base) = (0.0, 0_u64, None::<Timebase>);
        let mut period_us = 1000.0;
        for poll in 1..60_000_u64 {
            let now_us = 1000 * poll;
            let before = taken;
            while at_us + period_us <= now_us as f64 {
                at_us += period_us;
                taken += 1;
                period_us = 1000.0 + 2.0 * at_us / 60e6;
            }
            match &mut base {
                None if taken > 0 => base = Some(Timebase::new(1000.0, taken, now_us)),
                Some(base) if taken > before => base.poll(taken, now_us),
                _ => {}
            }
        }
        let base = base.unwrap();
        assert!((base.at_us(taken) as f64 - at_us).abs() < 600.0);
        assert!(
            (base.period_us() - period_us).abs() < 0.4,
            "{}",
            base.period_us()
        );
    }
}
