//! A calibration in the encoding of the device, for programs with `mimu-core` ([`mimu_core::stored`]).

use mimu_device::Image;
use mimu_recording::error::Result;

use crate::{Export, Nothing, Page, Sources, Target};

/// The format.
pub struct Core;

impl Target for Core {
    type Options = Nothing;
    const NAME: &str = "core";
    const ABOUT: &str = "The bytes that a device stores, for programs with mimu-core";
    const CONTENTS: &str = "everything, as the bytes that a device stores";
    const READERS: &str = "Rust programs with `mimu-core`";
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
