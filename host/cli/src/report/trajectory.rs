//! A fit by a trajectory.

use maud::{Markup, html};
use mimu::judgement::Judgement;
use mimu::parameter::ParameterKind;
use mimu::quantity::{plural, significant};
use mimu::readable;
use mimu_body::result::{BodyResult, ParameterResult, TriadResult};
use mimu_body::trajectory::{TrajectoriesResult, TrajectoryResult};
use mimu_recording::statistics::root_mean_square;

use super::body::section;
use super::page::judged;
use super::table::{by_axes, interval, known, number, table, with_unit};
use super::terminal::text;

/// The fit of the recording at `place`.
pub(crate) fn trajectory_text(
    place: &str,
    body: &BodyResult,
    by: &TrajectoryResult,
    judgement: &Judgement,
) -> String {
    text(&html! {
        p { (place) ", by the poses of " (by.file) }
        (judged(judgement, "line"))
        @for (name, sensor) in &body.sensors { (parameters(name, sensor)) }
        (section(body))
        h2 { "Instrument" }
        p.line { "white noise: attitude " (significant(by.attitude_noise_deg)) " deg" @if let Some(mm) = by.position_noise_mm { ", position " (significant(mm)) " mm" } }
        p.line { "the recording's clock runs faster by " (plus_minus(by.clock_ppm.value, by.clock_ppm.upper)) " ppm" }
        @if let Some(([a, b], up)) = by.tilt_deg.zip(by.up) {
            p.line { "its " (up) " axis points up, tilted by " (plus_minus(a.value, a.upper)) " and " (plus_minus(b.value, b.upper)) " deg" }
        }
        p.line { "the intervals are of this recording: what the instrument errs by in all of it only others show (mimu fit A B C --trajectory A's --trajectory B's ...)" }
        @if by.quaternions != "unit to reference" { p.line { "its quaternions turn from the reference to the unit" } }
    })
}

/// The fit of several recordings of a unit; with `verbose` also each of them.
pub(crate) fn trajectories_text(
    device: &str,
    result: &TrajectoriesResult,
    judgement: &Judgement,
    verbose: bool,
) -> String {
    let count = result.recordings.len() as u64;
    text(&html! {
        p { (device) ": " (plural(count, "recording")) ", each by its trajectory" }
        (judged(judgement, "line"))
        @for (name, sensor) in &result.sensors { (parameters(name, sensor)) }
        h2 { "Errors" }
        (table("Root mean square error of each recording by the calibration of the others", &html! {
            th { "rms error" } th.n { "held out" } th.n { "uncalibrated" } th.n { "each alone" } th.n { "noise" } th { "less than uncalibrated" }
        }, &html! { @for (name, sensor) in &result.sensors {
            @let unit = readable::error(sensor.unit);
            @let held: Vec<_> = result.recordings.iter().filter_map(|of| of.held_out.get(name)).collect();
            @let uncalibrated = root_mean_square(held.iter().map(|of| of.rms_uncalibrated));
            @let less = held.iter().filter(|of| of.rms < of.rms_uncalibrated).count();
            tr {
                td { (with_unit(name, &unit)) }
                @for rms in [sensor.held_out_rms, uncalibrated, sensor.rms, sensor.noise_floor] { (number(rms, unit.factor)) }
                td { "in " (less) " of " (held.len()) " recordings" }
            }
        } }))
        @if verbose { (recordings(result)) }
        @for (name, sensor) in result.sensors.iter().filter(|of| !of.1.judgement.is_good()) { p.line { (name) " is judged " (sensor.judgement) } }
        @for refused in &result.refused { p.line { (refused.triad) " is not calibrated: " (refused.judgement.reason) } }
        @if count < 3 { p.line { "two recordings hardly show by how much an instrument's errors differ: record a third" } }
    })
}

/// Errors and delays by recording.
fn recordings(result: &TrajectoriesResult) -> Markup {
    let names: Vec<&String> = result.sensors.keys().collect();
    html! {
        h2 { "Recordings" }
        (table("Errors by the calibration of the others and uncalibrated, and delays", &html! {
            th { "recording" }
            @for name in &names { th.n { (name) " held out" } th.n { "uncalibrated" } th.n { "late, ms" } }
        }, &html! { @for of in &result.recordings { tr {
            td { (of.recording) }
            @for name in &names {
                @let factor = readable::error(result.sensors[*name].unit).factor;
                @let held = of.held_out.get(*name);
                (known(held.map(|of| of.rms), factor))
                (known(held.map(|of| of.rms_uncalibrated), factor))
                @match of.own.body.iter().find(|place| place.triad.to_string() == **name).and_then(|place| place.delay_ms) {
                    Some(delay) => (interval(delay.value, delay.upper - delay.value, 1.0)),
                    None => td.n { "-" },
                }
            }
        } } }))
    }
}

fn plus_minus(value: f64, upper: f64) -> String {
    mimu::quantity::plus_minus(value, upper - value)
}

fn parameters(name: &str, sensor: &TriadResult) -> Markup {
    let kinds = ParameterKind::PHYSICAL.into_iter();
    let rows = kinds.map(|kind| {
        let own = sensor.parameters.iter().filter(move |p| p.kind == kind);
        (kind, own.collect::<Vec<&ParameterResult>>())
    });
    by_axes(
        "Parameters with 95 % intervals",
        &html! { (name) ", ± of 95 %" },
        &html! { @for (kind, triple) in rows {
            @if let Some(first) = triple.first() {
                @let unit = readable::parameter(&first.unit);
                tr { td { "  " (super::fit::by_axis(kind, &unit)) } @for p in &triple { (interval(p.estimate.value, p.estimate.upper - p.estimate.value, unit.factor)) } }
            }
        } },
    )
}
