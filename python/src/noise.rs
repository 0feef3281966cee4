//! Noise of a unit at rest, as `mimu allan -o` writes it.

use std::path::PathBuf;
use std::sync::Arc;

use mimu::noise::noise_file::NoiseFile;
use mimu_recording::result_file::stage;
use pyo3::prelude::*;

use crate::work::{computed, json, loaded};

/// Noise of a unit at rest.
#[pyclass(frozen, module = "mimu")]
pub(crate) struct Noise {
    pub(crate) file: Arc<NoiseFile>,
}

#[pymethods]
impl Noise {
    /// Name of the unit.
    #[getter]
    fn device(&self) -> &str {
        &self.file.device
    }

    /// The contents of the noise file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        loaded(py, &json(self.file.as_ref())?)
    }

    /// Writes the noise file, whole or not at all.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let file = self.file.clone();
        computed(py, move || stage(&path, file.to_toml())?.publish())
    }

    /// The noise file, as the command writes it.
    fn to_toml(&self) -> String {
        self.file.to_toml()
    }

    /// For pickle and for other processes.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let made = py.import("mimu._mimu")?.getattr("parse_noise")?;
        Ok((made, (self.to_toml(),)))
    }

    fn __repr__(&self) -> String {
        let NoiseFile {
            device,
            duration_s,
            sample_rate_hz,
            ..
        } = self.file.as_ref();
        format!("<mimu.Noise {device:?}: {duration_s:.1} s at rest, {sample_rate_hz:.6} Hz>")
    }
}

/// Noise from the text of its file.
#[pyfunction]
pub(crate) fn parse_noise(py: Python<'_>, text: String) -> PyResult<Noise> {
    let file = computed(py, move || NoiseFile::parse(&text, "pickle"))?;
    Ok(Noise {
        file: Arc::new(file),
    })
}

/// Reads a noise file.
#[pyfunction]
pub(crate) fn load_noise(py: Python<'_>, path: PathBuf) -> PyResult<Noise> {
    let file = computed(py, move || NoiseFile::read(&path))?;
    Ok(Noise {
        file: Arc::new(file),
    })
}
