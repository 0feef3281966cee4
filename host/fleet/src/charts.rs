//! Control charts of all parameters: of labels against the others of the same days, then of all units.

use std::collections::BTreeMap;

use jiff::civil::Date;

use crate::drift::{self, Chart, Day};
use crate::levels::Levels;
use crate::result::{ChangedLevel, ChartOfParameter, DifferentLevel, Drift};
use crate::robust;
use crate::tree::Measurement;
use crate::triad::Triad;

/// Most levels of a label that are compared day by day: batches come and go.
const MOST_LEVELS: usize = 20;

/// Charts.
pub struct Charts {
    /// Labels that changed.
    pub changed: Vec<ChangedLevel>,
    /// Of all units.
    pub drift: Option<Drift>,
}

/// Values that charts are made of.
struct Series<'a> {
    triads: &'a [Triad],
    /// Days in order.
    days: Vec<Date>,
    /// Number of the day of each measurement.
    day: Vec<Option<usize>>,
    /// Whether a measurement is in no chart.
    excluded: Vec<bool>,
    limit: f64,
}

/// A parameter: numbers of triad and parameter.
type Of = (usize, usize);

/// A level that differs from the others since a day.
struct Changed<'l> {
    level: &'l String,
    of: Of,
    chart: Chart,
    change: f64,
}

/// The charts of all measurements but those that are left out, and of labels that differ.
pub fn charts(
    all: &[Measurement],
    triads: &[Triad],
    labels: &BTreeMap<String, Levels>,
    different: &[DifferentLevel],
    is_left_out: &[bool],
) -> Charts {
    let mut days: Vec<Date> = all.iter().filter_map(|m| m.day).collect();
    days.sort_unstable();
    days.dedup();
    if days.len() < drift::FEWEST {
        return Charts {
            changed: Vec::new(),
            drift: None,
        };
    }
    let day = |m: &Measurement| days.binary_search(&m.day?).ok();
    let compared: Vec<(&String, &Levels)> = labels
        .iter()
        .filter(|(_, l)| (2..=MOST_LEVELS).contains(&l.len()))
        .collect();
    let parameters: usize = triads.iter().map(Triad::n).sum();
    let count: usize = compared.iter().map(|(_, l)| l.len()).sum::<usize>() + 1;
    let mut series = Series {
        triads,
        day: all.iter().map(day).collect(),
        excluded: is_left_out.to_vec(),
        limit: drift::limit(parameters * count * days.len()),
        days,
    };
    let mut changed = Vec::new();
    for (label, levels) in compared {
        while let Some(found) = series.most_changed(levels) {
            let since = found.chart.since.map(|k| found.chart.points[k].day);
            for m in &levels[found.level] {
                series.excluded[*m] |= all[*m].day >= since;
            }
            changed.push(ChangedLevel {
                label: label.clone(),
                level: found.level.clone(),
                chart: ChartOfParameter {
                    change: Some(found.change),
                    ..series.result(found.of, &found.chart)
                },
            });
            if changed.len() > parameters * count {
                break;
            }
        }
    }
    series.leave_out_different(labels, different);
    let each = (0..triads.len()).flat_map(|t| (0..triads[t].n()).map(move |i| (t, i)));
    let of_all: Vec<ChartOfParameter> = each
        .filter_map(|of| Some(series.result(of, &series.of_all(of)?)))
        .collect();
    let drift = (!of_all.is_empty()).then(|| Drift {
        lambda: drift::LAMBDA,
        limit: series.limit,
        undated: all.iter().filter(|m| m.day.is_none()).count(),
        charts: of_all,
    });
    Charts { changed, drift }
}

