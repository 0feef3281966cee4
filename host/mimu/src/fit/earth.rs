//! The Earth's rate in the intervals of a gyro's biases, where it is not known.

use super::SensorFit;
use crate::estimate::earth::RATE;
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::warning::Warning;
use mimu_recording::Reference;

/// Share of the Earth's rate that a bias by hand hardly exceeds.
const BY_HAND: f64 = 0.25;

/// The warning that the Earth's rate, or its horizontal component, is in the intervals. There is none if the noise alone is larger.
pub(super) fn in_intervals(prepared: &Prepared, fit: &SensorFit) -> Option<Warning> {
    let covariance = &fit.estimated.triad.inverse_covariance;
    let sigma = |axis: usize| covariance[(9 + axis, 9 + axis)].sqrt();
    // By hand poses all around average the vertical component out.
    let most = match prepared.manifest.reference {
        Reference::Table => RATE,
        Reference::Gravity | Reference::TurntableRate => BY_HAND * RATE,
    };
    if fit.sensor != Sensor::Gyro || !(0..3).any(|axis| sigma(axis) < most) {
        return None;
    }
    if prepared.manifest.latitude_deg.is_none() {
        return Some(Warning::NoLatitude.of(Sensor::Gyro));
    }
    let earth = prepared.earth_on_table.as_ref()?;
    let lost = earth.headings.saturating_sub(1);
    (lost > 0).then(|| Warning::HeadingLost { times: lost }.of(Sensor::Gyro))
}
