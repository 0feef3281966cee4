//! Finds readings that a board sends again because its sensor no longer answers. As rates they would turn the unit on, so they count as missing.

use mimu::signal::increment::pause_periods;

/// Time for which all six readings have to repeat, s, and the fewest rows.
const LASTS: (f64, u32) = (0.1, 5);
/// Share of repeated rows from which on a board's steps are coarser than its noise, and rows repeat without a fault.
const COARSE: f64 = 0.1;

/// Counts rows that repeat the row before.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Repeated {
    last: Option<[f64; 6]>,
    run: u32,
    /// Rows outside of such a time, and those of them that repeat the row before.
    rows: [f64; 2],
    /// Rows of the present time that were left out, and how many have to be.
    found: u64,
    least: u64,
}

impl Repeated {
    /// Whether this row is to be left out: it is one of a time of repeated readings, after its first tenth of a second, which is not recognised, or
    /// follows it so closely that the turn would be integrated across it.
    pub(crate) fn take(&mut self, row: &[f64; 6], rate_hz: f64) -> bool {
        let repeats = self.last == Some(*row);
        self.last = Some(*row);
        self.run = if repeats { self.run + 1 } else { 0 };
        let [rows, repeated] = self.rows;
        let long = self.run >= LASTS.1.max((LASTS.0 * rate_hz) as u32);
        let held = long && rows > rate_hz && repeated < COARSE * rows;
        if held || (1..self.least).contains(&self.found) {
            self.found += 1;
            self.least = pause_periods(rate_hz);
            return true;
        }
        self.rows = [rows + 1.0, repeated + f64::from(u8::from(repeats))];
        false
    }

    /// Number of repeated rows, if their time has ended.
    pub(crate) fn ended(&mut self) -> Option<u64> {
        (self.run == 0 && self.found > 0).then(|| std::mem::take(&mut self.found))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of rows found among 300 whose noise is that many steps, of which the last `held` are the same.
    fn found(steps: f64, held: usize) -> usize {
        let mut repeated = Repeated::default();
        let noisy = |k: usize| {
            let of = |c: usize| (steps * ((k * (c + 3)) as f64 * 0.618_034).fract()).round();
            std::array::from_fn(of)
        };
        let rows = (0..300).filter(|k| {
            let row = noisy(*k.min(&(299 - held)));
            repeated.take(&row, 100.0)
        });
        let mut count = rows.count();
        count += (1..30).filter(|k| repeated.take(&noisy(*k), 100.0)).count();
        assert_eq!(repeated.ended(), (count > 0).then_some(count as u64));
        count
    }

    #[test]
    fn a_second_of_one_reading_is_found_after_a_tenth() {
        assert_eq!(found(5.0, 100), 91);
        assert_eq!(found(5.0, 5), 0);
        // So that no turn is integrated across it.
        assert_eq!(found(5.0, 12) as u64, pause_periods(100.0));
    }

    #[test]
    fn a_board_with_coarse_steps_repeats_its_readings_without_a_fault() {
        assert_eq!(found(0.0, 100), 0);
    }
}
