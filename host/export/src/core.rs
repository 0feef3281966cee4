//! A calibration in the encoding of the device, for programs with `mimu-core` ([`mimu_core::stored`]).

use mimu_device::Image;
use mimu_recording::error::Result;

use crate::{Export, Sources};

/// The encoded calibration.
///
/// # Errors
/// The errors of [`Image::new`]: a triad is missing, readings are in SI, or an effect cannot be removed on a device.
pub fn export(from: &Sources) -> Result<Export> {
    let (calibration, place) = from.calibration()?;
    let image = Image::new(calibration, place)?;
    let mut export = Export::new("core", from);
    export.notes.push(format!("hash {}", image.hash));
    if !image.effects.is_empty() {
        let effects = format!("effects: {}", image.effects.join(", "));
        export.notes.push(effects);
    }
    export.notes.extend(image.warnings);
    export.content = image.bytes;
    Ok(export)
}
