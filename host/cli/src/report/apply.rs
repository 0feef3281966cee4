//! A compensated recording.

use maud::html;
use mimu::calibration::apply::Applied;
use mimu::quantity::plural;

use super::page::all_warnings;
use super::terminal::text;

/// Result of `mimu apply`.
pub fn apply_text(applied: &Applied) -> String {
    let sensors = [
        ("gyro", applied.sensors.gyro),
        ("accel", applied.sensors.accel),
    ];
    text(&html! {
        p { (applied.recording) ": " (plural(applied.rows, "row")) ", compensated, rad/s and m/s²" }
        section {
            @if let Some(judgement) = &applied.judgement { p { "calibration: " (judgement) } }
            @if !applied.effects.is_empty() { p { "effects removed: " (applied.effects.join(", ")) } }
            @for (name, counts) in sensors.into_iter().filter_map(|(name, counts)| Some((name, counts?))) {
                @for (n, why) in [(counts.empty, "without a reading"), (counts.clipped, "at a rail")] {
                    @if n > 0 { p { (name) ": " (plural(n, "sample")) " " (why) ", left empty" } }
                }
            }
        }
        section {
            @for of in &applied.body {
                p {
                    (of.triad) ": in " (of.unit) ", "
                    @if let Some(frame) = of.frame { "in the frame of " (frame) } @else { "in its own frame" }
                    @if of.empty > 0 { "; " (plural(of.empty, "sample")) " without a reading, left empty" }
                }
            }
        }
        (all_warnings(&applied.warnings))
    })
}
