//! Progress and result of a procedure over temperature.

use maud::html;
use mimu::quantity::duration;
use mimu_equipment::carry_out::{CarriedOut, Progress};

use super::record_text;
use super::terminal::text;

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
    let lost = if at.line_lost {
        "; the port has vanished: waiting for it"
    } else {
        ""
    };
    let ([round, rounds], [done, planned], left) = (at.round, at.dwells, duration(at.left_s));
    format!(
        "round {round} of {rounds}, {done} of {planned} dwells and turns: {measured}, {left} left{lost}"
    )
}

/// Completed dwells, chamber settings, and the recording.
pub fn thermal_record_text(made: &CarriedOut) -> String {
    let dropped = made.recorded.state.dropped.len();
    record_text(&made.recorded)
        + &text(&html! {
            p { "procedure: " (made.rounds_done) " of " (made.rounds_planned) " rounds, " (made.dwells_done) " of " (made.dwells_planned) " dwells and turns" }
            @if dropped > 0 { p { "not used: " (dropped) ", because they were not recorded as planned" } }
            @if let Some(rest_c) = made.rest_c { p { "chamber: " (made.set_points) " set points; set to " (rest_c) " °C at the end" } }
            ul class="lines" data-head="NOT AT REST: " { @for error in &made.not_at_rest { li { (error) } } }
        })
}
