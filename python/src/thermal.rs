//! Curves over temperature.

use std::ffi::OsString;
use std::sync::Arc;

use mimu_cli::called::{ThermalFitArgs, of_contents};
use mimu_cli::report::{self, Made, fragment};
use mimu_recording::error::Result;
use mimu_thermal::base;
use mimu_thermal::fit::{ThermalFit as Fitted, fit};
use mimu_thermal::result::ThermalResult;
use mimu_thermal::session::Session;
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::error::{raised, refused};
use crate::noise::Noise;
use crate::recording::{Recording, Source, sources};
use crate::work::{done, json};

/// A fit over temperature.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct ThermalFit {
    fitted: Fitted,
    result: ThermalResult,
    base: Option<Arc<mimu::Calibration>>,
    created: String,
}

#[pymethods]
impl ThermalFit {
    /// JSON of the result, as `mimu thermal fit --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.result)
    }

    /// The text that `mimu thermal fit` prints.
    fn text(&self) -> String {
        report::thermal_text(&self.result, false)
    }

    /// The content of the page, as a fragment of HTML.
    fn html(&self) -> String {
        let places = self.result.recordings.iter().map(|r| r.samples.as_str());
        let made = Made {
            recording: places.collect::<Vec<_>>().join(", "),
            command: "mimu.thermal.fit".into(),
            created: self.created.clone(),
        };
        fragment::of_thermal(&self.result, &made)
    }

    /// The calibration with its curves.
    fn calibration(&self, py: Python<'_>) -> PyResult<Calibration> {
        let made = match &self.base {
            None => self.fitted.calibration(&self.created),
            Some(base) => base::calibration(&self.fitted, base, &self.created),
        };
        Ok(Calibration {
            model: Arc::new(made.map_err(|error| raised(py, &error))?),
            name: format!("fit of {} over temperature", self.result.device),
            units: None,
        })
    }
}

/// Estimates all parameters over temperature, and the lag of the dies behind the thermometer, by the arguments of `mimu thermal fit`.
#[pyfunction]
#[pyo3(signature = (recordings, arguments, *, verify, base, noise))]
pub(crate) fn thermal_fit(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    arguments: Vec<OsString>,
    verify: Vec<PyRef<'_, Recording>>,
    base: Option<&Calibration>,
    noise: Option<&Noise>,
) -> PyResult<ThermalFit> {
    let verify: Vec<Source> = verify.iter().map(|r| r.source.clone()).collect();
    let sources = sources(py, &recordings)?;
    let base = base.map(|base| base.model.clone());
    let noise = noise.map(|noise| noise.file.clone());
    let work = move || {
        let args: ThermalFitArgs = of_contents("fit", arguments)?;
        let session = |source: &Source| {
            source.samples()?;
            let prepared = source.opener()(args.search())?;
            match &noise {
                Some(noise) => Session::of(&prepared.with_noise(noise)?),
                None => Session::of(&prepared),
            }
        };
        let all = |list: &[Source]| list.iter().map(session).collect::<Result<Vec<_>>>();
        let fitted = fit(all(&sources)?, &all(&verify)?, args.options())?;
        Ok(ThermalFit {
            result: ThermalResult::of(&fitted),
            fitted,
            base,
            created: mimu_cli::now(),
        })
    };
    done(py, work, refused)
}
