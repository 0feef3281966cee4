//! A calibration judged by another recording.

use std::ffi::OsString;

use mimu_cli::called::{Verified, VerifyArgs, of_contents};
use mimu_cli::report::fragment;
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::error::refused;
use crate::noise::Noise;
use crate::recording::Recording;
use crate::work::{done, json};

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
        json(&self.verified.json())
    }

    /// The text that `mimu verify` prints.
    fn text(&self) -> String {
        self.verified.text(false)
    }

    /// A table.
    fn html(&self) -> String {
        fragment::of_verification(&self.recording, &self.verified.result)
    }
}

/// Judges a calibration by a recording, by the arguments of `mimu verify`.
#[pyfunction]
#[pyo3(signature = (recording, calibration, arguments, *, noise))]
pub(crate) fn verify(
    py: Python<'_>,
    recording: &Recording,
    calibration: &Calibration,
    arguments: Vec<OsString>,
    noise: Option<&Noise>,
) -> PyResult<Verification> {
    let (source, model) = (recording.source.clone(), calibration.model.clone());
    let noise = noise.map(|noise| noise.file.clone());
    let work = move || {
        let args: VerifyArgs = of_contents("verify", arguments)?;
        let made = args.judged(&*source.opener(), noise.as_deref(), &model)?;
        let samples = source.samples().ok().map(|samples| &**samples);
        Ok(made.with_body(samples)?)
    };
    Ok(Verification {
        verified: done(py, work, refused)?,
        recording: recording.source.manifest().device.clone(),
    })
}
