//! Readings that are written again until the sensor has a new one, as by a logger that is faster than its sensor.

/// Longest run of equal readings, in rows, that is a hold: longer ones are a sensor that is stuck, or so quiet that its converter shows nothing.
const LONGEST: usize = 31;
/// Readings that show a rule.
const FEWEST: u64 = 50;
/// Least share of rows that repeat the one before. A bus that fails now and then repeats fewer.
const SHARE: f64 = 0.1;
/// Axes of three that change with a new reading, at least. Where rows repeat by chance, as the noise is less than the converter's step, a
/// tenth of all rows does so only if less than two axes change in the others.
const CHANGED: f64 = 2.5;
/// Share of the rows in holds that last as long as the others, to two rows.
const ALIKE: f64 = 0.9;

/// Watches the readings of a sensor, row by row.
#[derive(Debug, Clone, Default)]
pub struct HeldReadings {
    last: Option<[f64; 3]>,
    /// Rows with the reading at hand so far.
    run: usize,
    changes: u64,
    changed_axes: u64,
    /// How many readings stood for so many rows.
    runs: [u64; LONGEST + 1],
}

/// What was found of a sensor that is slower than its log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// Rows that repeat all axes of the row before.
    pub repeated: u64,
    /// Rows in which the sensor was watched.
    pub rows: u64,
    /// Rows to a reading, in the mean.
    pub rows_per_reading: f64,
}

impl HeldReadings {
    /// The next row.
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
            // The first run has no beginning.
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
    /// In a sentence about `sensor`, whose rows come at `rate_hz`.
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

    /// Readings of three axes with noise of `sigma` steps of the converter, new every `per_reading` rows; at rest but for `moves` of the rows.
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
            // At rest nothing shows, and in every fourth second it moves.
            assert_eq!(watched(1.0, sigma, |row| row % 400 < 100), None, "{sigma}");
        }
    }
}
