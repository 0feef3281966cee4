//! Accelerometer calibration from the magnitude of gravity and from the turns between the poses together.
//!
//! If the poses do not show both ends of an axis, the magnitude alone hardly determines that axis ([`super::magnitude`]): ten poses of a fixture gave
//! a scale factor of 6.0 ± 9.1. But the gyro carries the direction of gravity from pose to pose, and an error of the accelerometer's direction shows
//! against it. Here C and o of the accelerometer (nine parameters, as in [`super::magnitude`]) and C and o of the gyro (twelve) are fitted to the
//! magnitudes, the turns and the readings at rest at once.
//!
//! Only the accelerometer is returned. With it, [`super::rotation`] finds the gyro of the joint minimum. If it also propagates the covariance of this
//! accelerometer, the gyro's covariance is that of the joint fit, by the inverse of a block matrix. Errors of the gyro's model enter the
//! accelerometer this way, so this fit is used only if the magnitude alone does not suffice.

use mimu_core::compensation::Affine;

use super::factor_fit::{Coordinates, FactorFit, HALF_DEGREE, Solved, mean_square};
use super::rotation::mean_at_rest;
use super::{Estimated, Failure, Observation};
use crate::factor::{Factors, Kind};
use crate::observable::Observable;
use crate::observation::turn::{Rest, Turn};
use crate::observation::{ALL, LOWER};
use crate::prior::TriadPrior;
use crate::quantity::{PerSensor, Sensor};
use crate::signal::power_ons::PowerOns;
use crate::triad::{Forward, Triad};
use crate::warning::Warning;

/// The data of the joint fit.
pub struct JointFit<'a> {
    /// Poses.
    pub poses: &'a [Observation],
    /// Variances of their magnitudes by noise, (m/s²)².
    pub variances: &'a [f64],
    /// Turns between them; only the raw readings of their forces are used.
    pub turns: &'a [Turn<'a>],
    /// Readings of the gyro at rest.
    pub rest: &'a [Rest],
    /// First guess of the accelerometer.
    pub accel: Affine<f64>,
    /// First guess of the gyro.
    pub gyro: Affine<f64>,
    /// Magnitude of gravity, m/s².
    pub gravity: f64,
    /// The power-ons that the dwells are of.
    pub power_ons: &'a PowerOns,
    /// What the population says of the gyro and the accelerometer.
    pub priors: PerSensor<Option<&'a TriadPrior>>,
}

impl<'a> JointFit<'a> {
    fn fit(&self) -> Result<FactorFit<'a>, Failure> {
        let singular = || Failure::NoSolution(SINGULAR.into());
        let centre = Forward::of(&self.accel).ok_or_else(singular)?.bias;
        let at_rest = mean_at_rest(self.rest);
        let mut factors = Factors::of_turns(self.turns);
        for (o, variance) in self.poses.iter().zip(self.variances) {
            let known = (self.gravity, None);
            factors.magnitude(Sensor::Accel, (o.dwell, o.raw), known, *variance);
        }
        factors.rests(self.rest);
        let accel = Coordinates::triad(Sensor::Accel, &self.accel, &LOWER, &centre, self.gravity);
        let gyro = Coordinates::triad(Sensor::Gyro, &self.gyro, &ALL, &at_rest, 1.0);
        let mut coordinates = vec![accel, gyro];
        for sensor in Sensor::BOTH {
            let steps = factors.bias_steps(sensor, self.power_ons);
            coordinates.extend(steps.into_iter().map(Coordinates::around_zero));
            if let Some(prior) = self.priors[sensor] {
                factors.known(Kind::Population(sensor, prior), None);
            }
        }
        let lost = "the fit to the magnitudes and the turns does not converge";
        Ok(FactorFit::new(factors, coordinates, (1e-3, 1), lost))
    }

    fn solved<'b>(&self, fit: &'b FactorFit<'a>) -> Result<Solved<'b>, Failure> {
        // The first weights: 5 milli-g, half a degree, and the scatter of the dwells. Beside a prior those of the noise, or a prior that does not hold is believed.
        let beside_prior = self.priors.gyro.or(self.priors.accel).is_some();
        let first = |group, residuals: &[f64]| match group {
            Observable::Magnitude | Observable::Turns if beside_prior => 0.0,
            Observable::Magnitude => 2.5e-5 * self.gravity * self.gravity,
            Observable::Turns => HALF_DEGREE,
            _ => mean_square(residuals),
        };
        fit.solve(fit.start(), &first, &|_| Ok(()))
    }

    /// Fits both and returns the accelerometer.
    ///
    /// # Errors
    /// No convergence, or a singular result.
    pub fn estimate(&self) -> Result<Estimated, Failure> {
        let fit = self.fit()?;
        let solved = self.solved(&fit)?;
        let parts = solved.parts(Sensor::Accel);
        let triad = solved.triad(Sensor::Accel, parts, SINGULAR)?;
        if !(triad.inverse.matrix.diagonal().min() > 0.0) {
            return Err(fit.failure());
        }
        // Of the accelerometer's parameters alone, whose columns share one unit. Those of the gyro have others.
        let condition = solved.condition(LOWER.len());
        let scatter = solved
            .scatter(true)
            .filter(|s| s.0 == Observable::Magnitude);
        Ok(Estimated {
            notes: vec![Warning::WithTurns],
            ..Estimated::new(triad, scatter.collect(), condition)
        })
    }

    /// Fits both and returns one.
    ///
    /// # Errors
    /// No convergence, or a singular result.
    pub fn triad(&self, sensor: Sensor) -> Result<Triad, Failure> {
        let fit = self.fit()?;
        let solved = self.solved(&fit)?;
        solved.triad(sensor, solved.parts(sensor), SINGULAR)
    }
}

const SINGULAR: &str = "C is singular";
