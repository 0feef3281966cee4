//! What the population of a unit's kind says of the parameters of a design.
//!
//! The prior of a fit ([`crate::prior`]) is a group of rows beside those of the dwells. Here they are linearised about the unit in the middle of the
//! population, whose readings in SI a further unit turns into `(1 + D) x + d`: D and d are the parameters of a design. The rows are in standard deviations
//! of the population, and those of dwells in sigmas of a dwell mean. So what the population is worth depends on the noise and on the length of a dwell, and
//! the information is regular from the first dwell on (Bayesian D-optimality: Chaloner and Verdinelli, Statistical Science 10, 1995).

use nalgebra::{DMatrix, SVector};

use super::model::Model;
use crate::observation::{LOWER, free, of_output};
use crate::parameter::ParameterKind;
use crate::prior::Prior;
use crate::quantity::Sensor;
use mimu_recording::{Error, RawUnit, Reference, Result};

/// The population of accelerometers by hand.
#[derive(Debug, Clone, PartialEq)]
pub struct Population {
    /// In standard deviations of the population, by the normalised parameters of [`Model::parameters`], SI unit at full input.
    rows: DMatrix<f64>,
    /// Units that the prior was made from.
    pub units: usize,
    /// Unit of their readings.
    pub raw_unit: RawUnit,
    /// Whether it says something of the biases.
    pub has_biases: bool,
}

impl Population {
    /// Of a prior's accelerometer; `place` is the file.
    ///
    /// # Errors
    /// The prior is for known inputs, lacks the accelerometer, or has angles that gravity alone does not define.
    pub fn of(prior: &Prior, place: &str) -> Result<Self> {
        let refuse = |problem: &str, remedy: &str| Err(Error::new(place, problem, remedy));
        if prior.reference != Reference::Gravity {
            let problem = format!(
                "its reference is \"{}\", and a prior is for poses by hand with gravity as the reference",
                prior.reference
            );
            return refuse(
                &problem,
                "leave it out, or make one of calibrations by hand: mimu fleet DIR --prior FILE",
            );
        }
        let (Some(table), Some(triad)) = (&prior.accel, prior.triad(Sensor::Accel)) else {
            return refuse(
                "it has no accelerometer, whose poses this command designs",
                "make it of calibrations with an accelerometer: mimu fleet DIR --prior FILE",
            );
        };
        let angles = |kind| kind == ParameterKind::Misalignment;
        let found = triad
            .middle()
            .filter(|_| triad.parameters().all(|p| !angles(p.0)));
        let rows = found.and_then(|middle| Some((triad.residuals(&middle)?.1, middle)));
        let Some((by, middle)) = rows else {
            return refuse(
                "its accelerometer has misalignments or a singular mean, and with gravity as the reference the accelerometer is the frame",
                "make it of calibrations by hand: mimu fleet DIR --prior FILE",
            );
        };
        let model = Model::accel(Reference::Gravity);
        let si: Vec<f64> = model.parameters().iter().map(|p| p.si).collect();
        let lower: Vec<SVector<f64, 9>> = by
            .row_iter()
            .map(|row| {
                free(
                    &of_output(&SVector::from_fn(|k, _| row[k]), &middle),
                    &LOWER,
                )
            })
            .collect();
        Ok(Self {
            rows: DMatrix::from_fn(lower.len(), LOWER.len(), |i, k| lower[i][k] * si[k]),
            units: table.units,
            raw_unit: prior.raw_unit,
            has_biases: prior.biases && triad.parameters().any(|p| p.is_bias()),
        })
    }

    /// Its rows in units of a dwell mean with this sigma, SI.
    pub(super) fn rows(&self, sigma: f64) -> DMatrix<f64> {
        &self.rows * sigma
    }
}
