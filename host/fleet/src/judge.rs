//! The judgement of a fleet.

use mimu::{Judgement, JudgementKind, plural};

use crate::result::Fleet;

/// Most reasons that are named.
const MOST: usize = 4;

/// `suspect` if something contradicts one population, `untested` if too few units could contradict it.
pub fn judge(fleet: &Fleet) -> Judgement {
    let mut reasons = Vec::new();
    if !fleet.strangers.is_empty() {
        let count = plural(fleet.strangers.len() as u64, "unit");
        let verb = if fleet.strangers.len() == 1 {
            "does"
        } else {
            "do"
        };
        reasons.push(format!("{count} {verb} not belong to the population"));
    }
    if !fleet.contradicting.is_empty() {
        let count = plural(fleet.contradicting.len() as u64, "calibration");
        let verb = if fleet.contradicting.len() == 1 {
            "contradicts"
        } else {
            "contradict"
        };
        reasons.push(format!("{count} {verb} others of the same unit"));
    }
    let mut changed: Vec<String> = fleet
        .changed_units
        .iter()
        .map(|c| format!("unit {} changes", c.unit))
        .collect();
    changed.dedup();
    reasons.extend(changed);
    let mut levels: Vec<String> = fleet
        .different
        .iter()
        .map(|d| format!("{} {} differs", d.label, d.level))
        .collect();
    levels.sort();
    levels.dedup();
    reasons.extend(levels);
    reasons.extend(fleet.changed.iter().map(|c| {
        let since = c.chart.since.as_deref().unwrap_or("the first day");
        format!("{} {} changed on {since}", c.label, c.level)
    }));
    reasons.dedup();
    let signals = fleet
        .drift
        .iter()
        .flat_map(|d| &d.charts)
        .filter(|c| c.signal.is_some());
    let count = signals.count();
    if count > 0 {
        reasons.push(format!(
            "production drifts in {}",
            plural(count as u64, "parameter")
        ));
    }
    let rest = reasons.len().saturating_sub(MOST);
    if rest > 0 {
        reasons.truncate(MOST);
        reasons.push(format!("and {}", plural(rest as u64, "other finding")));
    }
    if !reasons.is_empty() {
        return Judgement::new(JudgementKind::Suspect, reasons.join("; "));
    }
    match fleet.sensors.present().find(|(_, t)| !t.jointly) {
        Some((sensor, triad)) => Judgement::new(
            JudgementKind::Untested,
            format!(
                "the {sensor} has {}, too few for covariances between its {}: each parameter is judged alone",
                plural(triad.units as u64, "unit"),
                plural(triad.parameters.len() as u64, "parameter")
            ),
        ),
        None => Judgement::new(
            JudgementKind::Good,
            format!(
                "{} are of one population",
                plural(fleet.units as u64, "unit")
            ),
        ),
    }
}
