//! The progress of a procedure, for a person.

use mimu::plan::Planned;
use mimu_device::record::{Procedure, RecordingState};

use super::sequence::Sequence;

/// Progress of a procedure.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Time since the procedure began, s; `None` until the chamber has reached the first temperature.
    pub since_s: Option<f64>,
    /// Running round, counted from 1, and number of rounds.
    pub round: [usize; 2],
    /// Completed and planned dwells and turns.
    pub dwells: [usize; 2],
    /// Remaining time at the pace so far, s.
    pub left_s: f64,
    /// Planned temperature of the chamber, °C.
    pub planned_c: f64,
    /// Its present temperature, °C, if it can be read.
    pub chamber_c: Option<f64>,
    /// The unit's thermometer, °C.
    pub temp_c: f64,
    /// Missing samples.
    pub missing: u64,
    /// Turns that were recorded only in part.
    pub dropped: usize,
    /// The port has vanished, and is awaited.
    pub line_lost: bool,
}

impl Progress {
    pub(super) fn of(
        procedure: &Procedure,
        sequence: &Sequence<'_>,
        state: &RecordingState,
        chamber_c: Option<f64>,
    ) -> Self {
        let (done, planned) = (sequence.done(), procedure.dwells.len());
        let since_s = sequence.since_s();
        let round = (done / procedure.per_round + 1).min(procedure.rounds);
        Self {
            since_s,
            round: [round, procedure.rounds],
            dwells: [done, planned],
            left_s: left_s(procedure, done, since_s.unwrap_or_default()),
            planned_c: procedure.temp_c(since_s.unwrap_or_default()),
            chamber_c,
            temp_c: state.temp_c,
            missing: state.missing,
            dropped: state.dropped.len(),
            line_lost: state.waiting,
        }
    }
}

/// Time until the end of the last dwell, s. If rounds begin at fixed times, it is known. Otherwise each dwell is expected to take as long in
/// proportion as those before.
fn left_s(procedure: &Procedure, done: usize, since_s: f64) -> f64 {
    let length =
        |dwells: &[Planned]| -> f64 { dwells.iter().map(|d| d.length.as_secs_f64()).sum() };
    let (had, to_come) = procedure.dwells.split_at(done);
    if let Some(round_s) = procedure.round_s {
        let end_s = procedure.lead_in_s + procedure.rounds as f64 * round_s;
        return (end_s - since_s).max(0.0);
    }
    let lead_in_s = (procedure.lead_in_s - since_s).max(0.0);
    let pace = match length(had) {
        had_s if had_s > 0.0 => ((since_s - procedure.lead_in_s) / had_s).max(1.0),
        _ => 1.0,
    };
    // The running dwell counts in full, because its elapsed part is unknown here. With a single dwell the elapsed part is known.
    match procedure.dwells.len() {
        1 => (procedure.lead_in_s + length(to_come) - since_s).max(0.0),
        _ => lead_in_s + pace * length(to_come),
    }
}
