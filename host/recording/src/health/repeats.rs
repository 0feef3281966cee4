//! Repeated readings: a sensor slower than its log, one that does not answer, a channel that sticks or is dead.
//!
//! Equal neighbours alone are no fault, because a converter coarser than the noise gives them too. A run of them is one if it is longer than chance
//! explains, given how often neighbours are equal while the channel works.

use super::{Fault, Finding, Rows};
use crate::columns::RAW_COLUMNS;

/// Share of rows that repeat the row before in all axes, from which on this is the habit of a recording: the sensor is slower than its log, or the
/// steps are coarser than the noise. Below it, a run of such rows is a fault of the moment. A bus that fails occasionally repeats fewer.
const HABIT: f64 = 0.1;
/// Natural logarithm of the odds against a run of equal neighbours by chance, in a whole recording.
pub(super) const RUN_LOG_ODDS: f64 = 14.0;
/// Least and largest share of equal neighbours for a limit. No share below the first is measured in few rows. From the second on runs are so long
/// that none is conspicuous.
const SHARES: [f64; 2] = [1e-3, 0.8];
/// A run is not conspicuous below this length, in rows: in a short recording rare repeats are not counted well enough.
const SHORTEST_RUN: f64 = 5.0;
/// Limit for the variance of a reading that alternates between two codes, over the square of the quantisation step: a quarter at most, and a margin.
/// With such noise or less a channel has a single value for seconds. With noise of half a step, a hundred equal samples occur once in 1e16 times.
const TWO_CODES: f64 = 0.3;

/// Longest run of equal neighbours at one place that chance explains. `share` of all neighbours are equal while the channel works; `log_odds` against
/// chance. `None` if most neighbours are equal.
pub(super) fn run_by_chance(share: f64, log_odds: f64) -> Option<f64> {
    (share < SHARES[1]).then(|| 1.0 + log_odds / -share.max(SHARES[0]).ln())
}

/// The same for a run that may be anywhere in the `rows` of a channel.
pub fn channel_run_by_chance(share: f64, rows: u64) -> Option<f64> {
    let run = run_by_chance(share, RUN_LOG_ODDS + (rows.max(1) as f64).ln())?;
    Some(run.max(SHORTEST_RUN))
}

/// Whether the quantisation `step` is coarser than noise of this `variance`: where the channel changes at all, it alternates between two codes.
pub fn is_coarse(variance: f64, step: f64) -> bool {
    variance < TWO_CODES * step * step
}

/// Watches a channel for a value that never changes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Constant {
    value: Option<f64>,
    changes: bool,
}

impl Constant {
    /// For these readings.
    pub fn of(readings: impl IntoIterator<Item = f64>) -> Self {
        let mut all = Self::default();
        readings.into_iter().for_each(|reading| all.take(reading));
        all
    }

    /// Takes a reading, or an extreme of several; NaN are passed over.
    pub fn take(&mut self, reading: f64) {
        if !reading.is_nan() {
            self.changes |= *self.value.get_or_insert(reading) != reading;
        }
    }

    /// Whether it has no reading.
    pub fn is_empty(&self) -> bool {
        self.value.is_none()
    }

    /// Whether it has no reading other than 0.
    pub fn is_zero(&self) -> bool {
        !self.changes && self.value.is_none_or(|value| value == 0.0)
    }

    /// The finding about channel `c` of so many `rows`.
    pub fn found(&self, c: usize, rows: u64) -> Option<Finding> {
        let value = self.value.filter(|_| !self.changes)?;
        Some(Finding::new(RAW_COLUMNS[c], rows, Fault::Dead { value }))
    }
}

/// Longest run of equal readings, in rows, that counts as held. A longer run comes from a stuck sensor, or from noise far below the quantisation
/// step.
const LONGEST: usize = 31;
/// Fewest readings from which repetition is concluded.
const FEWEST: u64 = 50;
/// Least mean number of axes, out of three, that change with a new reading. If rows repeat by chance, because the noise is below the quantisation
/// step, a tenth of all rows repeats only if fewer than two axes change in the others.
const CHANGED: f64 = 2.5;
/// Least share of the held rows in runs whose length is within two rows of the mean.
const ALIKE: f64 = 0.9;

/// Watches a sensor for readings that its log repeats, row by row.
#[derive(Debug, Clone, Default)]
pub struct HeldReadings {
    last: Option<[f64; 3]>,
    /// Rows so far with the current reading.
    run: usize,
    changes: u64,
    changed_axes: u64,
    /// Number of readings by the number of rows that each lasted.
    runs: [u64; LONGEST + 1],
    first: Option<u64>,
}

