//! A calibration as the device computes with it.

use mimu_core::RealField;
use mimu_core::compensation::Compensation;
use mimu_core::compensator::Compensator;
use mimu_core::die::DieLag;
use mimu_core::effects::{Effects, REFERENCE_C};
use mimu_core::stored::NODES;
use mimu_core::table::Table;
use nalgebra::convert;

use super::{Calibration, Curves};
use crate::effects::fitted::NotOnDevice;
use crate::quantity::{PerSensor, Sensor};
use mimu_recording::error::{Error, Result};

/// The compensator of `core` for a calibration: with these curves, or with this model at all temperatures.
pub fn compensator<const N: usize>(
    calibration: &Calibration,
    model: Compensation<f64>,
    curves: Option<Curves>,
    effects: Effects<f64, N>,
) -> Compensator<f64, NODES, N> {
    let (table, lags) = match curves {
        Some(curves) => (curves.table().clone(), *curves.lags()),
        None => (
            Table::constant(REFERENCE_C, model),
            PerSensor::both(DieLag::none()),
        ),
    };
    let any = !calibration.effects().is_empty();
    Compensator {
        table,
        lags,
        effects: any.then_some(effects),
    }
}

impl Calibration {
    /// The effects as the device removes them: for each triad, up to N that run with every sample and N that do not. One that this build of `core`
    /// cannot remove is refused by its id.
    pub fn core_effects<T: RealField + Copy, const N: usize>(&self) -> Result<Effects<T, N>> {
        let place = format!("calibration of {:?}", self.device);
        let model = |sensor| {
            self.inverse(sensor).ok_or_else(|| {
                let problem =
                    format!("the file has no [{sensor}], and the device needs both sensors");
                Error::new(&place, problem, "calibrate both sensors")
            })
        };
        let (gyro, accel) = (model(Sensor::Gyro)?, model(Sensor::Accel)?);
        self.effects_of_models(&Compensation { gyro, accel })
    }

    /// The same, with a substitute among `models` for a sensor that is not calibrated.
    pub(crate) fn effects_of_models<T: RealField + Copy, const N: usize>(
        &self,
        models: &Compensation<f64>,
    ) -> Result<Effects<T, N>> {
        let place = format!("calibration of {:?}", self.device);
        let singular = || Error::new(&place, "C is singular", "fit the recording again");
        let limits = self.limits().map(|limits| limits.map(convert));
        let mut all = Effects::new(models).ok_or_else(singular)?.within(limits);
        for effect in self.effects() {
            let refuse = |problem: String, remedy: &str| {
                let id = effect.id();
                Error::new(format!("{place}, [[effect]] {id}"), problem, remedy)
            };
            const WITHOUT: &str = "update the device, or use the calibration without effects";
            let on_device = effect.on_device().map_err(|why| match why {
                NotOnDevice::Numbers(_) => refuse(why.to_string(), "diagnose the recording again"),
                _ => refuse(why.to_string(), WITHOUT),
            })?;
            all.push(on_device).map_err(|_| {
                let problem = format!("the device has no room for it: at most {N} of a kind");
                refuse(problem, WITHOUT)
            })?;
        }
        Ok(all)
    }
}
