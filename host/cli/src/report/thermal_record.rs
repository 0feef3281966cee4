//! Progress and result of a procedure over temperature, as text.

use std::fmt::Write as _;

use mimu::quantity::duration;
use mimu_equipment::carry_out::{CarriedOut, Progress};

use super::record_text;

/// Progress in one line.
pub fn thermal_progress(at: &Progress, has_chamber: bool) -> String {
    let chamber = match (has_chamber, at.chamber_c) {
        (true, Some(c)) => format!("chamber set to {:.1} °C, now at {c:.1} °C", at.planned_c),
        (true, None) => format!("chamber set to {:.1} °C", at.planned_c),
        (false, _) => format!("planned {:.1} °C", at.planned_c),
    };
    let measured = format!(
        "{chamber}, thermometer {:.1} °C, {} samples missing",
        at.temp_c, at.missing
    );
    if at.since_s.is_none() {
        return format!("on the way to the first temperature and pose: {measured}");
    }
    let lost = match at.line_lost {
        true => "; the port has vanished: waiting for it",
        false => "",
    };
    let [round, rounds] = at.round;
    let [done, planned] = at.dwells;
    format!(
        "round {round} of {rounds}, {done} of {planned} dwells and turns: {measured}, {} left{lost}",
        duration(at.left_s)
    )
}

/// Completed dwells, chamber settings, and the recording.
pub fn thermal_record_text(made: &CarriedOut) -> String {
    let mut out = record_text(&made.recorded);
    let _ = writeln!(
        out,
        "procedure: {} of {} rounds, {} of {} dwells and turns",
        made.rounds_done, made.rounds_planned, made.dwells_done, made.dwells_planned
    );
    let dropped = made.recorded.state.dropped.len();
    if dropped > 0 {
        let _ = writeln!(
            out,
            "not used: {dropped}, because they were not recorded as planned"
        );
    }
    if let Some(rest_c) = made.rest_c {
        let _ = writeln!(
            out,
            "chamber: {} set points; set to {rest_c} °C at the end",
            made.set_points
        );
    }
    for error in &made.not_at_rest {
        let _ = writeln!(out, "NOT AT REST: {error}");
    }
    out
}