impl HeldReadings {
    /// Takes the next row and its number.
    pub fn take(&mut self, row: u64, reading: [f64; 3]) {
        if reading.iter().any(|value| value.is_nan()) {
            (self.last, self.run) = (None, 0);
            return;
        }
        if let Some(last) = self.last {
            let changed = (0..3).filter(|&axis| last[axis] != reading[axis]).count();
            if changed == 0 {
                self.run += 1;
                self.first.get_or_insert(row);
                return;
            }
            self.changes += 1;
            self.changed_axes += changed as u64;
            // The first run may have begun before the log.
            if self.run > 0 && self.run <= LONGEST && self.changes > 1 {
                self.runs[self.run] += 1;
            }
        }
        (self.last, self.run) = (Some(reading), 1);
    }

    /// What was found of the sensor `about`, whose rows come at `rate_hz`.
    pub fn found(&self, about: &'static str, rate_hz: f64) -> Option<Finding> {
        let readings: u64 = self.runs.iter().sum();
        let of: u64 = (0..).zip(&self.runs).map(|(length, n)| length * n).sum();
        if readings < FEWEST {
            return None;
        }
        let rows_per_reading = of as f64 / readings as f64;
        let count = of - readings;
        let alike = |length: &usize| (*length as f64 - rows_per_reading).abs() < 2.0;
        let alike: u64 = (1..=LONGEST)
            .filter(alike)
            .map(|length| length as u64 * self.runs[length])
            .sum();
        let held = count as f64 >= HABIT * of as f64
            && self.changed_axes as f64 >= CHANGED * self.changes as f64
            && alike as f64 >= ALIKE * of as f64;
        held.then_some(Finding {
            about: Some(about),
            rows: Rows {
                first: self.first,
                count,
            },
            fault: Fault::Held {
                of,
                rows_per_reading,
                rate_hz,
            },
        })
    }
}

/// Follows how often the rows of a stream repeat the row before in all six channels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Repetition {
    last: Option<[f64; 6]>,
    rows: f64,
    repeated: f64,
}

impl Repetition {
    /// Whether this row repeats the one before.
    pub fn take(&mut self, row: &[f64; 6]) -> bool {
        let repeats = self.last == Some(*row);
        self.last = Some(*row);
        repeats
    }

    /// Counts rows without a fault, and those of them that repeat the row before.
    pub fn count(&mut self, rows: f64, repeated: f64) {
        self.rows += rows;
        self.repeated += repeated;
    }

    /// Whether repeated rows are a fault. A stream has to show its habit first, for a second.
    pub fn is_fault(&self, rate_hz: f64) -> bool {
        self.rows > rate_hz && self.repeated < HABIT * self.rows
    }
}

/// Time for which all six readings have to repeat, s, and the fewest rows, for a sensor that does not answer.
const UNANSWERED: (f64, u32) = (0.1, 5);

/// Finds readings that a board sends again because its sensor no longer answers. As rates they would turn the unit on, so they count as missing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unanswered {
    repetition: Repetition,
    run: u32,
    /// Rows of the present time that were left out, and how many have to be.
    found: u64,
    least: u64,
}

impl Unanswered {
    /// Whether this row is to be left out: it is one of a time of repeated readings, after its first tenth of a second, which is not recognised, or
    /// is among so many `periods` from the first row left out that a turn would be integrated across fewer.
    pub fn take(&mut self, row: &[f64; 6], rate_hz: f64, periods: u64) -> bool {
        let repeats = self.repetition.take(row);
        self.run = if repeats { self.run + 1 } else { 0 };
        let long = self.run >= UNANSWERED.1.max((UNANSWERED.0 * rate_hz) as u32);
        let unanswered = long && self.repetition.is_fault(rate_hz);
        if unanswered || (1..self.least).contains(&self.found) {
            self.found += 1;
            self.least = periods;
            return true;
        }
        self.repetition.count(1.0, f64::from(u8::from(repeats)));
        false
    }

    /// The finding, if the time of repeated rows has ended.
    pub fn ended(&mut self) -> Option<Finding> {
        let ended = self.run == 0 && self.found > 0;
        ended.then(|| Finding::of_all(std::mem::take(&mut self.found), Fault::Unanswered))
    }
}

/// Watches a channel of a stream for a value that stays, second by second.
#[derive(Debug, Clone, Copy, Default)]
pub struct StuckChannel {
    last: Option<f64>,
    /// Smallest change so far; `None` if there was none.
    step: Option<f64>,
    /// Whether the first second had a single value: either the quantisation step exceeds the noise, or a wire is broken.
    constant: Option<bool>,
    /// Variance of the quietest second with more than one value.
    quietest: Option<f64>,
}

impl StuckChannel {
    /// Takes the next reading.
    pub fn take(&mut self, value: f64) {
        let change = self.last.map_or(0.0, |last| (value - last).abs());
        if change > 0.0 {
            self.step = Some(self.step.map_or(change, |step| step.min(change)));
        }
        self.last = Some(value);
    }

