//! A calibration in the encoding of the device, for programs with `mimu-core` ([`mimu_core::stored`]).

use mimu::calibration::Calibration;
use mimu_device::Image;
use mimu_recording::{Result, UNNAMED};

use crate::format::Whole;
use crate::{Export, Nothing, Page, Sources, Target};

/// The format.
pub struct Core;

impl Target for Core {
    type Options = Nothing;
    const NAME: &str = "core";
    const ABOUT: &str = "The bytes that a device stores, for programs with mimu-core";
    const CONTENTS: &str = "everything, as the bytes that a device stores";
    const READERS: &str = "Rust programs with `mimu-core`";
    const WHOLE: Option<Whole> = Some(whole);
    const PAGES: &[Page] = &[Page::of("bytes for mimu-core", "calibration.bin")];

    /// # Errors
    /// The errors of [`Image::new`]: a triad is missing, readings are in SI, or an effect cannot be removed on a device.
    fn export(from: &Sources, _: &Nothing) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let image = Image::new(calibration, place)?;
        let mut export = Export::new::<Self>(from);
        export.note(format!("hash {}", image.hash));
        if !image.effects.is_empty() {
            export.note(format!("effects: {}", image.effects.join(", ")));
        }
        export.notes.extend(image.warnings);
        Ok(export.with(image.bytes))
    }
}

/// The calibration of bytes that a device would take.
fn whole(bytes: &[u8], place: &str) -> Option<Result<Calibration>> {
    let is_one = mimu_core::stored::decode(bytes).is_ok();
    is_one.then(|| mimu_device::calibration(bytes, None, UNNAMED, place))
}
