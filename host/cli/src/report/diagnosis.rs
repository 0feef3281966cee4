//! What `mimu diagnose` says.

mod json;
mod page;
mod text;

pub use json::diagnosis_json;
pub use page::{Made, diagnosis_page};
pub use text::diagnosis_text;

use mimu::diagnose::Diagnosis;
use mimu::next_experiment::Next;
use mimu::verify::Verification;

/// A diagnosis, and the calibration before and after on a recording that it was not made from.
#[derive(Debug, Clone)]
pub struct DiagnosisReport {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// What to record next.
    pub next: Next,
    /// Name of the other recording, and its figures without and with the effects.
    pub second: Option<(String, [Verification; 2])>,
}

impl DiagnosisReport {
    /// What a person should know.
    pub fn warnings(&self) -> impl Iterator<Item = &String> {
        let d = &self.diagnosis;
        let second = self.second.iter();
        d.after
            .warnings
            .iter()
            .chain(d.after.sensors.iter().flat_map(|s| &s.warnings))
            .chain(second.flat_map(|(_, [_, after])| &after.warnings))
    }
}
