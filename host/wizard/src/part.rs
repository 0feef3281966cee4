//! The recordings of a session.

use serde::{Deserialize, Serialize};

/// A recording of the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, strum::IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Part {
    /// For the calibration.
    Calibration,
    /// For the verification.
    Verification,
    /// For the verification of the calibration with effects.
    Confirmation,
}

impl Part {
    /// Name of the recording's directory.
    pub fn name(self) -> &'static str {
        self.into()
    }
}
