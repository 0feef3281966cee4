//! Changes of the parameters of a fit by leaving something out.

use mimu_recording::RawUnit;
use serde::Serialize;

use crate::parameter::{ParameterKind, TriadParameter, parameters};
use crate::quantity::{Sensor, plus_minus};
use crate::readable;
use crate::triad::{Estimate, Triad};
use crate::warning::Warning;

/// A parameter fitted with everything, and without what was left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Its sensor.
    pub sensor: Sensor,
    /// The parameter.
    #[serde(rename = "name")]
    pub parameter: TriadParameter,
    /// Value with everything in the fit.
    pub with_all: f64,
    /// Fitted without what was left out.
    #[serde(flatten)]
    pub fitted: Estimate,
    /// Unit of all numbers.
    pub unit: String,
}

impl Change {
    /// The change in half widths of the fitted 95 % interval.
    fn size(&self) -> f64 {
        (self.with_all - self.fitted.value).abs() / self.fitted.interval.max(f64::MIN_POSITIVE)
    }

    fn text(&self) -> String {
        let shown = readable::parameter(&self.unit);
        let unit = match shown.unit.is_empty() {
            true => String::new(),
            false => format!(" {}", shown.unit),
        };
        format!(
            "{} {} {}{unit} in place of {}",
            self.parameter.0.words(),
            self.parameter.axis(),
            plus_minus(
                self.fitted.value * shown.factor,
                self.fitted.interval * shown.factor
            ),
            crate::quantity::significant(self.with_all * shown.factor)
        )
    }
}

/// Changes of all parameters of `sensor` except those of the inverse model, in the order of lists.
pub(super) fn changes(
    sensor: Sensor,
    raw: RawUnit,
    with_all: &Triad,
    fitted: &Triad,
) -> Vec<Change> {
    let [before, after] = [with_all, fitted].map(|t| parameters(t, sensor, raw));
    let both = before.into_iter().zip(after);
    both.filter(|(before, _)| before.0.0 != ParameterKind::Inverse)
        .map(|((parameter, before, unit), (_, fitted, _))| Change {
            sensor,
            parameter,
            with_all: before.value,
            fitted,
            unit,
        })
        .collect()
}

/// The largest of the `changes` in words: those beyond the fitted interval, at least one and at most three.
pub(super) fn described(changes: &[Change]) -> Option<Warning> {
    let mut largest: Vec<&Change> = changes.iter().filter(|c| c.fitted.interval > 0.0).collect();
    largest.sort_by(|a, b| b.size().total_cmp(&a.size()));
    let sensor = largest.first()?.sensor;
    let moved = largest.iter().filter(|c| c.size() > 1.0).count();
    let shown = &largest[..moved.clamp(1, 3)];
    let shown = shown.iter().map(|c| c.text()).collect();
    Some(
        Warning::LeftOutChanges {
            changed: moved,
            of: largest.len(),
            largest: shown,
        }
        .of(sensor),
    )
}
