//! Rows of a recording between two dwells, and the known inputs of a dwell.

use std::ops::Range;

use mimu_recording::{Batch, Column, TriadName};

use crate::procedure::SessionConfig;
use crate::source::Chunk;
use mimu_equipment::step::Step;

/// Known inputs of a dwell on a table: rates against the ground, deg/s, and specific forces, m/s². The estimators add the Earth's rate.
pub(super) fn known(step: &Step, config: &SessionConfig) -> [f64; 6] {
    let up = step.up();
    let rate = up * step.rate_dps;
    let force = up * config.gravity_mps2;
    [rate.x, rate.y, rate.z, force.x, force.y, force.z]
}

/// A copy of some rows.
pub(super) fn part(rows: &Batch, range: Range<usize>) -> Batch {
    let mut out = Batch::default();
    out.append(rows, range);
    out
}

/// Rows that no dwell has taken yet, with their ticks.
#[derive(Debug, Default)]
pub(super) struct Pending {
    /// The rows.
    pub rows: Batch,
    ticks: Vec<u64>,
    /// What is added to the times of chunks so that they never go back, s: a source that was opened again counts its time anew.
    later_s: f64,
    /// Time of the last sample, s.
    last_s: Option<f64>,
}

impl Pending {
    /// Appends the samples of a chunk of a unit of this nominal rate.
    pub fn add(&mut self, chunk: &Chunk, rate_hz: f64) {
        let mut mag = chunk.mag.iter();
        for ((k, t_s), row) in (0..).zip(chunk.times(rate_hz)).zip(&chunk.values) {
            let least_s = self.last_s.map_or(t_s, |last| last + 0.5 / rate_hz);
            if t_s + self.later_s < least_s {
                self.later_s = least_s + 0.5 / rate_hz - t_s;
            }
            self.last_s = Some(t_s + self.later_s);
            self.ticks.push(chunk.tick + k);
            let rows = &mut self.rows;
            rows.t_s.push(t_s + self.later_s);
            rows.step.push(-1);
            rows.temp_c.push(chunk.temp_c);
            for c in 0..6 {
                rows.raw[c].push(row[c]);
                rows.reference[c].push(f64::NAN);
            }
            for (axis, value) in mag.next().into_iter().flatten().enumerate() {
                let column = Column::of(TriadName::MAG, axis);
                rows.values_mut(column)
                    .into_iter()
                    .for_each(|to| to.push(*value));
            }
        }
    }

    /// Number of rows before this tick.
    pub fn before(&self, tick: u64) -> usize {
        self.ticks.partition_point(|t| *t < tick)
    }

    /// Takes the rows before index `to`, and keeps the others.
    pub fn take(&mut self, to: usize) -> Batch {
        let rows = part(&self.rows, 0..to);
        self.cut(to);
        rows
    }

    /// Removes the first rows.
    pub fn cut(&mut self, first: usize) {
        self.ticks.drain(..first);
        self.rows.cut(first);
    }

    /// Forgets the rows, but not the time.
    pub fn clear(&mut self) {
        self.cut(self.rows.len());
    }
}
