//! What `mimu diagnose` says.

mod json;
mod text;

pub use json::diagnosis_json;
pub use text::diagnosis_text;

use crate::diagnose::Diagnosis;
use crate::verify::Verification;

/// A diagnosis, and the calibration before and after on a recording that it was not made from.
#[derive(Debug, Clone)]
pub struct DiagnosisReport {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// Name of the other recording, and its figures without and with the effects.
    pub second: Option<(String, [Verification; 2])>,
}
