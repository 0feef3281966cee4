//! A calibration or noise in the format of another program.

use std::ffi::OsString;
use std::path::PathBuf;

use mimu_cli::called;
use mimu_export::Sources;
use mimu_recording::result_file::stage;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::calibration::Calibration;
use crate::error::refused;
use crate::noise::Noise;
use crate::work::{computed, done, json};

/// A file for another program.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Export {
    made: mimu_export::Export,
}

#[pymethods]
impl Export {
    /// Bytes of the file.
    fn content<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.made.content)
    }

    /// JSON of formulas, notes and the errors that remain.
    fn json(&self) -> PyResult<String> {
        json(&self.made)
    }
}

/// Writes a file, whole or not at all.
#[pyfunction]
pub(crate) fn write(py: Python<'_>, path: PathBuf, content: Vec<u8>) -> PyResult<()> {
    computed(py, move || stage(&path, content)?.publish())
}

/// Exports by the arguments of `mimu export`, from the name of the format on.
#[pyfunction]
#[pyo3(signature = (arguments, *, calibration, noise))]
pub(crate) fn export(
    py: Python<'_>,
    arguments: Vec<OsString>,
    calibration: Option<&Calibration>,
    noise: Option<&Noise>,
) -> PyResult<Export> {
    let calibration = calibration.map(|c| (c.model.clone(), c.name.clone()));
    let noise = noise.map(|noise| noise.file.clone());
    let work = move || {
        let from = Sources {
            calibration: calibration
                .as_ref()
                .map(|(model, name)| (model.as_ref(), name.as_str())),
            biases: None,
            noise: noise.as_deref(),
        };
        called::export(arguments, &from)
    };
    let made = done(py, work, refused)?;
    Ok(Export { made })
}
