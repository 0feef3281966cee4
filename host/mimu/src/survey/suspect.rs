//! What makes the input of a survey doubtful: its unit, its rate, or the calibration that it is divided by.

use nalgebra::Vector3;

use super::Channel;
use crate::calibration::Calibration;
use crate::quantity::Sensor;
use crate::signal::unit_in_si::of_sizes;
use crate::warning::Warning;
use mimu_allan::model::Term;
use mimu_recording::Manifest;
use mimu_recording::health::GAIN;

/// White noise beyond that of any gyro, rad/s/√Hz: 0.25 deg/s/√Hz, two and a half times that of an ADXRS300. An ordinary gyro has 0.0001 rad/s/√Hz,
/// and its numbers are 57 times larger in deg/s.
const LOUDEST_GYRO: f64 = 4.4e-3;

/// Warnings about a recording with this manifest. `levels`: channels and their means at rest, raw.
pub(super) fn input(
    manifest: &Manifest,
    calibration: Option<&Calibration>,
    period_s: f64,
    levels: Vec<(usize, f64)>,
) -> Vec<Warning> {
    let mean = |sensor: Sensor| {
        let own = levels.iter().filter(|(i, _)| sensor.channels().contains(i));
        let own: Vec<f64> = own.map(|(_, level)| *level).collect();
        (own.len() == 3).then(|| Vector3::from_column_slice(&own))
    };
    let mut all = Vec::from_iter(Warning::of_rate(period_s.recip()));
    let Some(calibration) = calibration else {
        let sizes = Sensor::BOTH.map(|sensor| mean(sensor).map(|mean| mean.norm()));
        all.extend(of_sizes(sizes, manifest).into_iter().map(Warning::Health));
        return all;
    };
    all.extend(calibration.other_unit(manifest));
    let force = mean(Sensor::Accel).zip(calibration.inverse(Sensor::Accel));
    let times = force.map(|(raw, model)| model.apply(&raw).norm() / manifest.gravity_mps2);
    let other = times.filter(|times| !(GAIN.recip()..GAIN).contains(times));
    all.extend(other.map(|times| Warning::CalibrationOfOther { times }.of(Sensor::Accel)));
    all
}

/// Warnings about gyros that are noisier than any part.
pub(super) fn noise(channels: &[Channel]) -> Vec<Warning> {
    let white = |c: &Channel| Some(c.model.as_ref()?.get(Term::N).ok()?.value);
    let si = channels
        .iter()
        .filter(|c| c.unit.name == Sensor::Gyro.unit());
    let loud = si.filter_map(|c| white(c).filter(|n| *n > LOUDEST_GYRO).map(|n| (c.name, n)));
    let warning = |white| Box::new(Warning::NoisierThanGyros { white });
    loud.map(|(name, n)| Warning::Channel(name, warning(n)))
        .collect()
}
