//! Sends a calibration, and reads the stored one.

use std::time::Duration;

use mimu_core::die::BEYOND_C;
use mimu_core::stored;
use mimu_core::wire::{CHUNK, Refusal, Request};
use serde::Serialize;

use super::identity::Hash;
use super::image::Image;
use super::origin;
use super::received::Answer;
use super::session::{PATIENCE, Session, refused};
use super::stream::look;
use mimu::calibration::Calibration;
use mimu_recording::error::{Error, Result};

/// Longest wait for a commit: erasing a sector takes 1 to 4 s, then 4 kB are programmed.
const COMMIT: Duration = Duration::from_secs(15);
/// Length of the raw stream that gives the temperature.
const LOOK: Duration = Duration::from_millis(100);
/// Attempts at an upload: a device that restarts in the middle has lost the first part.
const BEGINNINGS: u32 = 3;

/// Result of `mimu device upload`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Uploaded {
    /// Identifies the calibration.
    pub hash: Hash,
    /// Length of the calibration.
    pub bytes: usize,
    /// Hash of the previous calibration, if there was one.
    pub before: Option<Hash>,
    /// The device stored the same calibration already, and wrote it again only if something beside it was damaged.
    pub was_there: bool,
    /// Messages that had to be repeated.
    pub repeated: u32,
    /// Times that the device restarted and the upload began anew.
    pub restarts: u32,
    /// Number of the unit that the calibration belongs to, if given.
    pub unit_id: Option<String>,
    /// Temperatures of its nodes, °C.
    pub node_temp_c: Vec<f32>,
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// One sentence for each assumption.
    pub warnings: Vec<String>,
}

/// Sends a calibration, stores it, and reads it back byte by byte. `progress` gets the fraction done, up to 1.
///
/// `other_unit`: accept a calibration of another unit, which the device otherwise refuses.
///
/// After any failure the device stores either the old or the new calibration, complete. The error says which, if the device still answers.
pub fn upload(
    session: &mut Session,
    image: &Image,
    other_unit: bool,
    progress: impl Fn(f64),
) -> Result<Uploaded> {
    let before = session.hello()?.stored_hash();
    let repeated = session.repeated();
    let was_there = before == Some(image.hash);
    let mut restarts = 0;
    // The device itself knows whether the slot, its front end and the other slot are as they should be.
    while !send(session, image, other_unit, &progress)
        .map_err(|error| with_stored_calibration(session, image, error))?
    {
        restarts += 1;
        if restarts == BEGINNINGS {
            let problem = format!("the device restarted in each of {BEGINNINGS} uploads");
            let remedy = "check its supply; `mimu device info` shows the reset cause";
            let error = Error::device(session.port(), problem, remedy);
            return Err(with_stored_calibration(session, image, error));
        }
    }
    let back = download(session)?;
    if back != image.bytes {
        return Err(Error::device(
            session.port(),
            "the bytes read back differ from those sent",
            "upload again; if that fails too, the flash is worn out",
        ));
    }
    progress(1.0);
    let mut warnings = image.warnings.clone();
    if image.origin.settings.is_none() {
        warnings.push(
            "the calibration does not contain the range and the filter of its sensors, so they may have been set otherwise; fit a recording of `mimu record`".into(),
        );
    }
    Ok(Uploaded {
        hash: image.hash,
        bytes: image.bytes.len(),
        before,
        was_there,
        repeated: session.repeated() - repeated,
        restarts,
        unit_id: image.origin.unit_id.as_ref().map(origin::digits),
        node_temp_c: image.node_temp_c.clone(),
        effects: image.effects.clone(),
        warnings,
    })
}

