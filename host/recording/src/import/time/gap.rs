//! Gaps and jitter of stamps, and the limit between them.

use serde::Serialize;

/// A stall that is caught up within this time is jitter, s.
pub(super) const STALL_S: f64 = 5.0;

/// Missing samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) struct Gap {
    /// Row that comes after them, from 0.
    pub row: u64,
    /// Their number.
    pub missing: u64,
}

/// How far stamps are from the regular time, s.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Jitter {
    /// Root of the mean square.
    pub rms_s: f64,
    /// Largest.
    pub max_s: f64,
}

/// The `share` quantile of some values; reorders them.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = ((values.len() - 1) as f64 * share) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
