//! The fit of one triad and its residuals.

use nalgebra::Vector3;

use super::hold_out::HoldOut;
use super::reference_error::Influence;
use crate::estimate::Estimated;
use crate::judging::rms;
use crate::quantity::{Figure, Sensor};
use crate::unseen::Test;
use crate::warning::Warning;

/// One residual: where it is, and how large in sample and held out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Dwell, or the dwell in which a turn ends.
    pub dwell: usize,
    /// Whether it belongs to the moving input within the dwell instead of the mean.
    pub within: bool,
    /// Vector residual: input error or direction error; for a magnitude, the error is the first component.
    pub value: Vector3<f64>,
    /// The same by a calibration fitted without it; `None` if it could not be held out.
    pub held_out: Option<Vector3<f64>>,
    /// Standard deviation that noise alone gives it (root mean square over its parts).
    pub floor: f64,
}

/// Fit of one triad.
#[derive(Debug, Clone)]
pub struct SensorFit {
    /// The triad.
    pub sensor: Sensor,
    /// Calibration, scatter and condition.
    pub estimated: Estimated,
    /// The quantity that the error figures describe.
    pub figure: Figure,
    /// One for every dwell or turn that was used; for dwells whose input moves, also those within them.
    pub residuals: Vec<Residual>,
    /// Number of dwells used.
    pub dwells: usize,
    /// Compensated gyro dwell means without a table, root mean square in sample and held out, rad/s.
    pub static_rms: Option<(f64, Option<f64>)>,
    /// How its residuals were held out.
    pub held_out: HoldOut,
    /// How the errors of data that were held out compare with what is predicted of them; those in sample if nothing was held out. `None` if the noise is
    /// unknown.
    pub test: Option<Test>,
    /// [`Self::rms`] without a calibration, if the readings are in SI.
    pub uncalibrated_rms: Option<f64>,
    /// What the stated errors of the reference add to the covariance. Empty without any.
    pub influences: Vec<Influence>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

impl SensorFit {
    /// Root mean square of the residuals: over axes if the input is known, otherwise of the angle or magnitude.
    pub fn rms(&self) -> f64 {
        rms(self.figure, self.residuals.iter().map(|r| r.value))
    }

    /// The same of the held-out residuals; `None` if there are none.
    pub fn held_out_rms(&self) -> Option<f64> {
        let held = || self.residuals.iter().filter_map(|r| r.held_out);
        (held().count() > 0).then(|| rms(self.figure, held()))
    }

    /// [`Self::rms`] by noise alone. Not a number if the noise is unknown, as for means without standard deviations: a floor of 0 would mean that
    /// there is no noise.
    pub fn noise_floor(&self) -> f64 {
        if self.residuals.iter().all(|r| r.floor == 0.0) {
            return f64::NAN;
        }
        rms(
            Figure::GravityMagnitude,
            self.residuals
                .iter()
                .map(|r| Vector3::new(r.floor, 0.0, 0.0)),
        )
    }
}

/// The rms in sample or, if larger, that by noise alone: with many parameters few residuals are too small.
pub(super) fn typical(figure: Figure, residuals: &[Residual]) -> f64 {
    let floor = |r: &Residual| Vector3::new(r.floor, 0.0, 0.0);
    let in_sample = rms(figure, residuals.iter().map(|r| r.value));
    in_sample.max(rms(Figure::GravityMagnitude, residuals.iter().map(floor)))
}
