//! The further triads of a calibration file, judged by a recording that they were not made from.

use std::collections::BTreeMap;

use mimu::calibration::Calibration;
use mimu::calibration::body::BodyTriad;
use mimu::judgement::Judgement;
use mimu::quantity::{PerSensor, Sensor};
use mimu_core::compensation::Affine;
use mimu_recording::error::Result;
use mimu_recording::{RawUnit, Recording, TriadKind};
use serde::Serialize;

use crate::carrier::{Carrier, read};
use crate::field::Field;
use crate::iron::Warmth;
use crate::standing::Standing;
use crate::{judge, same_body};

/// Errors of a further triad.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TriadVerification {
    /// Rms error over windows, in [`Self::unit`].
    pub rms: f64,
    /// The same by white noise.
    pub noise_floor: f64,
    /// Unit of both.
    pub unit: String,
    /// Number of windows.
    pub windows: usize,
    /// Its judgement.
    pub judgement: Judgement,
}

/// Errors of the further triads that both the file and the recording have, by name.
///
/// # Errors
/// The samples cannot be read.
pub fn verify(
    recording: &Recording,
    calibration: &Calibration,
) -> Result<BTreeMap<String, TriadVerification>> {
    let there = recording.triads();
    let mut found = BTreeMap::new();
    let own: Vec<&BodyTriad> = calibration
        .body
        .iter()
        .filter(|of| there.contains(&of.triad))
        .collect();
    if own.is_empty() {
        return Ok(found);
    }
    // What a file does not calibrate was taken as it reads.
    let in_si = recording.manifest.raw_unit == RawUnit::Si;
    let models = PerSensor::from_fn(|sensor| {
        let as_it_reads = in_si.then(Affine::identity);
        calibration.inverse(sensor).or(as_it_reads)
    });
    let carrier = Carrier::read(recording, &models)?;
    let warmth = Warmth::read(recording)?;
    for of in own {
        let judged = one(&carrier, warmth.as_ref(), recording, of)?;
        found.extend(judged.map(|judged| (of.triad.to_string(), judged)));
    }
    Ok(found)
}

/// `None` if the first triad of its kind is missing, or nothing moves.
fn one(
    carrier: &Carrier,
    warmth: Option<&Warmth>,
    recording: &Recording,
    of: &BodyTriad,
) -> Result<Option<TriadVerification>> {
    let raw = read(recording, of.triad)?;
    let standing = Standing::from(of);
    let (errors, judgement) = match of.triad.kind {
        TriadKind::Mag => {
            let Some(motion) = carrier.motion() else {
                return Ok(None);
            };
            // Without `--field` its unit is the size of the field.
            let size = match of.unit.as_str() {
                "field" => Some(1.0),
                _ => None,
            };
            let Some((errors, [size_rms, size])) =
                Field::errors(raw, motion, &standing, size, warmth)
            else {
                return Ok(None);
            };
            let judgement = judge::field_again(&errors, size_rms, size);
            (errors, judgement)
        }
        kind => {
            let sensor = match kind {
                TriadKind::Gyro => Sensor::Gyro,
                _ => Sensor::Accel,
            };
            let Some(reference) = carrier.reference(sensor) else {
                return Ok(None);
            };
            let Some(errors) = same_body::errors(kind, &raw, &reference, &standing) else {
                return Ok(None);
            };
            let judgement = judge::same_body(
                &errors,
                reference.signal(),
                &format!("the first {sensor}"),
                sensor.unit(),
            );
            (errors, judgement)
        }
    };
    Ok(Some(TriadVerification {
        rms: errors.held_out_rms,
        noise_floor: errors.noise_floor,
        unit: of.unit.clone(),
        windows: errors.windows,
        judgement,
    }))
}
