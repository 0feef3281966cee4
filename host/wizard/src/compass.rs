//! The magnetometer of a unit while a person turns it: whether the field is that of the poses before.
//!
//! The recording at the end shows what disturbed it, but then the person has gone through all poses beside the steel.

use std::collections::VecDeque;
use std::sync::Arc;

use mimu::fit::Fit;
use mimu_body::{Departure, FieldSoFar};
use mimu_recording::Recording;
use nalgebra::Vector3;

use crate::folder::OpenRecording;
use crate::source::Chunk;
use crate::watch::LastSecond;

/// The field is fitted again when the number of dwells has grown by this factor: a fit of all samples after each dwell would take longer than the dwells.
const GROWN: f64 = 1.2;
/// Ratio below which a departure is over: less than where it began, so that it does not come and go.
const OVER: f64 = 0.6;
/// Scatter of the size of the field from pose to pose, as a share of it, beyond which no pose is a measure of the others.
const VARIES: f64 = 0.02;

/// Readings of the last second, and the field so far.
#[derive(Debug, Default)]
pub struct Compass {
    recent: VecDeque<[f64; 3]>,
    next: u64,
    so_far: Option<FieldSoFar>,
    /// Number of dwells of the last fit.
    fitted: usize,
    is_off: bool,
    varies: bool,
    /// What is wrong now.
    pub words: Option<String>,
}

impl Compass {
    /// Keeps the readings of the last second.
    pub fn take(&mut self, chunk: &Chunk, rate_hz: f64) {
        if chunk.tick != self.next {
            self.recent.clear();
        }
        self.next = chunk.end();
        self.recent.extend(&chunk.mag);
        let most = (rate_hz as usize).max(1);
        self.recent.drain(..self.recent.len().saturating_sub(most));
    }

    /// Fits the field to the recording so far, if its dwells are enough more than before. What cannot be read here is refused where the recording is used.
    pub fn refit(&mut self, recording: &OpenRecording, unit: &Fit) {
        let dwells = unit.prepared.dwells.list.len();
        if self.recent.is_empty() || (dwells as f64) < GROWN * self.fitted as f64 {
            return;
        }
        let samples = Arc::new(recording.samples.clone());
        let in_memory = Recording::in_memory(recording.manifest().clone(), samples);
        let found = in_memory.and_then(|recording| FieldSoFar::of(&recording, unit));
        if let Ok(Some(found)) = found {
            (self.so_far, self.fitted) = (Some(found), dwells);
        }
    }

    /// Judges the last second; `rests`: whether the unit rests. Returns what was not said yet.
    pub fn judge(&mut self, seen: &LastSecond, rests: bool) -> Option<String> {
        let so_far = self.so_far.as_ref()?;
        let scatter = so_far.scatter();
        if scatter > VARIES {
            let words = format!(
                "the field differs by {:.0} % from pose to pose: for the magnetometer, begin anew away from the desk",
                100.0 * scatter
            );
            self.words = Some(words);
            let said = std::mem::replace(&mut self.varies, true);
            return self.words.clone().filter(|_| !said);
        }
        let force = Vector3::from_fn(|c, _| seen.mean[3 + c]);
        let readings = self.recent.make_contiguous();
        let departure = so_far.departure(readings, rests.then_some(force));
        let limit = if self.is_off { OVER } else { 1.0 };
        let off = departure.filter(|d| d.worst() > limit);
        self.words = off.as_ref().map(Departure::words);
        let was_off = std::mem::replace(&mut self.is_off, off.is_some());
        self.words.clone().filter(|_| !was_off)
    }
}
