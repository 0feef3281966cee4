//! Figures of a fleet: histograms of its parameters, and control charts.

use jiff::civil::Date;
use maud::{Markup, html};
use mimu::quantity::Sensor;
use mimu_fleet::result::{ChartOfParameter, ParameterOfFleet};

use super::tables::{parameter, readable};
use crate::report::svg::{Panel, px, range, ticks};

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
    let (by, bins) = (readable.factor, &of.histogram);
    let total: usize = bins.counts.iter().sum();
    let most = bins.counts.iter().max().map_or(1, |most| (*most).max(1));
    let (low, width) = ((bins.from - of.mean) * by, bins.width * by);
    let frame = SMALL.frame(
        low..low + width * bins.counts.len() as f64,
        0.0..1.08 * most as f64,
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
    let bars = bins
        .counts
        .iter()
        .enumerate()
        .filter(|(_, count)| **count > 0)
        .map(|(k, count)| {
            let [left, right] = [k, k + 1].map(|k| frame.at_x(low + width * k as f64));
            format!(
                "M{:.1} {bottom:.1}V{:.1}H{:.1}V{bottom:.1}z",
                left + 0.4,
                frame.at_y(*count as f64),
                right - 0.4,
                bottom = frame.down.end
            )
        });
    let inside = html! {
        (frame.axes(&name, true))
        path class="bars" d=(bars.collect::<String>()) {}
        (frame.line("fit", steps.map(|x| (x, bell(x).min(frame.y.end)))))
        (frame.x_name(&format!("from the mean, {}", readable.unit), &frame))
    };
    SMALL.drawing(
        &format!("Histogram of {name} over the units"),
        Some("many"),
        &inside,
    )
}

/// A control chart: means of days, their moving average, and its limits.
pub(super) fn chart(of: &ChartOfParameter, heading: &str) -> Markup {
    let readable = readable(of.unit);
    let days: Vec<Date> = of.days.iter().filter_map(|d| d.parse().ok()).collect();
    let Some((first, last)) = days.first().zip(days.last()) else {
        return html! {};
    };
    let number = |day: &Date| {
        day.since(*first)
            .map_or(0.0, |span| f64::from(span.get_days()))
    };
    let at: Vec<f64> = days.iter().map(number).collect();
    let [means, averages, limits] = [&of.means, &of.averages, &of.limits]
        .map(|v| v.iter().map(|x| x * readable.factor).collect::<Vec<f64>>());
    // Single days scatter more than their average; most are inside of three times the limits.
    let widest = limits
        .iter()
        .chain(&averages)
        .fold(0.0, |most: f64, v| most.max(v.abs()));
    let means = means
        .iter()
        .map(|mean| mean.clamp(-2.5 * widest, 2.5 * widest));
    let ends = means
        .clone()
        .chain(limits.iter().flat_map(|l| [-l, *l]))
        .chain(averages.iter().copied());
    let frame = CHART.frame(at[0]..at[at.len() - 1].max(1.0), range(ends));
    // About five dates.
    let step = (number(last).max(1.0) as i64 / 4).max(1);
    let dates = (0..=number(last).max(1.0) as i64 / step)
        .filter_map(|k| first.checked_add(jiff::Span::new().days(k * step)).ok());
    let dates: Vec<(f64, String)> = dates.map(|day| (number(&day), day.to_string())).collect();
    let since = of.since.iter().filter_map(|s| s.parse::<Date>().ok());
    let spans: Vec<(f64, f64)> = since.map(|day| (number(&day), frame.x.end)).collect();
    let inside = html! {
        (frame.spans("block", &spans))
        (frame.grid(&format!("{heading}, {}", readable.unit), &dates, &ticks(&frame.y, 5), true))
        path class="zero" d={ "M" (px(frame.across.start)) " " (px(frame.at_y(0.0))) "H" (px(frame.across.end)) } {}
        (frame.dots("dot small", at.iter().copied().zip(means)))
        @for sign in [1.0, -1.0] { (frame.line("limit", at.iter().copied().zip(limits.iter().map(|l| sign * l)))) }
        (frame.line("fit", at.iter().copied().zip(averages.iter().copied())))
    };
    CHART.drawing(
        &format!("Control chart of {heading}"),
        Some("many"),
        &inside,
    )
}
