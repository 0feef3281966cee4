//! A calibration judged by another recording.

use mimu::calibration::verify::Verification as Verified;
use mimu_cli::report::{self, fragment};
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::noise::Noise;
use crate::preparation::Preparation;
use crate::recording::Recording;
use crate::work::{computed, json};

/// Errors of a calibration on another recording.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Verification {
    verified: Verified,
    recording: String,
}

#[pymethods]
impl Verification {
    /// JSON of the result, as `mimu verify --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.verified)
    }

    /// The text that `mimu verify` prints.
    fn text(&self) -> String {
        report::verify_text(&self.verified, false)
    }

    /// A table.
    fn html(&self) -> String {
        fragment::of_verification(&self.recording, &self.verified)
    }
}

/// Judges a calibration by a recording.
#[pyfunction]
#[pyo3(signature = (recording, calibration, *, still, steps, noise))]
pub(crate) fn verify(
    py: Python<'_>,
    recording: &Recording,
    calibration: &Calibration,
    still: Option<f64>,
    steps: Option<&str>,
    noise: Option<&Noise>,
) -> PyResult<Verification> {
    let by = Preparation::of(still, steps, None, noise)?;
    let (source, model) = (recording.source.clone(), calibration.model.clone());
    computed(py, move || {
        let prepared = source.prepared(&by)?;
        let verified = mimu::calibration::verify::verify(&prepared, &model)?;
        Ok(Verification {
            verified,
            recording: prepared.manifest.device,
        })
    })
}