/// One attempt; returns `false` if the device has lost the first part.
fn send(
    session: &mut Session,
    image: &Image,
    other_unit: bool,
    progress: &impl Fn(f64),
) -> Result<bool> {
    let (length, hash) = (image.bytes.len() as u32, image.hash);
    let begin = Request::UploadBegin {
        length,
        hash: hash.0,
        other_unit,
    };
    session.done(begin, "to take a calibration")?;
    let mut offset = 0;
    while offset < image.bytes.len() {
        let part = &image.bytes[offset..image.bytes.len().min(offset + CHUNK)];
        let chunk = Request::UploadChunk {
            offset: offset as u32,
            bytes: part,
        };
        let purpose = "to take a part of the calibration";
        match session.attempt(chunk, purpose, PATIENCE)? {
            Answer::Done => offset += part.len(),
            Answer::Refused(Refusal::NoUpload) => return Ok(false),
            // The device knows best how much it has received.
            Answer::Refused(Refusal::WrongOffset { expected }) if (expected as usize) < offset => {
                offset = expected as usize;
            }
            // It had room for this one when it was begun.
            Answer::Refused(Refusal::TooLong { .. }) => {
                let other = Refusal::WrongOffset { expected: 0 };
                return Err(refused(session.port(), purpose, &other));
            }
            Answer::Refused(refusal) => return Err(refused(session.port(), purpose, &refusal)),
            _ => return Err(session.unexpected(purpose)),
        }
        progress(0.5 * offset as f64 / image.bytes.len() as f64);
    }
    let purpose = "to store the calibration";
    match session.attempt(Request::UploadCommit, purpose, COMMIT)? {
        Answer::Done => {}
        // Either the device restarted, or it stored the calibration and its answer was lost. The greeting distinguishes the two.
        Answer::Refused(Refusal::NoUpload) => {
            return Ok(session.hello()?.stored_hash() == Some(hash));
        }
        Answer::Refused(refusal) => return Err(refused(session.port(), purpose, &refusal)),
        _ => return Err(session.unexpected(purpose)),
    }
    if session.hello()?.stored_hash() != Some(hash) {
        return Err(Error::device(
            session.port(),
            "it reports the calibration as stored, but greets with another one",
            "upload again",
        ));
    }
    Ok(true)
}

/// A warning if the device's present temperature is outside the calibration's range: outside its curves or, for a calibration at one temperature,
/// more than 5 K away. Measured in a tenth of a second of the raw stream. `None` if it is inside, or if the range is unknown.
pub fn outside_now(session: &mut Session, calibration: &Calibration) -> Result<Option<String>> {
    let Some([from, to]) = calibration.limits() else {
        return Ok(None);
    };
    let margin_k = match calibration.temperature {
        Some(_) => 0.0,
        None => BEYOND_C,
    };
    let seen = look(session, LOOK)?;
    let away_k = (from - seen.temp_c).max(seen.temp_c - to);
    Ok((away_k > margin_k).then(|| {
        format!(
            "the device is at {:.1} °C, {away_k:.1} K outside the {from:.1} to {to:.1} °C of the calibration",
            seen.temp_c
        )
    }))
}

/// `error`, with the calibration that the device stores now.
fn with_stored_calibration(session: &mut Session, image: &Image, error: Error) -> Error {
    let holds = match session.hello() {
        Ok(who) => match &who.stored {
            None => "the device stores no calibration, as before".to_string(),
            Some(s) if s.hash == image.hash => "the device stores the new calibration".to_string(),
            Some(s) => format!("the device keeps the calibration {}", s.hash),
        },
        Err(_) => "the device stores the old calibration or the new one, complete: `mimu device info` says which".into(),
    };
    error.map(|e| e.problem = format!("{}; {holds}", e.problem).replace("; ", ", "))
}

/// The calibration in use, as the device stores it: read in parts, and checked against the greeting's hash.
pub fn download(session: &mut Session) -> Result<Vec<u8>> {
    let Some(info) = session.hello()?.stored.clone() else {
        let [a, b] = &session.who().slots;
        return Err(Error::device(
            session.port(),
            format!("the device stores no calibration (its two places: {a}, {b})"),
            "upload one: `mimu device upload CAL`",
        ));
    };
    let purpose = "for its calibration";
    let mut all: Vec<u8> = Vec::with_capacity(info.bytes as usize);
    while all.len() < info.bytes as usize {
        let request = Request::Download {
            offset: all.len() as u32,
            length: CHUNK as u16,
        };
        match session.call(request, purpose, PATIENCE)? {
            Answer::Stored { offset, bytes, .. }
                if offset as usize == all.len() && !bytes.is_empty() =>
            {
                all.extend_from_slice(&bytes);
            }
            _ => return Err(session.unexpected(purpose)),
        }
    }
    let found = Hash(stored::hash(&all));
    if found != info.hash || all.len() != info.bytes as usize {
        return Err(Error::device(
            session.port(),
            format!(
                "{} bytes with hash {found} came, but {} with hash {} are stored",
                all.len(),
                info.bytes,
                info.hash
            ),
            "download again; if that fails too, upload the calibration again",
        ));
    }
    Ok(all)
}
