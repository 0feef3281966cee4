//! What leaving something out of a fit does to its parameters.

use mimu_recording::RawUnit;

use crate::quantity::{AXES, Sensor, plus_minus, raw_unit, scale_unit};
use crate::readable;
use crate::triad::{Angles, Estimate, Triad};
use crate::warning::Warning;

/// A parameter fitted with everything, and without what was left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Of which sensor.
    pub sensor: Sensor,
    /// Name as in the list of parameters: `scale_x` and the like.
    pub name: String,
    /// Value with everything in the fit.
    pub with_all: f64,
    /// As fitted.
    pub fitted: Estimate,
    /// Unit of all.
    pub unit: String,
}

impl Change {
    /// In half widths of the 95 % interval as fitted.
    fn size(&self) -> f64 {
        (self.with_all - self.fitted.value).abs() / self.fitted.interval.max(f64::MIN_POSITIVE)
    }

    fn text(&self) -> String {
        let shown = readable::parameter(&self.unit);
        let (kind, axis) = self.name.rsplit_once('_').unwrap_or((&self.name, ""));
        let unit = match shown.unit.is_empty() {
            true => String::new(),
            false => format!(" {}", shown.unit),
        };
        format!(
            "{} {axis} {}{unit} in place of {}",
            kind.replace("scale", "scale factor")
                .replace("non_orthogonality", "non-orthogonality"),
            plus_minus(
                self.fitted.value * shown.factor,
                self.fitted.interval * shown.factor
            ),
            crate::quantity::significant(self.with_all * shown.factor)
        )
    }
}

/// All parameters of `sensor`, in the order of lists.
pub(super) fn changes(
    sensor: Sensor,
    raw: RawUnit,
    with_all: &Triad,
    fitted: &Triad,
) -> Vec<Change> {
    let [with_all, fitted] = [with_all, fitted].map(|t| t.physical(Angles::Exact));
    let si = sensor.unit();
    let kinds = [
        (
            "scale",
            AXES,
            with_all.scale,
            fitted.scale,
            scale_unit(raw, si),
        ),
        ("bias", AXES, with_all.bias, fitted.bias, raw_unit(raw, si)),
        (
            "misalignment",
            AXES,
            with_all.misalignment,
            fitted.misalignment,
            "rad".into(),
        ),
        (
            "non_orthogonality",
            ["yz", "zy", "zx"],
            with_all.non_orthogonality,
            fitted.non_orthogonality,
            "rad".into(),
        ),
    ];
    let each = kinds
        .into_iter()
        .flat_map(|(kind, axes, before, after, unit)| {
            (0..3).map(move |k| Change {
                sensor,
                name: format!("{kind}_{}", axes[k]),
                with_all: before[k].value,
                fitted: after[k],
                unit: unit.clone(),
            })
        });
    each.collect()
}

/// The largest of the `changes` in words, at most three and those that leave the interval as fitted.
pub(super) fn described(changes: &[Change]) -> Option<Warning> {
    let mut largest: Vec<&Change> = changes.iter().filter(|c| c.fitted.interval > 0.0).collect();
    largest.sort_by(|a, b| b.size().total_cmp(&a.size()));
    let sensor = largest.first()?.sensor;
    let moved = largest.iter().filter(|c| c.size() > 1.0).count();
    let shown = &largest[..moved.clamp(1, 3)];
    let shown = shown.iter().map(|c| c.text()).collect();
    Some(Warning::LeftOutChanges(moved, largest.len(), shown).of(sensor))
}
