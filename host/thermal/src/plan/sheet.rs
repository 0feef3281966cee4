//! A procedure as a plan `mimu-plan/1`, for a table in a chamber.

use std::fmt::Write as _;

use mimu::design::plan::round;

use super::Planned;
use super::procedure::Step;

/// The plan as TOML; `dwell_s` and `sample_rate_hz` are those that it was planned with.
pub fn to_toml(planned: &Planned, sample_rate_hz: f64) -> String {
    let schedule = &planned.schedule;
    let [from, to] = planned.range_c;
    let mut out = format!(
        "# Procedure {} from {from} to {to} °C, by mimu {}.\nformat = \"mimu-plan/1\"\nsample_rate_hz = {:?}\ncarrier = \"table\"\n",
        planned.procedure.name(),
        env!("CARGO_PKG_VERSION"),
        round(sample_rate_hz, 1e6)
    );
    let points = schedule.chamber_c.iter();
    let points: Vec<String> = points
        .map(|[t, c]| format!("[{:?}, {:?}]", round(*t, 1e3), round(*c, 1e3)))
        .collect();
    let _ = writeln!(out, "chamber_c = [{}]", points.join(", "));
    let _ = writeln!(out, "lead_in_s = {:?}", round(schedule.lead_in_s, 1e3));
    if schedule.rounds > 1 {
        let _ = writeln!(out, "rounds = {}", schedule.rounds);
        if schedule.waits {
            let _ = writeln!(out, "round_s = {:?}", round(schedule.round_s, 1e3));
        }
    }
    for (step, [from, to]) in schedule.steps.iter().zip(&schedule.times_s) {
        out.push_str("\n[[step]]\n");
        match step {
            Step::Dwell { up, rate_dps, stay } => {
                let [x, y, z] = <[f64; 3]>::from(*up).map(|c| round(c, 1e9));
                let _ = match stay {
                    true => writeln!(out, "stay = true"),
                    false => writeln!(out, "up = [{x:?}, {y:?}, {z:?}]"),
                };
                if *rate_dps != 0.0 {
                    let _ = writeln!(out, "rate_dps = {:?}", round(*rate_dps, 1e6));
                }
                let _ = writeln!(out, "dwell_s = {:?}", round(to - from, 1e3));
            }
            Step::Turn {
                axis,
                angle_deg,
                rate_dps,
                ..
            } => {
                let _ = writeln!(
                    out,
                    "turn_axis = \"{axis}\"\nturn_deg = {angle_deg:?}\nturn_dps = {rate_dps:?}"
                );
            }
        }
    }
    out
}
