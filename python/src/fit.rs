//! A fit of both triads.

use std::sync::Arc;

use mimu::fit::{Method, Options};
use mimu::quantity::Sensor;
use mimu::result::fit::FitResult;
use mimu_cli::report::{self, fragment};
use mimu_recording::Reference;
use mimu_recording::error::Error;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::calibration::{Calibration, named};
use crate::noise::Noise;
use crate::preparation::{KeptSteps, Preparation};
use crate::recording::Recording;
use crate::work::{computed, json};

/// A fit of a recording.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Fit {
    fit: mimu::Fit,
    result: FitResult,
    model: Arc<mimu::Calibration>,
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

/// Calibrates the gyro and the accelerometer of a recording.
#[pyfunction]
#[pyo3(signature = (recording, *, holdout, method, only, still, steps, keep, noise))]
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
) -> PyResult<Fit> {
    if holdout == 1 || holdout > 1000 {
        let problem = format!("holdout={holdout}: write 2 to 1000 blocks, or 0 for none");
        return Err(PyValueError::new_err(problem));
    }
    let by = Preparation::of(still, steps, keep, noise)?;
    let options = Options {
        method: method.map_or(Ok(Method::LeastSquares), self::method)?,
        holdout_blocks: holdout,
        only: only.map(named).transpose()?,
    };
    let (source, chosen) = (recording.source.clone(), method.is_some());
    computed(py, move || {
        let prepared = source.prepared(&by)?;
        if chosen && prepared.manifest.reference == Reference::Gravity {
            return Err(Error::new(
                &prepared.place,
                "method chooses between estimators for known inputs, and reference is \"gravity\"",
                "leave method out, or give the dwells their inputs (reference = \"table\")",
            ));
        }
        let fit = mimu::fit(prepared, options)?;
        let model = mimu::Calibration::of(&fit, &[], &mimu_cli::now())?;
        Ok(Fit {
            result: FitResult::of(&fit),
            model: Arc::new(model),
            fit,
        })
    })
}