    /// Takes the variance of a second.
    pub fn second(&mut self, variance: f64) {
        self.constant.get_or_insert(variance == 0.0);
        if variance > 0.0 {
            self.quietest = Some(self.quietest.map_or(variance, |least| least.min(variance)));
        }
    }

    /// Whether a second may have a single value because of the quantisation step.
    fn is_coarse(&self) -> bool {
        let steps = self.quietest.zip(self.step);
        self.constant == Some(true)
            || steps.is_some_and(|(variance, step)| is_coarse(variance, step))
    }

    /// The finding about a second of channel `c` with a single value. `moved`: the unit was turned since the beginning, which a coarse channel shows
    /// and a broken wire does not.
    pub fn found(&self, c: usize, rows: u64, moved: bool) -> Option<Finding> {
        let stuck = !self.is_coarse() || moved && self.step.is_none();
        let (value, lasts_s) = (self.last?, 1.0);
        stuck.then(|| Finding::new(RAW_COLUMNS[c], rows, Fault::Stuck { value, lasts_s }))
    }

    /// Variance hidden by a coarse quantisation step.
    pub fn hidden(&self) -> f64 {
        let step = self.step.filter(|_| self.is_coarse());
        step.map_or(0.0, |step| step * step / 12.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform from 0 to 1: Marsaglia's xorshift.
    fn uniform() -> impl FnMut() -> f64 {
        let mut state = 88_172_645_463_325_252_u64;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    /// Result for three axes with noise of `sigma` quantisation steps and a new reading every `per_reading` rows. The unit moves in the rows that
    /// `moves` selects.
    fn watched(per_reading: f64, sigma: f64, moves: impl Fn(usize) -> bool) -> Option<Finding> {
        let mut random = uniform();
        let mut held = HeldReadings::default();
        let (mut reading, mut due) = ([0.0; 3], 0.0);
        for row in 0..20_000 {
            if row as f64 >= due {
                due += per_reading;
                let size = if moves(row) { 1000.0 } else { sigma };
                reading = std::array::from_fn(|_| {
                    let sum: f64 = (0..12).map(|_| random()).sum();
                    (size * (sum - 6.0)).round()
                });
            }
            held.take(row as u64, reading);
        }
        held.found("gyro", 100.0)
    }

    #[test]
    fn a_sensor_that_is_slower_than_its_log_is_found_with_its_rate() {
        for per_reading in [1.25, 1.6, 2.0, 5.0, 10.0, 20.0] {
            let held = watched(per_reading, 20.0, |_| false).unwrap();
            let Fault::Held {
                of,
                rows_per_reading,
                ..
            } = held.fault
            else {
                panic!("{held:?}");
            };
            assert!(
                (rows_per_reading / per_reading - 1.0).abs() < 0.02,
                "{per_reading} {held:?}"
            );
            let share = held.rows.count as f64 / of as f64;
            assert!((share - (1.0 - 1.0 / per_reading)).abs() < 0.02, "{held:?}");
        }
    }

    #[test]
    fn readings_that_repeat_as_the_converter_is_coarse_are_not_held() {
        for sigma in [0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 3.0, 100.0] {
            assert_eq!(watched(1.0, sigma, |_| false), None, "{sigma}");
            // At rest nothing shows; the unit moves during a quarter of the rows.
            assert_eq!(watched(1.0, sigma, |row| row % 400 < 100), None, "{sigma}");
        }
    }

    /// Fewest rows that are left out.
    const PERIODS: u64 = 9;

    /// Number of rows found among 300 whose noise is that many steps, of which the last `held` are the same.
    fn found(steps: f64, held: usize) -> usize {
        let mut unanswered = Unanswered::default();
        let noisy = |k: usize| {
            let of = |c: usize| (steps * ((k * (c + 3)) as f64 * 0.618_034).fract()).round();
            std::array::from_fn(of)
        };
        let rows = (0..300).filter(|k| {
            let row = noisy(*k.min(&(299 - held)));
            unanswered.take(&row, 100.0, PERIODS)
        });
        let mut count = rows.count();
        count += (1..30)
            .filter(|k| unanswered.take(&noisy(*k), 100.0, PERIODS))
            .count();
        let ended = unanswered.ended().map(|found| found.rows.count);
        assert_eq!(ended, (count > 0).then_some(count as u64));
        count
    }

    #[test]
    fn a_second_of_one_reading_is_found_after_a_tenth() {
        assert_eq!(found(5.0, 100), 91);
        assert_eq!(found(5.0, 5), 0);
        // So that no turn is integrated across it.
        assert_eq!(found(5.0, 12) as u64, PERIODS);
    }
}
