//! Curves over temperature.

use std::sync::Arc;

use mimu_cli::report::{self, Made, fragment};
use mimu_recording::error::Result;
use mimu_thermal::base;
use mimu_thermal::classic::Classic;
use mimu_thermal::fit::{Estimator, Options, ThermalFit as Fitted, fit};
use mimu_thermal::result::ThermalResult;
use mimu_thermal::session::Session;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::error::raised;
use crate::noise::Noise;
use crate::preparation::Preparation;
use crate::recording::{Recording, Source, sources};
use crate::work::{computed, json};

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

fn estimator(name: &str) -> PyResult<Estimator> {
    let all = [
        Estimator::Joint,
        Estimator::Cubic,
        Estimator::Classic(Classic::Nodes),
        Estimator::Classic(Classic::RampNiu),
        Estimator::Classic(Classic::Soak),
        Estimator::Classic(Classic::SoakAsPrinted),
        Estimator::Classic(Classic::SoakConstantM),
    ];
    let found = all.into_iter().find(|estimator| estimator.name() == name);
    found.ok_or_else(|| {
        let known = all.map(Estimator::name).join(", ");
        PyValueError::new_err(format!("estimator={name:?}: choose one of {known}"))
    })
}

/// Estimates all parameters over temperature, and the lag of the dies behind the thermometer.
#[pyfunction]
#[pyo3(signature = (recordings, *, verify, estimator, lag_s, range_c, base, noise, still, steps))]
#[expect(clippy::too_many_arguments)]
pub(crate) fn thermal_fit(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    verify: Vec<PyRef<'_, Recording>>,
    estimator: &str,
    lag_s: Option<f64>,
    range_c: Option<[f64; 2]>,
    base: Option<&Calibration>,
    noise: Option<&Noise>,
    still: Option<f64>,
    steps: Option<&str>,
) -> PyResult<ThermalFit> {
    let by = Preparation::of(still, steps, None, noise)?;
    let refuse = |problem: String| Err(PyValueError::new_err(problem));
    if lag_s.is_some_and(|lag| !(-120.0..=600.0).contains(&lag)) {
        return refuse("lag_s: write seconds from -120 (the dies lead) to 600".into());
    }
    if range_c.is_some_and(|[from, to]| !(from < to)) {
        return refuse("range_c: write (lowest, highest) in degrees Celsius".into());
    }
    let options = Options {
        estimator: self::estimator(estimator)?,
        lag_s,
        range_c,
    };
    let verify: Vec<Source> = verify.iter().map(|r| r.source.clone()).collect();
    let (sources, base) = (
        sources(&recordings, "recordings")?,
        base.map(|b| b.model.clone()),
    );
    computed(py, move || {
        let session = |source: &Source| {
            source.samples()?;
            Session::of(&source.prepared(&by)?)
        };
        let all = |list: &[Source]| list.iter().map(session).collect::<Result<Vec<_>>>();
        let fitted = fit(all(&sources)?, &all(&verify)?, options)?;
        Ok(ThermalFit {
            result: ThermalResult::of(&fitted),
            fitted,
            base,
            created: mimu_cli::now(),
        })
    })
}
