//! A fit by a trajectory.

use maud::{Markup, html};
use mimu::judgement::Judgement;
use mimu::parameter::ParameterKind;
use mimu::quantity::significant;
use mimu::readable;
use mimu_body::result::{BodyResult, ParameterResult, TriadResult};
use mimu_body::trajectory::TrajectoryResult;

use super::body::section;
use super::page::judged;
use super::table::{by_axes, interval};
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
        p.line { "the intervals are of this recording: what the instrument errs by elsewhere shows another one (mimu verify --trajectory)" }
        @if by.quaternions != "unit to reference" { p.line { "its quaternions turn from the reference to the unit" } }
    })
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
