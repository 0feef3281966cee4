//! Biases of each axis alone, for Adafruit and IIO.

use mimu_recording::error::Result;

use crate::convention::Parts;
use crate::layout::Entry;
use crate::{Export, Sources, Target, driver, remaining};

/// The numbers of the calibrated triads, by the entries of the format. Adds notes on the readings, of which `missing` ends the one on a triad that is not
/// calibrated, and what is left of scale factors.
///
/// # Errors
/// The calibration is missing, or those of [`driver::Options::readings`].
pub(crate) fn biases<T: Target>(
    driver: &driver::Options,
    from: &Sources,
    missing: &str,
    export: &mut Export,
) -> Result<Vec<(&'static Entry, Parts)>> {
    let (calibration, place) = from.calibration()?;
    let mut all = Vec::new();
    for entry in T::LAYOUT {
        let sensor = entry.sensor;
        if calibration.table(sensor).is_none() {
            export.note(format!("The calibration has no {sensor}, so {missing}."));
            continue;
        }
        let readings = driver.readings(calibration, place, sensor)?;
        export.note(readings.line());
        let gain = readings.forward.matrix.diagonal();
        let error = remaining::scale_factors(sensor, &gain);
        export.remaining.push(error);
        all.push((entry, T::CONVENTION.of(&readings)?));
    }
    Ok(all)
}
