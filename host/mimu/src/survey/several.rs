//! Several recordings of one unit, each at its own temperature.

use super::{Options, Survey, survey};
use crate::calibration::Calibration;
use mimu_recording::error::{Error, Result};
use mimu_recording::{Recording, are_two_units};

/// The noise of each recording; see [`survey`].
///
/// Errors: two recordings are of different units or are the same one, or one of several has no temperature.
pub fn survey_all(
    recordings: &[Recording],
    calibration: Option<&Calibration>,
    options: Options,
    progress: impl Fn(f64),
) -> Result<Vec<Survey>> {
    for (i, recording) in recordings.iter().enumerate().skip(1) {
        refuse_another_unit(&recordings[0], recording)?;
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

/// Refuses a recording whose channels cannot be in one file with those of the first.
fn refuse_another_unit(first: &Recording, other: &Recording) -> Result<()> {
    let (one, two) = (&first.manifest, &other.manifest);
    let place = |recording: &Recording| recording.place.clone();
    let (what, here, there) = if are_two_units(&one.device, &two.device) {
        (
            "device",
            format!("{:?}", two.device),
            format!("{:?}", one.device),
        )
    } else if one.raw_unit != two.raw_unit {
        (
            "raw_unit",
            two.raw_unit.to_string(),
            one.raw_unit.to_string(),
        )
    } else if one.sample_rate_hz != two.sample_rate_hz {
        (
            "sample_rate_hz",
            two.sample_rate_hz.to_string(),
            one.sample_rate_hz.to_string(),
        )
    } else {
        return Ok(());
    };
    Err(Error::new(
        place(other),
        format!("its {what} is {here}; that of {} is {there}", place(first)),
        "give recordings of one unit with the same settings",
    ))
}
