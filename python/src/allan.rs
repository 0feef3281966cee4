//! Noise of a unit at rest.

use std::ffi::OsString;
use std::sync::Arc;

use mimu::noise::noise_file::NoiseFile;
use mimu::result::allan::AllanResult;
use mimu::survey::survey_all;
use mimu_cli::called::{AllanArgs, of_contents};
use mimu_cli::report::{self, allan_plot, fragment};
use mimu_recording::error::{Error, Result};
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::error::{raised, refused};
use crate::noise::Noise;
use crate::recording::{Recording, sources};
use crate::work::{done, json};

/// Noise from recordings of a unit at rest.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Allan {
    result: AllanResult,
    created: String,
}

#[pymethods]
impl Allan {
    /// JSON of the result, as `mimu allan --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.result)
    }

    /// The text that `mimu allan` prints.
    fn text(&self) -> String {
        report::allan_text(&self.result, false)
    }

    /// Tables and plots.
    fn html(&self) -> String {
        fragment::of_allan(&self.result)
    }

    /// The plot that `mimu allan --plot` writes.
    fn svg(&self) -> String {
        allan_plot::svg(&self.result)
    }

    /// What the other functions take as noise.
    fn noise(&self, py: Python<'_>) -> PyResult<Noise> {
        let file = self.result.noise_file(&self.created).ok_or_else(|| {
            let remedy = "give one recording at least";
            raised(py, &Error::new("noise", "no recording is given", remedy))
        })?;
        Ok(Noise {
            file: Arc::new(NoiseFile {
                place: format!("the noise of {}", file.device),
                ..file
            }),
        })
    }
}

/// Allan deviation and noise model of a unit at rest, by the arguments of `mimu allan`.
#[pyfunction]
#[pyo3(signature = (recordings, arguments, *, calibration))]
pub(crate) fn allan(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    arguments: Vec<OsString>,
    calibration: Option<&Calibration>,
) -> PyResult<Allan> {
    let sources = sources(py, &recordings)?;
    let model = calibration.map(|calibration| calibration.model.clone());
    let work = move || {
        let options = of_contents::<AllanArgs>("allan", arguments)?.options()?;
        let samples = sources
            .iter()
            .map(|s| s.samples().map(|s| s.as_ref().clone()));
        let samples: Vec<_> = samples.collect::<Result<_>>()?;
        let surveys = survey_all(&samples, model.as_deref(), options, |_| {})?;
        Ok(Allan {
            result: AllanResult::of(&surveys),
            created: mimu_cli::now(),
        })
    };
    done(py, work, refused)
}
