//! A fit of both triads.

use std::path::PathBuf;
use std::sync::Arc;

use mimu::fit::{Method, Options, fit_or_faces};
use mimu::prior::Prior;
use mimu::quantity::Sensor;
use mimu::result::fit::FitResult;
use mimu::result::sessions::SessionsResult;
use mimu::sessions::class::PartClass;
use mimu::sessions::{Sessions, fit_determined};
use mimu_cli::report::{self, fragment};
use mimu_recording::Reference;
use mimu_recording::error::Error;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::calibration::{Calibration, named};
use crate::noise::Noise;
use crate::preparation::{KeptSteps, Preparation};
use crate::recording::{Recording, Source};
use crate::work::{computed, json};

/// A fit of a recording.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Fit {
    fit: mimu::Fit,
    result: FitResult,
    model: Arc<mimu::Calibration>,
    /// Units of the arrays that the recording was made of.
    units: Option<String>,
}

#[pymethods]
impl Fit {
    /// JSON of the result, as `mimu fit --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.result)
    }

    /// The text that `mimu fit` prints.
    fn text(&self) -> String {
        report::fit_text(&self.result, false)
    }

    /// Tables and plots.
    fn html(&self) -> String {
        fragment::of_fit(&self.fit, &self.result, &self.model)
    }

    /// Covariance of C, by rows, and o of each triad, by rows.
    fn covariance(&self) -> Vec<(String, Vec<f64>)> {
        let of = |sensor: Sensor| {
            let covariance = self.fit.sensor(sensor)?.estimated.triad.inverse_covariance;
            Some((
                sensor.to_string(),
                covariance.transpose().as_slice().to_vec(),
            ))
        };
        Sensor::BOTH.into_iter().filter_map(of).collect()
    }

    /// The calibration that it gives.
    fn calibration(&self) -> Calibration {
        Calibration {
            model: self.model.clone(),
            name: format!("fit of {}", self.result.device),
            units: self.units.clone(),
        }
    }
}

fn method(name: &str) -> PyResult<Method> {
    Ok(match name {
        "least-squares" => Method::LeastSquares,
        "kalman" => Method::Kalman,
        "inverse-form" => Method::InverseForm,
        "six-positions" => Method::SixPositions,
        _ => {
            let known = "write least-squares, kalman, inverse-form or six-positions";
            return Err(PyValueError::new_err(format!("method={name:?}: {known}")));
        }
    })
}

/// A calibration of several sessions.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct SessionsFit {
    result: SessionsResult,
    model: Arc<mimu::Calibration>,
}

#[pymethods]
impl SessionsFit {
    /// JSON of the result, as `mimu fit --json` writes it for several recordings.
    fn json(&self) -> PyResult<String> {
        json(&self.result)
    }

    /// The text that `mimu fit` prints.
    fn text(&self) -> String {
        report::sessions_text(&self.result, false)
    }

    /// The text as a page has it.
    fn html(&self) -> String {
        fragment::of_sessions(&self.result)
    }

    /// The calibration that it gives.
    fn calibration(&self) -> Calibration {
        Calibration {
            model: self.model.clone(),
            name: format!("sessions of {}", self.result.device),
            units: None,
        }
    }
}

/// One calibration of several sessions of a unit.
#[pyfunction]
#[pyo3(signature = (recordings, *, part_class, holdout, still, steps, noise))]
pub(crate) fn fit_sessions(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    part_class: &str,
    holdout: usize,
    still: Option<f64>,
    steps: Option<&str>,
    noise: Option<&Noise>,
) -> PyResult<SessionsFit> {
    let class = match part_class {
        "consumer" => PartClass::Consumer,
        "tactical" => PartClass::Tactical,
        _ => {
            let problem = format!("part_class={part_class:?}: write consumer or tactical");
            return Err(PyValueError::new_err(problem));
        }
    };
    let options = Options {
        holdout_blocks: blocks(holdout)?,
        ..Options::default()
    };
    let by = Preparation::of(still, steps, None, noise)?;
    let sources: Vec<_> = recordings.iter().map(|r| r.source.clone()).collect();
    computed(py, move || {
        let fitted = |source: &Source| fit_determined(source.prepared(&by)?, options);
        let fits: Result<Vec<mimu::Fit>, Error> = sources.iter().map(fitted).collect();
        let sessions = Sessions::combine(fits?, class)?;
        let combined = mimu::Calibration::of_sessions(&sessions, &mimu_cli::now())?;
        Ok(SessionsFit {
            result: SessionsResult::of(&sessions, &combined),
            model: Arc::new(combined.calibration),
        })
    })
}

fn blocks(holdout: usize) -> PyResult<usize> {
    if holdout == 1 || holdout > 1000 {
        let problem = format!("holdout={holdout}: write 2 to 1000 blocks, or 0 for none");
        return Err(PyValueError::new_err(problem));
    }
    Ok(holdout)
}

/// Calibrates the gyro and the accelerometer of a recording.
#[pyfunction]
#[pyo3(signature = (recording, *, holdout, method, only, still, steps, keep, noise, prior))]
#[expect(clippy::too_many_arguments)]
pub(crate) fn fit(
    py: Python<'_>,
    recording: &Recording,
    holdout: usize,
    method: Option<&str>,
    only: Option<&str>,
    still: Option<f64>,
    steps: Option<&str>,
    keep: Option<KeptSteps>,
    noise: Option<&Noise>,
    prior: Option<PathBuf>,
) -> PyResult<Fit> {
    let by = Preparation::of(still, steps, keep, noise)?;
    let options = Options {
        method: method.map_or(Ok(Method::LeastSquares), self::method)?,
        holdout_blocks: blocks(holdout)?,
        only: only.map(named).transpose()?,
    };
    let (source, chosen) = (recording.source.clone(), method.is_some());
    let units = recording.units.clone();
    computed(py, move || {
        let prepared = source.prepared(&by)?;
        if chosen && prepared.manifest.reference == Reference::Gravity {
            return Err(Error::new(
                &prepared.place,
                "method chooses between estimators for known inputs, and reference is \"gravity\"",
                "leave method out, or give the dwells their inputs (reference = \"table\")",
            ));
        }
        let prepared = match prior {
            Some(path) => prepared.with_prior(Arc::new(Prior::read(&path)?))?,
            None => prepared,
        };
        let fit = fit_or_faces(prepared, options)?;
        let model = mimu::Calibration::of(&fit, &[], &mimu_cli::now())?;
        Ok(Fit {
            result: FitResult::of(&fit),
            model: Arc::new(model),
            units,
            fit,
        })
    })
}
