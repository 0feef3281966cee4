//! Rows of a recording between two dwells, and the known inputs of a dwell.

use std::ops::Range;

use mimu_recording::Batch;

use crate::procedure::SessionConfig;
use mimu_equipment::step::Step;

/// Known inputs of a dwell on a table: rates against the ground, deg/s, and specific forces, m/s². The estimators add the Earth's rate.
pub(super) fn known(step: &Step, config: &SessionConfig) -> [f64; 6] {
    let up = step.up();
    let rate = up * step.rate_dps;
    let force = up * config.gravity_mps2;
    [rate.x, rate.y, rate.z, force.x, force.y, force.z]
}

/// A copy of some rows, without known inputs.
pub(super) fn part(rows: &Batch, range: Range<usize>) -> Batch {
    let mut out = Batch::default();
    out.t_s.extend(&rows.t_s[range.clone()]);
    out.step.extend(&rows.step[range.clone()]);
    out.temp_c.extend(&rows.temp_c[range.clone()]);
    for c in 0..6 {
        out.raw[c].extend(&rows.raw[c][range.clone()]);
    }
    out
}

/// Removes the first rows.
pub(super) fn cut(rows: &mut Batch, first: usize) {
    rows.t_s.drain(..first);
    rows.step.drain(..first);
    rows.temp_c.drain(..first);
    for c in 0..6 {
        rows.raw[c].drain(..first);
        rows.reference[c].drain(..first);
    }
}

/// Removes the rows from index `to` on.
pub(super) fn shorten(rows: &mut Batch, to: usize) {
    rows.t_s.truncate(to);
    rows.step.truncate(to);
    rows.temp_c.truncate(to);
    for c in 0..6 {
        rows.raw[c].truncate(to);
        rows.reference[c].truncate(to);
    }
}
