//! Sending a calibration, and fetching the one that is stored.

use std::time::Duration;

use mimu_core::die::BEYOND_C;
use mimu_core::stored;
use mimu_core::wire::{CHUNK, Refusal, Request};
use serde::Serialize;

use super::heard::Answer;
use super::identity::Hash;
use super::image::Image;
use super::origin;
use super::session::{PATIENCE, Session, refused};
use super::stream::{Stream, stream};
use mimu::calibration::Calibration;
use mimu_recording::error::{Error, Result};

/// Longest wait for a commit: a sector is erased, which takes about a second, and 4 kB are programmed.
const COMMIT: Duration = Duration::from_secs(15);
/// Length of the raw stream that gives the temperature.
const LOOK: Duration = Duration::from_millis(100);
/// Times that an upload begins anew: a device that restarts in the middle of it has forgotten it.
const BEGINNINGS: u32 = 3;

/// How an upload went: the result of `mimu device upload`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Uploaded {
    /// What the calibration is told apart by.
    pub hash: Hash,
    /// Its length.
    pub bytes: usize,
    /// Hash of the calibration before, if there was one.
    pub before: Option<Hash>,
    /// The device held it already, byte by byte, and nothing was written.
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
/// `other_unit`: also if it is of another unit; refused by the device else.
///
/// Whatever fails, the device stores either the old calibration or the new one, complete. The error says which, if the device still
/// answers.
pub fn upload(
    session: &mut Session,
    image: &Image,
    other_unit: bool,
    progress: impl Fn(f64),
) -> Result<Uploaded> {
    let before = session.hello()?.stored.as_ref().map(|s| s.hash);
    let repeated = session.repeated();
    let was_there = before == Some(image.hash);
    let mut restarts = 0;
    if !was_there {
        while !send(session, image, other_unit, &progress)
            .map_err(|error| told(session, image, error))?
        {
            restarts += 1;
            if restarts == BEGINNINGS {
                let problem = format!("the device restarted in each of {BEGINNINGS} uploads");
                let remedy = "check its supply; `mimu device info` shows the reset cause";
                let error = Error::device(session.port(), problem, remedy);
                return Err(told(session, image, error));
            }
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
        warnings: image.warnings.clone(),
    })
}

/// Sends it once; `false` if the device has forgotten the beginning.
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
            // It knows better what it has.
            Answer::Refused(Refusal::WrongOffset { expected }) if (expected as usize) < offset => {
                offset = expected as usize;
            }
            Answer::Refused(refusal) => return Err(refused(session.port(), purpose, &refusal)),
            _ => return Err(session.unexpected(purpose)),
        }
        progress(0.5 * offset as f64 / image.bytes.len() as f64);
    }
    let purpose = "to store the calibration";
    match session.attempt(Request::UploadCommit, purpose, COMMIT)? {
        Answer::Done => {}
        // Either it restarted in between, or it has stored it and the answer was lost: the greeting tells the two apart.
        Answer::Refused(Refusal::NoUpload) => {
            return Ok(session
                .hello()?
                .stored
                .as_ref()
                .is_some_and(|s| s.hash == hash));
        }
        Answer::Refused(refusal) => return Err(refused(session.port(), purpose, &refusal)),
        _ => return Err(session.unexpected(purpose)),
    }
    if session
        .hello()?
        .stored
        .as_ref()
        .is_none_or(|s| s.hash != hash)
    {
        return Err(Error::device(
            session.port(),
            "it reports the calibration as stored, but greets with another one",
            "upload again",
        ));
    }
    Ok(true)
}

/// A warning if the device is now at a temperature that a calibration is not for: outside its curves, or for a calibration at one
/// temperature by more than 5 K. `None` if it is not, or if what it is for is not known; a tenth of a second of its raw stream is looked at.
pub fn outside_now(session: &mut Session, calibration: &Calibration) -> Result<Option<String>> {
    let Some([from, to]) = calibration.limits() else {
        return Ok(None);
    };
    let margin_k = match calibration.temperature {
        Some(_) => 0.0,
        None => BEYOND_C,
    };
    let seen = stream(session, Stream::Raw, Some(LOOK), || false, |_, _, _| Ok(()))?;
    let away_k = (from - seen.temp_c).max(seen.temp_c - to);
    Ok((away_k > margin_k).then(|| {
        format!(
            "the device is at {:.1} °C, {away_k:.1} K outside the {from:.1} to {to:.1} °C of the calibration",
            seen.temp_c
        )
    }))
}

/// `error`, with what the device holds now.
fn told(session: &mut Session, image: &Image, error: Error) -> Error {
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

/// The calibration in use, as the device stores it: read in parts, its hash compared with that of the greeting.
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
