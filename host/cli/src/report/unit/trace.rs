//! The raw readings over time, with the dwells.

use maud::{Markup, html};
use mimu::prepared::Prepared;
use mimu::quantity::{AXES, Sensor};

use crate::report::page::spoken;
use crate::report::svg::{Panel, range};

/// Largest number of points of a curve. If there are more blocks, the minima and maxima of neighbours are drawn.
const POINTS: usize = 600;
const CLASSES: [&str; 3] = ["axis-x", "axis-y", "axis-z"];
const MINUTE_S: f64 = 60.0;

/// Raw readings of both sensors.
pub fn figure(prepared: &Prepared) -> Markup {
    let unit = prepared.manifest.raw_unit;
    let used = |sensor| {
        let all = prepared.dwells.list.iter();
        all.filter(|d| d.faults[sensor].is_none()).count()
    };
    html! {
        figure {
            div class="figures" {
                @for sensor in Sensor::BOTH {
                    @if prepared.condensed.has_raw[sensor.channels()].contains(&true) {
                        (drawn(prepared, sensor, &unit.to_string()))
                    }
                }
            }
            figcaption {
                "Raw readings. Shaded: dwells that were used, "
                (used(Sensor::Gyro)) " for the gyro and " (used(Sensor::Accel)) " for the accelerometer of " (prepared.dwells.list.len()) "."
            }
        }
    }
}

fn drawn(prepared: &Prepared, sensor: Sensor, unit: &str) -> Markup {
    let blocks = &prepared.condensed.blocks;
    let every = blocks.len().div_ceil(POINTS).max(1);
    let curve = |channel: usize| -> Vec<(f64, f64)> {
        let each = blocks.chunks(every).map(|few| {
            let means = || {
                few.iter()
                    .map(|b| b.raw[channel].mean)
                    .filter(|m| m.is_finite())
            };
            let t = few[0].start_s / MINUTE_S;
            let (low, high) = (
                means().fold(f64::INFINITY, f64::min),
                means().fold(f64::NEG_INFINITY, f64::max),
            );
            match every {
                1 => vec![(t, low)],
                _ => vec![(t, low), (t, high)],
            }
        });
        each.flatten().filter(|p| p.1.is_finite()).collect()
    };
    let curves: Vec<_> = sensor.channels().map(curve).collect();
    let panel = Panel::ONE;
    let frame = panel.frame(
        range(blocks.iter().map(|b| b.start_s / MINUTE_S)),
        range(curves.iter().flatten().map(|p| p.1)),
    );
    let dwells: Vec<(f64, f64)> = prepared
        .dwells
        .list
        .iter()
        .filter(|d| d.faults[sensor].is_none())
        .map(|d| (d.start_s / MINUTE_S, (d.start_s + d.duration_s) / MINUTE_S))
        .collect();
    let unit = if unit == "SI" { sensor.unit() } else { unit };
    let entries: Vec<(&str, &str)> = CLASSES.into_iter().zip(AXES).collect();
    panel.drawing(
        &format!("raw {sensor} over time"),
        None,
        &html! {
            (frame.spans("block", &dwells))
            (frame.axes(spoken(sensor), true))
            (frame.y_name(&format!("reading, {unit}")))
            (frame.x_name("time, min", &frame))
            @for (class, curve) in CLASSES.iter().zip(&curves) { (frame.line(class, curve.iter().copied())) }
            (frame.legend(&entries))
        },
    )
}
