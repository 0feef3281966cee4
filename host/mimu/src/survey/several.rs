//! Several recordings of one unit, each at its own temperature.

use super::{Options, Survey, survey};
use crate::calibration::Calibration;
use crate::one_unit::{RAW_UNIT, SAMPLE_RATE, refuse_unlike};
use mimu_recording::{Error, Recording, Result};

/// The noise of each recording; see [`survey`].
///
/// Errors: two recordings are of different units or are the same one, or one of several has no temperature.
pub fn survey_all(
    recordings: &[Recording],
    calibration: Option<&Calibration>,
    options: Options,
    progress: impl Fn(f64),
) -> Result<Vec<Survey>> {
    // Their channels are in one file.
    let named: Vec<_> = recordings
        .iter()
        .map(|r| (r.place.as_str(), &r.manifest))
        .collect();
    refuse_unlike(&named, &[RAW_UNIT, SAMPLE_RATE])?;
    for (i, recording) in recordings.iter().enumerate().skip(1) {
        let same = |r: &Recording| r.samples.canonicalize().ok();
        let mine = same(recording);
        if mine.is_some() && recordings[..i].iter().any(|r| same(r) == mine) {
            return Err(Error::new(
                recording.name(),
                "the recording is given twice",
                "leave one out",
            ));
        }
    }
    let all = recordings.len() as f64;
    let each = (0..).zip(recordings).map(|(done, recording)| {
        let progress = |share| progress((f64::from(done) + share) / all);
        survey(recording, calibration, options, progress)
    });
    let surveys: Vec<Survey> = each.collect::<Result<_>>()?;
    if let (Some(unknown), 2..) = (surveys.iter().find(|s| s.temp_c.is_none()), surveys.len()) {
        return Err(Error::new(
            &unknown.recording,
            "it has no temp_c, which is needed to distinguish the noise of several recordings",
            "record the temperature, or give one recording at a time",
        ));
    }
    Ok(surveys)
}
