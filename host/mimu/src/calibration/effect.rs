//! Checks the effects of a calibration against each other and its triads.

use super::Calibration;
use crate::effects::fitted::FittedEffect;
use crate::effects::quantity::Need;
use crate::quantity::Sensor;
use mimu_recording::error::{Error, Result};

/// Refuses effects that cannot all be removed; `place` is the path of the file.
pub(super) fn check(calibration: &Calibration, place: &str) -> Result<()> {
    let all = calibration.effects();
    for (at, effect) in all.iter().enumerate() {
        let id = effect.id();
        let refuse = |problem: String, remedy: &str| {
            Err(Error::new(
                format!("{place}, [[effect]] {id}"),
                problem,
                remedy,
            ))
        };
        let same = |e: &FittedEffect| e.id() == id && e.parameter == effect.parameter;
        if all[..at].iter().any(same) {
            let remedy = "diagnose the recording again";
            return refuse("it occurs twice".into(), remedy);
        }
        for (sensor, need) in [(Sensor::Gyro, Need::Rate), (Sensor::Accel, Need::Force)] {
            let needed = effect.sensor() == sensor || effect.candidate.needs(need);
            if needed && calibration.table(sensor).is_none() {
                let problem =
                    format!("it cannot be removed without [{sensor}], which the file lacks");
                return refuse(problem, "diagnose a recording of both sensors");
            }
        }
    }
    Ok(())
}
