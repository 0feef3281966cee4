//! A compensated recording.

use maud::html;
use mimu::{Applied, Sensor, plural, significant};
use mimu_body::aligned::MeanUnit;

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
                    @if let Some(delay) = of.delay_ms { ", moved by its delay of " (significant(delay)) " ms" }
                    @if of.empty > 0 { "; " (plural(of.empty, "sample")) " without a reading or beside one at a rail, left empty" }
                }
            }
        }
        (all_warnings(&applied.warnings))
    })
}

/// The mean unit of an array.
pub fn mean_text(mean: &MeanUnit) -> String {
    let names = |of: &[mimu_recording::TriadName]| {
        of.iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join(", ")
    };
    text(&html! { section {
        p { "gyro and accel are the mean of the first and of " (names(&mean.triads)) }
        @if !mean.left_out.is_empty() { p { "left out of it, because their place on the body is not known: " (names(&mean.left_out)) } }
        @for (sensor, noise) in mean.noise.present() {
            @let [first, all] = noise.map(|rms| significant(rms * if sensor == Sensor::Gyro { 1f64.to_degrees() } else { 1e3 }));
            p { "noise of a reading of " (sensor) ": " (first) " of the first, " (all) " of the mean, " @if sensor == Sensor::Gyro { "deg/s" } @else { "mm/s²" } }
        }
    } })
}
