//! Noise of a unit: at rest, as `mimu allan -o` writes it, and in use, as `mimu noise` finds it.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

use mimu::in_use;
use mimu::noise::noise_file::NoiseFile;
use mimu_cli::called::{NoiseInUseArgs, of_contents};
use mimu_cli::report::{self, fragment};
use mimu_recording::result_file::stage;
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::error::refused;
use crate::recording::Recording;
use crate::work::{computed, done, json, loaded};

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

/// Noise that explains the errors of dead reckoning in motion.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct NoiseInUse {
    found: in_use::NoiseInUse,
}

#[pymethods]
impl NoiseInUse {
    /// JSON of the result, as `mimu noise --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.found)
    }

    /// The text that `mimu noise` prints.
    fn text(&self) -> String {
        report::noise_in_use_text(&self.found)
    }

    /// The tables.
    fn html(&self) -> String {
        fragment::of_noise_in_use(&self.found)
    }

    /// The noise with these densities.
    fn noise(&self) -> Noise {
        Noise {
            file: Arc::new(self.found.noise_file.clone()),
        }
    }
}

/// Finds the noise of a unit in use, by the arguments of `mimu noise`.
#[pyfunction]
#[pyo3(signature = (recording, calibration, noise, arguments))]
pub(crate) fn noise_in_use(
    py: Python<'_>,
    recording: &Recording,
    calibration: Option<&Calibration>,
    noise: &Noise,
    arguments: Vec<OsString>,
) -> PyResult<NoiseInUse> {
    let (source, noise) = (recording.source.clone(), noise.file.clone());
    let given = calibration.map(|c| c.model.clone());
    let work = move || {
        let samples = source.samples()?;
        let model = match given {
            Some(given) => given,
            None => Arc::new(mimu::Calibration::of_si(&samples.manifest)?),
        };
        let args: NoiseInUseArgs = of_contents("noise", arguments)?;
        let found = args.found(samples, &model, &noise, &|_| ())?;
        Ok(NoiseInUse { found })
    };
    done(py, work, refused)
}
