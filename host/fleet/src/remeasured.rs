//! Units that are measured on many days, as a golden unit is at the start of each shift: those that change with time, each against itself.
//!
//! The scatter between units is no matter here, so a tenth of it is seen: a golden unit that ages, or a station that does.

use std::collections::BTreeMap;

use jiff::civil::Date;

use crate::drift::{self, Chart, Day};
use crate::robust;
use crate::tree::Measurement;
use crate::triad::Estimated;

/// A parameter of a unit that changes.
pub struct Change {
    /// Number of the unit.
    pub unit: usize,
    /// Numbers of triad and parameter.
    pub of: (usize, usize),
    /// Its chart, about the mean before the change.
    pub chart: Chart,
}

/// Parameters that change, of the units that are measured on [`drift::FEWEST`] days or more; those of a unit by the size of the change.
pub fn changes(all: &[Measurement], units: &[Vec<usize>], triads: &[Estimated]) -> Vec<Change> {
    let days: Vec<BTreeMap<Date, Vec<usize>>> = units.iter().map(|u| by_day(all, u)).collect();
    let on_many = || {
        days.iter()
            .enumerate()
            .filter(|d| d.1.len() >= drift::FEWEST)
    };
    let parameters: usize = triads.iter().map(Estimated::n).sum();
    let limit = drift::limit(parameters * on_many().map(|d| d.1.len()).sum::<usize>());
    let mut found = Vec::new();
    for (unit, days) in on_many() {
        let of_unit = (0..triads.len()).flat_map(|t| (0..triads[t].n()).map(move |i| (t, i)));
        let charts = of_unit.filter_map(|(t, i)| {
            let chart = own_chart(&triads[t], i, days, limit)?;
            chart.signal?;
            Some(Change {
                unit,
                of: (t, i),
                chart,
            })
        });
        let mut charts: Vec<Change> = charts.collect();
        charts.sort_by(|a, b| size(&b.chart).total_cmp(&size(&a.chart)));
        found.extend(charts);
    }
    found
}

/// The largest average over its limit.
fn size(chart: &Chart) -> f64 {
    let each = chart.points.iter().map(|p| p.average.abs() / p.limit);
    each.fold(0.0, f64::max)
}

fn by_day(all: &[Measurement], members: &[usize]) -> BTreeMap<Date, Vec<usize>> {
    let mut days: BTreeMap<Date, Vec<usize>> = BTreeMap::new();
    for m in members {
        if let Some(day) = all[*m].day {
            days.entry(day).or_default().push(*m);
        }
    }
    days
}

/// The chart of parameter `i` of a unit about the median of its days, each with the error of its own fits: it differs from fit to fit, and one for all of them would make a day of a
/// poor fit an alarm. What days differ beyond that is estimated of successive ones.
fn own_chart(
    triad: &Estimated,
    i: usize,
    days: &BTreeMap<Date, Vec<usize>>,
    limit: f64,
) -> Option<Chart> {
    let mut points = Vec::with_capacity(days.len());
    for (day, members) in days {
        let own = members.iter().filter_map(|m| triad.estimates[*m].as_ref());
        let (weight, sum) = own.fold((0.0, 0.0), |(weight, sum), e| {
            let by = 1.0 / e.covariance[(i, i)];
            (weight + by, sum + by * e.values[i])
        });
        if weight > 0.0 {
            points.push(Day {
                day: *day,
                // Of values with the standard deviation 1 in the parameter's unit.
                count: weight,
                mean: sum / weight,
            });
        }
    }
    let mut means: Vec<f64> = points.iter().map(|d| d.mean).collect();
    let centre = robust::median(&mut means);
    points.iter_mut().for_each(|d| d.mean -= centre);
    drift::chart_about_beginning(&mut points, 1.0, limit)
}
