//! What the next power-on makes of a calibration: the second interval of every parameter, from [several sessions](crate::sessions).

use serde::{Deserialize, Serialize};

use super::{TriadTable, of_fit};
use crate::judgement::Judgement;
use crate::parameter::ParameterKind;
use crate::quantity::Sensor;
use crate::triad::{Angles, Covariance, Triad};

/// How a calibration of several sessions was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BetweenSessions {
    /// How the variance between sessions was estimated.
    pub method: String,
    /// The class of parts whose prior was used, if fewer than three sessions show how much parameters change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<String>,
    /// Of the values of left-out sessions: how many were inside the 95 % intervals predicted by the others, and of how many.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted: Option<[usize; 2]>,
    /// What does not fit one set of constant parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<String>,
}

/// A session that a calibration was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SessionOrigin {
    /// SHA-256 of its samples file.
    pub sha256: String,
    /// Whether the calibration is made from it: not if it contradicts the others, or took place before a step.
    pub used: bool,
    /// Mean temperature of its dwells, °C, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temp_c: Option<f64>,
    /// The judgement of its own fit.
    pub judgement: Judgement,
}

/// The model at the next power-on: C and o are the same, their uncertainty is larger by what parameters change between sessions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)] // C: the letter of the formula
pub struct NextPowerOn {
    /// Halves of the 95 % intervals of C.
    pub interval_C: [[f64; 3]; 3],
    /// Halves of the 95 % intervals of o.
    pub interval_o: [f64; 3],
    /// Standard deviations of o. With few sessions an interval has more than 1.96 of them to each side.
    pub sigma_o: [f64; 3],
    /// Halves of the 95 % intervals of the scale factors, raw per SI.
    pub interval_scale_factor: [f64; 3],
    /// The same of the biases, raw.
    pub interval_bias: [f64; 3],
    /// The same of the misalignments, degrees.
    pub interval_misalignment_deg: [f64; 3],
    /// The same of the non-orthogonalities, degrees.
    pub interval_non_orthogonality_deg: [f64; 3],
    /// 12x12, in the order of the covariance above.
    pub covariance: Vec<Vec<f64>>,
}

impl NextPowerOn {
    /// Of a triad with the uncertainty of the next power-on.
    pub fn of(triad: &Triad) -> Self {
        let inverse = triad.inverse_estimates();
        let physical = triad.physical(Angles::Exact);
        let half = |k: usize| of_fit::uncertainty(inverse[k].interval);
        let triple = |all: &[crate::triad::Estimate; 3], unit: f64| {
            all.map(|e| of_fit::uncertainty(e.interval * unit))
        };
        let degrees = 1f64.to_degrees();
        Self {
            interval_C: [0, 3, 6].map(|i| [i, i + 1, i + 2].map(half)),
            interval_o: [9, 10, 11].map(half),
            sigma_o: [9, 10, 11].map(|k| of_fit::uncertainty(inverse[k].sigma)),
            interval_scale_factor: triple(&physical.scale, 1.0),
            interval_bias: triple(&physical.bias, 1.0),
            interval_misalignment_deg: triple(&physical.misalignment, degrees),
            interval_non_orthogonality_deg: triple(&physical.non_orthogonality, degrees),
            covariance: of_fit::nested(&triad.inverse_covariance),
        }
    }

    /// Halves of the 95 % intervals of a kind of physical parameter, as in the file.
    pub fn intervals(&self, kind: ParameterKind) -> Option<[f64; 3]> {
        match kind {
            ParameterKind::Scale => Some(self.interval_scale_factor),
            ParameterKind::Bias => Some(self.interval_bias),
            ParameterKind::Misalignment => Some(self.interval_misalignment_deg),
            ParameterKind::NonOrthogonality => Some(self.interval_non_orthogonality_deg),
            ParameterKind::Inverse | ParameterKind::BiasAndGravity => None,
        }
    }

    /// Half-width of a 95 % interval in standard deviations.
    pub fn interval_sigmas(&self) -> f64 {
        let sum = |all: [f64; 3]| all.iter().sum::<f64>();
        let ratio = sum(self.interval_o) / sum(self.sigma_o);
        if ratio.is_finite() { ratio } else { 1.96 }
    }

    fn matrix(&self) -> Option<Covariance> {
        let square = self.covariance.len() == 12 && self.covariance.iter().all(|r| r.len() == 12);
        square.then(|| Covariance::from_fn(|i, j| self.covariance[i][j]))
    }

    /// What is wrong with it, if anything.
    pub(super) fn fault(&self) -> Option<&'static str> {
        let numbers = || self.covariance.iter().flatten();
        match self.matrix() {
            None => Some("next_power_on.covariance is not 12 by 12"),
            Some(_) if !numbers().all(|x| x.is_finite()) => {
                Some("next_power_on.covariance has an entry that is not a number")
            }
            Some(_) => None,
        }
    }
}

impl super::Calibration {
    /// Covariance of C by rows, then o, and the half-width of a 95 % interval in standard deviations. `None` if it is not known.
    pub fn uncertainty(&self, sensor: Sensor) -> Option<(Covariance, f64)> {
        let table = self.table(sensor)?;
        let sum = |all: Option<[f64; 3]>| all.map(|a| a.iter().sum::<f64>());
        let sigmas = sum(table.interval_o)? / sum(table.sigma_o)?;
        Some((
            self.covariance(sensor)?,
            if sigmas.is_finite() { sigmas } else { 1.96 },
        ))
    }

    /// Covariance of C by rows, then o, at the next power-on, and the half-width of a 95 % interval in standard deviations. `None` for a calibration of one
    /// session, which does not show how much parameters change.
    pub fn next_power_on(&self, sensor: Sensor) -> Option<(Covariance, f64)> {
        let next = self.table(sensor)?.next_power_on.as_ref()?;
        Some((next.matrix()?, next.interval_sigmas()))
    }
}

impl TriadTable {
    /// The table of the same model with the uncertainty at the next power-on beside it.
    pub(super) fn with_next_power_on(self, triad: &Triad) -> Self {
        Self {
            next_power_on: Some(NextPowerOn::of(triad)),
            ..self
        }
    }
}
