//! The errors of many calibrations by one recording, of which one is then verified.

use super::{PowerOn, Readings, check_unit, judging, refuse_effects_of_means};
use crate::calibration::Calibration;
use crate::fit::refuse_wrong_gravity;
use crate::fit::uncalibrated::exceeds;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use crate::triad::Forward;

/// What a search compares of a calibration: the errors of one triad as [`verify`](super::verify) gives them, without what explains them.
#[derive(Debug, Clone, Copy)]
pub struct TriadErrors {
    /// Rms, in the unit of [`Self::figure`].
    pub rms: f64,
    /// Compensated gyro at rest without a table, rad/s; `None` with one.
    pub static_rms: Option<f64>,
    /// The quantity that they describe.
    pub figure: Figure,
    /// Dwells or turns judged.
    count: usize,
}

impl TriadErrors {
    /// Of `sensor` by `calibration`; `None` if [`verify`](super::verify) refuses it or has nothing to judge it by.
    pub fn of(prepared: &Prepared, calibration: &Calibration, sensor: Sensor) -> Option<Self> {
        check_unit(calibration, &prepared.manifest, &prepared.place).ok()?;
        refuse_effects_of_means(prepared, calibration).ok()?;
        let readings =
            Readings::of(prepared, calibration, PowerOn::Another, &mut Vec::new()).ok()?;
        let as_read = &*readings.as_read;
        as_read.has(sensor).then_some(())?;
        let observations = as_read.observations(sensor);
        if !observations.is_empty() {
            refuse_wrong_gravity(as_read, sensor, &observations).ok()?;
        }
        let judged = readings.without_effects.as_ref().unwrap_or(as_read);
        let (judging, models) = judging(judged, calibration, sensor)?;
        for triad in judging.triads() {
            Forward::of(models[*triad].as_ref()?)?;
        }
        let errors = judging.errors(&models)?;
        Some(Self {
            rms: judging.rms(&errors),
            static_rms: models.gyro.and_then(|gyro| judging.at_rest(&gyro)),
            figure: judging.figure,
            count: errors.len(),
        })
    }

    /// Whether a figure of it significantly exceeds that of `other`, which the same data judge. `gain`: the output of its calibration over that of the other. At
    /// rest errors are proportional to the output, so that they are compared at one gain.
    pub fn exceeds(&self, other: &Self, gain: f64) -> bool {
        let at_rest = self.static_rms.zip(other.static_rms);
        exceeds(self.rms, other.rms, self.figure, self.count)
            || at_rest
                .is_some_and(|(own, other)| exceeds(own, gain * other, Figure::Input, self.count))
    }
}
