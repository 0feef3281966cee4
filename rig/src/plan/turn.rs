//! A turn by a known angle, as a step of a plan.

use serde::Deserialize;
use toml::Spanned;

use super::reader::{FASTEST_DPS, Reader};
use super::step::RawStep;

/// Axes of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TableAxis {
    /// The vertical one.
    Outer,
    /// The tilt axis.
    Middle,
    /// The axis that carries the board: the body's z axis.
    Inner,
}

impl TableAxis {
    /// Index in lists of outer, middle, inner.
    pub(crate) fn number(self) -> usize {
        match self {
            Self::Outer => 0,
            Self::Middle => 1,
            Self::Inner => 2,
        }
    }

    /// Its name in a plan.
    pub fn name(self) -> &'static str {
        ["outer", "middle", "inner"][self.number()]
    }
}

/// Turn of one axis of the table from rest to rest. The recording numbers it like a dwell, from the first to the last time at which the axis moves,
/// so that the integral of the reference rate over it is the angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Axis of the table.
    pub axis: TableAxis,
    /// Angle by the right-hand rule, rad.
    pub angle: f64,
    /// Rate between the ramps, rad/s.
    pub rate: f64,
}

impl Reader<'_> {
    /// The turn of a step, if it is one.
    pub(super) fn turn(&self, raw: &RawStep) -> Result<Option<Turn>, String> {
        let Some(axis) = &raw.turn_axis else {
            for (key, value) in [("turn_deg", &raw.turn_deg), ("turn_dps", &raw.turn_dps)] {
                if let Some(value) = value {
                    let problem = format!("`{key}` without `turn_axis`");
                    let remedy = "add `turn_axis = \"outer\"`, \"middle\" or \"inner\"";
                    return Err(self.source.error(&value.span(), problem, remedy));
                }
            }
            return Ok(None);
        };
        let needed = |key: &str, value: &Option<Spanned<f64>>, range, unit| match value {
            Some(value) => self.within(key, value, range, unit),
            None => Err(self.source.error(
                &axis.span(),
                format_args!("`{key}` is missing"),
                format_args!("add `{key} = ...`"),
            )),
        };
        let angle = needed("turn_deg", &raw.turn_deg, [-36_000.0, 36_000.0], "degrees")?;
        let range = [0.001, FASTEST_DPS];
        let rate = needed("turn_dps", &raw.turn_dps, range, "degrees per second")?;
        if angle == 0.0 {
            let span = raw.turn_deg.as_ref().map_or(axis.span(), Spanned::span);
            return Err(self.source.error(&span, "`turn_deg` is 0", "give an angle"));
        }
        let foreign = [
            ("dwell_s", raw.dwell_s.as_ref().map(Spanned::span)),
            ("rate_dps", raw.rate_dps.as_ref().map(Spanned::span)),
            ("spin_dps", raw.spin_dps.as_ref().map(Spanned::span)),
            ("poses", raw.poses.as_ref().map(Spanned::span)),
            ("repeat", raw.repeat.as_ref().map(Spanned::span)),
        ];
        for (key, span) in foreign {
            if let Some(span) = span {
                let problem = format!("`{key}` in an entry that turns by an angle");
                let remedy = "remove it, or make it a separate [[step]]";
                return Err(self.source.error(&span, problem, remedy));
            }
        }
        Ok(Some(Turn {
            axis: *axis.get_ref(),
            angle: angle.to_radians(),
            rate: rate.to_radians(),
        }))
    }
}
