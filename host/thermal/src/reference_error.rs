//! Errors of the reference that all temperatures share: they widen every curve by the same pattern, and no recording shows them.

use mimu::quantity::Sensor;
use mimu::triad::{Covariance, Forward, vector};
use mimu_recording::{Error, Reference, ReferenceError, Result};
use nalgebra::Vector3;

use crate::session::Session;

/// Standard uncertainties of the errors that a triad cannot distinguish from its own parameters.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct CommonErrors {
    /// Of all inputs by one factor: the share of the rates, or of gravity.
    share: f64,
    /// Of the orientation of the unit on its mount, rad about each axis.
    mounting_rad: f64,
}

impl CommonErrors {
    /// Those of `sensor` by the statement of the sessions.
    pub fn of(sessions: &[Session], sensor: Sensor) -> Self {
        let Some((session, error)) = stated(sessions) else {
            return Self::default();
        };
        let sigma = error.standard();
        Self {
            share: sensor.pick(sigma.rate, sigma.gravity_mps2 / session.gravity_mps2),
            mounting_rad: sigma.mounting_deg.to_radians(),
        }
    }

    /// What they add to the covariance of `model`: P errs by a factor, and by a rotation of the body. Biases do not err.
    pub fn covariance(&self, model: &Forward) -> Covariance {
        let mut all = Covariance::zeros();
        let mut add = |by: nalgebra::Matrix3<f64>| {
            let by = vector(&by, &Vector3::zeros());
            all += by * by.transpose();
        };
        add(model.matrix * self.share);
        for axis in 0..3 {
            add(model.matrix * Vector3::ith(axis, self.mounting_rad).cross_matrix());
        }
        all
    }
}

/// The first session with a statement, and the statement.
fn stated(sessions: &[Session]) -> Option<(&Session, &ReferenceError)> {
    let each = sessions.iter();
    let mut each = each.filter_map(|s| Some((s, s.reference_error.as_ref()?)));
    each.next()
}

/// Refuses statements that the curves cannot count, instead of making intervals that lack them.
///
/// # Errors
/// Sessions that state different errors, errors that depend on the pose, recordings at rest.
pub(crate) fn check(sessions: &[Session]) -> Result<()> {
    let Some((first, error)) = stated(sessions) else {
        return Ok(());
    };
    let refuse = |place: &str, problem: String, remedy: &str| {
        Err(Error::new(
            format!("{place}, errors of the reference"),
            problem,
            remedy,
        ))
    };
    if let Some(other) = sessions
        .iter()
        .find(|s| s.reference_error.as_ref() != Some(error))
    {
        let problem = format!("{} states other errors or none", other.place);
        let remedy = "state the same in all recordings: they are common to all temperatures";
        return refuse(&first.place, problem, remedy);
    }
    if first.reference != Reference::Table {
        let problem = "curves count them only for known inputs (reference = \"table\")";
        let remedy = "leave them out, and know that no interval includes them";
        return refuse(&first.place, problem.into(), remedy);
    }
    let common = ["gravity_mps2", "rate", "mounting_deg"];
    let keys = error.stated().map(|(key, ..)| key);
    let unused: Vec<&str> = keys.filter(|key| !common.contains(key)).collect();
    if unused.is_empty() {
        return Ok(());
    }
    let problem = format!(
        "curves over temperature cannot count {}: they depend on the pose, and the regression takes its poses as exact",
        unused.join(", ")
    );
    refuse(
        &first.place,
        problem,
        "leave them out, and know that no interval includes them; gravity_mps2, rate and mounting_deg apply",
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Rotation3};

    use super::*;

    /// A gyro that is calibrated with rates too large by a share, on a mount that is turned, finds P (1 + share) R: its spread over all errors is what the
    /// interval has to contain.
    #[test]
    fn the_covariance_is_the_spread_of_the_curves_that_such_references_give() {
        let model = Forward {
            matrix: Matrix3::new(0.012, 1e-4, 0.0, -2e-4, 0.0118, 5e-5, 0.0, -1e-4, 0.0122),
            bias: Vector3::new(2.5, 2.49, 2.52),
        };
        let errors = CommonErrors {
            share: 2e-3,
            mounting_rad: 1.5e-3,
        };
        // One standard deviation either way of each of the four: the mean square of independent changes.
        let mut spread = Covariance::zeros();
        let mut add = |changed: Matrix3<f64>| {
            let off = vector(&(changed - model.matrix), &Vector3::zeros());
            spread += off * off.transpose() / 2.0;
        };
        for sign in [1.0, -1.0] {
            add(model.matrix * (1.0 + sign * errors.share));
            for axis in 0..3 {
                let turn = Vector3::ith(axis, sign * errors.mounting_rad);
                add(model.matrix * Rotation3::new(turn).matrix());
            }
        }
        let found = errors.covariance(&model);
        assert!((found - spread).amax() < 1e-5 * spread.amax(), "{found}");
        // The null does not depend on the reference.
        assert!((9..12).all(|k| found[(k, k)] == 0.0));
    }
}
