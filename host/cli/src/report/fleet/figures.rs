//! Figures of a fleet: histograms of its parameters, and control charts.

use jiff::civil::Date;
use maud::{Markup, html};
use mimu::quantity::Sensor;
use mimu_fleet::result::{ChartOfParameter, ParameterOfFleet};

use super::tables::{parameter, readable};
use crate::report::svg::{Chart, Panel, range};

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
    let (by, counts) = (readable.factor, &of.histogram.counts);
    let total = counts.iter().sum::<usize>() as f64;
    let most = counts.iter().max().map_or(1, |most| (*most).max(1));
    let (low, width) = ((of.histogram.from - of.mean) * by, of.histogram.width * by);
    let (from, to) = (low, low + width * counts.len() as f64);
    let frame = SMALL.frame(from..to, 0.0..1.08 * most as f64);
    let name = parameter(sensor, &of.name);
    let sigma = of
        .sigma
        .hypot(of.fit_sigma)
        .hypot(of.within_sigma.unwrap_or(0.0))
        * by;
    let highest = total * width / (sigma * std::f64::consts::TAU.sqrt());
    let bell = |x: f64| (highest * (-0.5 * (x / sigma).powi(2)).exp()).min(frame.y.end);
    let steps = (0..=100).map(|k| from + (to - from) * f64::from(k) / 100.0);
    let bar = |(k, count): (usize, &usize)| {
        let [left, right] = [k, k + 1].map(|k| frame.at_x(low + width * k as f64));
        let (top, bottom) = (frame.at_y(*count as f64), frame.down.end);
        format!(
            "M{:.1} {bottom:.1}V{top:.1}H{:.1}V{bottom:.1}z",
            left + 0.4,
            right - 0.4
        )
    };
    let filled = counts.iter().enumerate().filter(|(_, count)| **count > 0);
    let inside = html! {
        path class="bars" d=(filled.map(bar).collect::<String>()) {}
        (frame.line("fit", steps.map(|x| (x, bell(x)))))
    };
    let label = format!("Histogram of {name} over the units");
    let x_name = format!("from the mean, {}", readable.unit);
    let chart = Chart::new(frame, [&name, &x_name, ""]);
    SMALL.drawing(&label, Some("many"), &chart.drawn(&html! {}, &inside))
}

/// A control chart: means of days, their moving average, and its limits.
pub(super) fn chart(of: &ChartOfParameter, heading: &str) -> Markup {
    let readable = readable(of.unit);
    let days: Vec<Date> = of.days.iter().filter_map(|d| d.parse().ok()).collect();
    let Some((first, last)) = days.first().zip(days.last()) else {
        return html! {};
    };
    let number = |day: &Date| day.since(*first).map_or(0.0, |span| span.get_days().into());
    let at: Vec<f64> = days.iter().map(number).collect();
    let scaled =
        |values: &[f64]| -> Vec<f64> { values.iter().map(|x| x * readable.factor).collect() };
    let [means, averages, limits] = [&of.means, &of.averages, &of.limits].map(|v| scaled(v));
    // Single days scatter more than their average; most are inside of three times the limits.
    let largest = limits
        .iter()
        .chain(&averages)
        .map(|v| v.abs())
        .fold(0.0, f64::max);
    let means = means
        .iter()
        .map(|mean| mean.clamp(-2.5 * largest, 2.5 * largest));
    let ends = means
        .clone()
        .chain(limits.iter().flat_map(|l| [-l, *l]))
        .chain(averages.clone());
    let frame = CHART.frame(at[0]..at[at.len() - 1].max(1.0), range(ends));
    // About five dates.
    let length = number(last).max(1.0) as i64;
    let step = (length / 4).max(1);
    let date = |k: i64| first.checked_add(jiff::Span::new().days(k * step)).ok();
    let dates = (0..=length / step)
        .filter_map(date)
        .map(|day| (number(&day), day.to_string()));
    let dates: Vec<(f64, String)> = dates.collect();
    let since = of.since.iter().filter_map(|s| s.parse::<Date>().ok());
    let spans: Vec<(f64, f64)> = since.map(|day| (number(&day), frame.x.end)).collect();
    let inside = html! {
        (frame.dots("dot small", at.iter().copied().zip(means)))
        @for sign in [1.0, -1.0] { (frame.line("limit", at.iter().copied().zip(limits.iter().map(|l| sign * l)))) }
        (frame.line("fit", at.iter().copied().zip(averages.iter().copied())))
    };
    let behind = frame.spans("block", &spans);
    let title = format!("{heading}, {}", readable.unit);
    let chart = Chart {
        numbers: Some(dates),
        ..Chart::new(frame, [&title, "", ""])
    };
    let label = format!("Control chart of {heading}");
    CHART.drawing(&label, Some("many"), &chart.drawn(&behind, &inside))
}
