//! The raw readings over time, with the dwells.

use maud::{Markup, html};
use mimu::{AXES, Prepared, Sensor};

use crate::report::page::spoken;
use crate::report::svg::{AXIS_CLASSES, Chart, Panel, range};

/// Largest number of points of a curve. If there are more blocks, the minima and maxima of neighbours are drawn.
const POINTS: usize = 600;
const MINUTE_S: f64 = 60.0;

/// Raw readings of both sensors.
pub fn figure(prepared: &Prepared) -> Markup {
    let all = &prepared.dwells.list;
    let used = |sensor| all.iter().filter(|d| d.faults[sensor].is_none()).count();
    let recorded = |sensor: &Sensor| prepared.condensed.has_raw[sensor.channels()].contains(&true);
    html! { figure {
        div class="figures" { @for sensor in Sensor::BOTH.into_iter().filter(recorded) { (drawn(prepared, sensor)) } }
        figcaption {
            "Raw readings. Shaded: dwells that were used, " (used(Sensor::Gyro)) " for the gyro and " (used(Sensor::Accel)) " for the accelerometer of " (all.len()) "."
        }
    } }
}

fn drawn(prepared: &Prepared, sensor: Sensor) -> Markup {
    let blocks = &prepared.condensed.blocks;
    let every = blocks.len().div_ceil(POINTS).max(1);
    let curve = |channel: usize| -> Vec<(f64, f64)> {
        let each = blocks.chunks(every).flat_map(|few| {
            let means = || {
                few.iter()
                    .map(|b| b.raw[channel].mean)
                    .filter(|m| m.is_finite())
            };
            let t = few[0].start_s / MINUTE_S;
            let ends = [
                (t, means().fold(f64::INFINITY, f64::min)),
                (t, means().fold(f64::NEG_INFINITY, f64::max)),
            ];
            ends.into_iter().take(every.min(2))
        });
        each.filter(|p| p.1.is_finite()).collect()
    };
    let curves: Vec<_> = sensor.channels().map(curve).collect();
    let all = prepared.dwells.list.iter();
    let used = all.filter(|d| d.faults[sensor].is_none());
    let minutes = |s: f64| s / MINUTE_S;
    let ends = used.map(|d| (minutes(d.start_s), minutes(d.start_s + d.duration_s)));
    let dwells: Vec<(f64, f64)> = ends.collect();
    let unit = match prepared.manifest.raw_unit.to_string() {
        unit if unit == "SI" => sensor.unit().into(),
        unit => unit,
    };
    let minutes = range(blocks.iter().map(|b| b.start_s / MINUTE_S));
    let frame = Panel::ONE.frame(minutes, range(curves.iter().flatten().map(|p| p.1)));
    let y_name = format!("reading, {unit}");
    let chart = Chart::new(frame, [spoken(sensor), "time, min", &y_name])
        .keyed(AXIS_CLASSES.into_iter().zip(AXES));
    let lines = html! { @for (class, curve) in AXIS_CLASSES.iter().zip(&curves) { (chart.frame.line(class, curve.iter().copied())) } };
    let drawn = chart.drawn(&chart.frame.spans("block", &dwells), &lines);
    Panel::ONE.drawing(&format!("raw {sensor} over time"), None, &drawn)
}
