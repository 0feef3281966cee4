//! Position of a file in a sequence: the step of its rows, and their times among those of the other files.

use super::row::Row;

/// Time in s from one file to the next if it is unknown. No turn is integrated across such a gap.
pub(super) const PAUSE_S: f64 = 10.0;

/// Position of a file in a sequence.
#[derive(Debug, Clone, Copy)]
pub(super) struct SequencePosition {
    step: i32,
    /// Delay of its times relative to those of the first file, s.
    behind_s: f64,
    /// Time of the last row before it, s.
    after_s: f64,
    /// What is added to its times, once its first row has been seen.
    offset_s: Option<f64>,
    last_s: f64,
}

impl SequencePosition {
    /// For the file of `step`, which by its stamps began `behind_s` after the first; the last row before it is at `after_s`.
    pub fn new(step: i32, behind_s: f64, after_s: f64) -> Self {
        Self {
            step,
            behind_s,
            after_s,
            offset_s: None,
            last_s: after_s,
        }
    }

    /// Time of the last row so far, s.
    pub fn last_s(&self) -> f64 {
        self.last_s
    }

    /// Gives a row of the file its step, and its time among those of the others.
    pub fn put(&mut self, row: &mut Row) {
        let (after_s, behind_s) = (self.after_s, self.behind_s);
        let offset_s = *self
            .offset_s
            .get_or_insert(match behind_s + row.t_s > after_s {
                true => behind_s,
                false => after_s + PAUSE_S - row.t_s,
            });
        row.t_s += offset_s;
        row.step = self.step;
        self.last_s = row.t_s;
    }
}
