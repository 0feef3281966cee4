//! Figures of a fleet: histograms of its parameters, and control charts.

use std::fmt::Write as _;

use jiff::civil::Date;
use maud::{Markup, html};
use mimu::quantity::Sensor;
use mimu_fleet::result::{ChartOfParameter, ParameterOfFleet};

use super::tables::{parameter, readable};
use crate::report::svg::{Frame, Panel, px, range, ticks};

/// A small panel: three stand side by side.
const SMALL: Panel = Panel {
    size: (400.0, 190.0),
    room: [58.0, 8.0, 26.0, 36.0],
};
/// A control chart.
const CHART: Panel = Panel {
    size: (560.0, 220.0),
    room: [66.0, 34.0, 26.0, 24.0],
};

/// Histogram of a parameter over the units, minus its mean, with the normal distribution of units and fit.
pub(super) fn histogram(sensor: Sensor, of: &ParameterOfFleet) -> Markup {
    let readable = readable(of.unit);
    let by = readable.factor;
    let bins = &of.histogram;
    let total: usize = bins.counts.iter().sum();
    let most = *bins.counts.iter().max().unwrap_or(&1);
    let low = (bins.from - of.mean) * by;
    let width = bins.width * by;
    let frame = SMALL.frame(
        low..low + width * bins.counts.len() as f64,
        0.0..1.08 * most.max(1) as f64,
    );
    let name = parameter(sensor, &of.name);
    let sigma = of
        .sigma
        .hypot(of.fit_sigma)
        .hypot(of.within_sigma.unwrap_or(0.0))
        * by;
    let bell = |x: f64| {
        total as f64 * width * (-0.5 * (x / sigma).powi(2)).exp()
            / (sigma * std::f64::consts::TAU.sqrt())
    };
    let steps =
        (0..=100).map(|k| frame.x.start + (frame.x.end - frame.x.start) * f64::from(k) / 100.0);
    let inside = html! {
        (frame.axes(&name, true))
        path class="bars" d=(bars(&frame, low, width, &bins.counts)) {}
        (frame.line("fit", steps.map(|x| (x, bell(x).min(frame.y.end)))))
        (frame.x_name(&format!("from the mean, {}", readable.unit), &frame))
    };
    SMALL.drawing(
        &format!("Histogram of {name} over the units"),
        Some("many"),
        &inside,
    )
}

fn bars(frame: &Frame, low: f64, width: f64, counts: &[usize]) -> String {
    let mut d = String::new();
    for (k, count) in counts.iter().enumerate().filter(|(_, c)| **c > 0) {
        let [left, right] = [k, k + 1].map(|k| frame.at_x(low + width * k as f64));
        let (top, bottom) = (frame.at_y(*count as f64), frame.down.end);
        let _ = write!(
            d,
            "M{:.1} {bottom:.1}V{top:.1}H{:.1}V{bottom:.1}z",
            left + 0.4,
            right - 0.4
        );
    }
    d
}

/// A control chart: means of days, their moving average, and its limits.
pub(super) fn chart(of: &ChartOfParameter, heading: &str) -> Markup {
    let readable = readable(of.unit);
    let by = readable.factor;
    let days: Vec<Date> = of.days.iter().filter_map(|d| d.parse().ok()).collect();
    let Some((first, last)) = days.first().zip(days.last()) else {
        return html! {};
    };
    let number = |day: &Date| {
        day.since(*first)
            .map_or(0.0, |span| f64::from(span.get_days()))
    };
    let at: Vec<f64> = days.iter().map(number).collect();
    let scaled = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| x * by).collect() };
    let [means, averages, limits] = [&of.means, &of.averages, &of.limits].map(|v| scaled(v));
    // Single days scatter more than their average; most are inside of three times the limits.
    let widest = limits
        .iter()
        .copied()
        .fold(0.0, f64::max)
        .max(averages.iter().map(|a| a.abs()).fold(0.0, f64::max));
    let shown = |v: f64| v.clamp(-2.5 * widest, 2.5 * widest);
    let ends = means
        .iter()
        .map(|m| shown(*m))
        .chain(limits.iter().flat_map(|l| [-l, *l]))
        .chain(averages.iter().copied());
    let frame = CHART.frame(at[0]..at[at.len() - 1].max(1.0), range(ends));
    let labels = dates(*first, *last, &number);
    let since = of
        .since
        .iter()
        .filter_map(|s| s.parse::<Date>().ok())
        .map(|s| number(&s));
    let spans: Vec<(f64, f64)> = since.map(|from| (from, frame.x.end)).collect();
    let title = format!("{heading}, {}", readable.unit);
    let ordinate = ticks(&frame.y, 5);
    let inside = html! {
        (frame.spans("block", &spans))
        (frame.grid(&title, &labels, &ordinate, true))
        path class="zero" d={ "M" (px(frame.across.start)) " " (px(frame.at_y(0.0))) "H" (px(frame.across.end)) } {}
        (frame.dots("dot small", at.iter().copied().zip(means.iter().map(|m| shown(*m)))))
        (frame.line("limit", at.iter().copied().zip(limits.iter().copied())))
        (frame.line("limit", at.iter().copied().zip(limits.iter().map(|l| -l))))
        (frame.line("fit", at.iter().copied().zip(averages.iter().copied())))
    };
    CHART.drawing(
        &format!("Control chart of {heading}"),
        Some("many"),
        &inside,
    )
}

/// About five dates between two days, with their places.
fn dates(first: Date, last: Date, number: &dyn Fn(&Date) -> f64) -> Vec<(f64, String)> {
    let days = number(&last).max(1.0) as i64;
    let step = (days / 4).max(1);
    let each =
        (0..=days / step).filter_map(|k| first.checked_add(jiff::Span::new().days(k * step)).ok());
    each.map(|day| (number(&day), day.to_string())).collect()
}
