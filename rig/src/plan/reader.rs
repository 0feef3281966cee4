//! Range checks for numbers of a plan.

use toml::Spanned;

use crate::located::{Source, written};

/// More than any centrifuge for boards, degrees per second.
pub(super) const FASTEST_DPS: f64 = 36_000.0;

/// Checks values after parsing.
pub(super) struct Reader<'a> {
    pub(super) source: &'a Source,
}

impl Reader<'_> {
    pub(super) fn within(
        &self,
        key: &str,
        value: &Spanned<f64>,
        [low, high]: [f64; 2],
        unit: &str,
    ) -> Result<f64, String> {
        let x = *value.get_ref();
        if x >= low && x <= high {
            return Ok(x);
        }
        let problem = format!("`{key}` is {}", written(x));
        let remedy = format_args!("give {low} to {high} {unit}");
        Err(self.source.error(&value.span(), problem, remedy))
    }

    /// As [`Reader::within`], 0 if missing, and in radians.
    pub(super) fn angle(
        &self,
        key: &str,
        value: &Option<Spanned<f64>>,
        most: f64,
        unit: &str,
    ) -> Result<f64, String> {
        let degrees = value
            .as_ref()
            .map(|v| self.within(key, v, [-most, most], unit));
        Ok(degrees.transpose()?.unwrap_or(0.0).to_radians())
    }
}