impl Series<'_> {
    /// Leaves out levels that differ, if most measurements have other levels of the label: if all operators differ, none of them is the bad one.
    fn leave_out_different(
        &mut self,
        labels: &BTreeMap<String, Levels>,
        different: &[DifferentLevel],
    ) {
        for (label, levels) in labels {
            let own = different.iter().filter(|d| d.label == *label);
            let mut members: Vec<usize> = own
                .filter_map(|d| levels.get(&d.level))
                .flatten()
                .copied()
                .collect();
            members.sort_unstable();
            members.dedup();
            let all: usize = levels.values().map(Vec::len).sum();
            if 2 * members.len() < all {
                members.into_iter().for_each(|m| self.excluded[m] = true);
            }
        }
    }

    fn value(&self, m: usize, (t, i): Of) -> Option<f64> {
        let estimates = self.triads[t].estimates[m].as_ref();
        estimates.filter(|_| !self.excluded[m]).map(|e| e.values[i])
    }

    fn sigma(&self, (t, i): Of) -> f64 {
        self.triads[t].of_one()[(i, i)].sqrt()
    }

    /// Count and sum of the values of each day.
    fn daily(&self, members: impl Iterator<Item = usize>, of: Of, centre: f64) -> Vec<(f64, f64)> {
        let mut days = vec![(0.0, 0.0); self.days.len()];
        for m in members {
            if let (Some(day), Some(value)) = (self.day[m], self.value(m, of)) {
                days[day].0 += 1.0;
                days[day].1 += value - centre;
            }
        }
        days
    }

    /// The chart of all units.
    fn of_all(&self, of: Of) -> Option<Chart> {
        let dated = (0..self.day.len()).filter(|m| self.day[*m].is_some());
        let mut values: Vec<f64> = dated.filter_map(|m| self.value(m, of)).collect();
        let centre = robust::median(&mut values);
        let days = self
            .daily(0..self.day.len(), of, centre)
            .into_iter()
            .zip(&self.days);
        let days = days.filter(|((count, _), _)| *count > 0.0);
        let mut days: Vec<Day> = days
            .map(|((count, sum), day)| Day {
                day: *day,
                count,
                mean: sum / count,
            })
            .collect();
        drift::chart_about_beginning(&mut days, self.sigma(of), self.limit)
    }

    /// Differences of a level from the others of the same days.
    fn against_others(
        &self,
        members: &[usize],
        all: &[(f64, f64)],
        of: Of,
        centre: f64,
    ) -> Vec<Day> {
        let own = self.daily(members.iter().copied(), of, centre);
        let each = self
            .days
            .iter()
            .zip(&own)
            .zip(all)
            .filter_map(|((day, own), all)| {
                let others = (all.0 - own.0, all.1 - own.1);
                (own.0 > 0.0 && others.0 > 0.0).then(|| Day {
                    day: *day,
                    count: 1.0 / (1.0 / own.0 + 1.0 / others.0),
                    mean: own.1 / own.0 - others.1 / others.0,
                })
            });
        each.collect()
    }

    /// The level with the largest step against the others, if chance explains none so large; with its chart about the mean before.
    fn most_changed<'l>(&self, levels: &'l Levels) -> Option<Changed<'l>> {
        let mut most: Option<(Changed, f64)> = None;
        for t in 0..self.triads.len() {
            for i in 0..self.triads[t].n() {
                let of = (t, i);
                let centre = self.triads[t].population.mean[i];
                let all = self.daily(levels.values().flatten().copied(), of, centre);
                for (level, members) in levels {
                    let mut days = self.against_others(members, &all, of, centre);
                    let sigma = self.sigma(of);
                    let Some(step) = drift::step(&days, sigma) else {
                        continue;
                    };
                    if step.size < most.as_ref().map_or(self.limit, |m| m.1) {
                        continue;
                    }
                    days.iter_mut().for_each(|d| d.mean -= step.before);
                    let Some(chart) = drift::chart(&days, sigma, self.limit) else {
                        continue;
                    };
                    let since = Some(step.first);
                    let chart = Chart { since, ..chart };
                    let change = step.after - step.before;
                    most = Some((
                        Changed {
                            level,
                            of,
                            chart,
                            change,
                        },
                        step.size,
                    ));
                }
            }
        }
        most.map(|m| m.0)
    }

    fn result(&self, (t, i): Of, chart: &Chart) -> ChartOfParameter {
        of_parameter(&self.triads[t], i, chart)
    }
}

/// The chart of parameter `i` of a triad, as in the result.
pub fn of_parameter(triad: &Triad, i: usize, chart: &Chart) -> ChartOfParameter {
    let basis = &triad.basis;
    let day = |k: Option<usize>| k.map(|k| chart.points[k].day.to_string());
    let change = chart.signal.and_then(|s| {
        let after = chart.points[s..].iter().map(|p| p.average);
        after.max_by(|a, b| a.abs().total_cmp(&b.abs()))
    });
    ChartOfParameter {
        sensor: basis.sensor,
        parameter: basis.parameter(i).to_string(),
        unit: basis.unit(i),
        between_days: chart.between_days,
        sigma: triad.of_one()[(i, i)].sqrt(),
        signal: day(chart.signal),
        since: day(chart.since),
        change,
        days: chart.points.iter().map(|p| p.day.to_string()).collect(),
        means: chart.points.iter().map(|p| p.mean).collect(),
        averages: chart.points.iter().map(|p| p.average).collect(),
        limits: chart.points.iter().map(|p| p.limit).collect(),
    }
}
