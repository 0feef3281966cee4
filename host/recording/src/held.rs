//! Repeated readings: a logger that is faster than its sensor writes each reading several times.

/// Longest run of equal readings, in rows, that counts as a hold. A longer run comes from a stuck sensor, or from noise far below the quantisation
/// step.
const LONGEST: usize = 31;
/// Fewest readings from which repetition is concluded.
const FEWEST: u64 = 50;
/// Least share of rows that repeat the one before. A bus that fails occasionally repeats fewer.
const SHARE: f64 = 0.1;
/// Least mean number of axes, out of three, that change with a new reading. If rows repeat by chance, because the noise is below the quantisation
/// step, a tenth of all rows repeats only if fewer than two axes change in the others.
const CHANGED: f64 = 2.5;
/// Least share of the held rows in runs whose length is within two rows of the mean.
const ALIKE: f64 = 0.9;

/// Watches the readings of a sensor, row by row.
#[derive(Debug, Clone, Default)]
pub struct HeldReadings {
    last: Option<[f64; 3]>,
    /// Rows so far with the current reading.
    run: usize,
    changes: u64,
    changed_axes: u64,
    /// Number of readings by the number of rows that each lasted.
    runs: [u64; LONGEST + 1],
}

/// Result for a sensor that is slower than its log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// Rows that repeat all axes of the row before.
    pub repeated: u64,
    /// Rows in which the sensor was watched.
    pub rows: u64,
    /// Mean number of rows per reading.
    pub rows_per_reading: f64,
}

impl HeldReadings {
    /// Takes the next row.
    pub fn push(&mut self, reading: [f64; 3]) {
        if reading.iter().any(|value| value.is_nan()) {
            (self.last, self.run) = (None, 0);
            return;
        }
        if let Some(last) = self.last {
            let changed = (0..3).filter(|&axis| last[axis] != reading[axis]).count();
            if changed == 0 {
                self.run += 1;
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

    /// Whether readings are held, and for how long.
    pub fn found(&self) -> Option<Held> {
        let readings: u64 = self.runs.iter().sum();
        let rows: u64 = (0..).zip(&self.runs).map(|(length, n)| length * n).sum();
        if readings < FEWEST {
            return None;
        }
        let rows_per_reading = rows as f64 / readings as f64;
        let repeated = rows - readings;
        let alike = |length: &usize| (*length as f64 - rows_per_reading).abs() < 2.0;
        let alike: u64 = (1..=LONGEST)
            .filter(alike)
            .map(|length| length as u64 * self.runs[length])
            .sum();
        let held = repeated as f64 >= SHARE * rows as f64
            && self.changed_axes as f64 >= CHANGED * self.changes as f64
            && alike as f64 >= ALIKE * rows as f64;
        held.then_some(Held {
            repeated,
            rows,
            rows_per_reading,
        })
    }
}

impl Held {
    /// A sentence about `sensor`, whose rows come at `rate_hz`.
    pub fn words(&self, sensor: &str, rate_hz: f64) -> String {
        let per_reading = self.rows_per_reading;
        format!(
            "the {sensor} repeats its reading in {} of {} rows: a new reading comes every {per_reading:.2} rows, at {:.1} Hz, but the log has {rate_hz:.1} Hz. The certainty of a mean depends on the number of readings, not of rows, and faster noise is not the sensor's",
            self.repeated,
            self.rows,
            rate_hz / per_reading,
        )
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
    fn watched(per_reading: f64, sigma: f64, moves: impl Fn(usize) -> bool) -> Option<Held> {
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
            held.push(reading);
        }
        held.found()
    }

    #[test]
    fn a_sensor_that_is_slower_than_its_log_is_found_with_its_rate() {
        for per_reading in [1.25, 1.6, 2.0, 5.0, 10.0, 20.0] {
            let held = watched(per_reading, 20.0, |_| false).unwrap();
            assert!(
                (held.rows_per_reading / per_reading - 1.0).abs() < 0.02,
                "{per_reading} {held:?}"
            );
            let share = held.repeated as f64 / held.rows as f64;
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
}
