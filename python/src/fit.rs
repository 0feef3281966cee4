//! A fit of both triads.

use std::ffi::OsString;
use std::sync::Arc;

use mimu::quantity::Sensor;
use mimu_cli::called::{FitArgs, FitMade, SessionsMade, of_contents};
use mimu_cli::report::fragment;
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::error::refused;
use crate::noise::Noise;
use crate::recording::{Recording, sources};
use crate::work::{done, json};

/// A fit of a recording.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Fit {
    made: FitMade,
    model: Arc<mimu::Calibration>,
    /// Units of the arrays that the recording was made of.
    units: Option<String>,
}

#[pymethods]
impl Fit {
    /// JSON of the result, as `mimu fit --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.made.json())
    }

    /// The text that `mimu fit` prints.
    fn text(&self) -> String {
        self.made.text()
    }

    /// Tables and plots.
    fn html(&self) -> String {
        fragment::of_fit(&self.made.fit, &self.made.result, &self.model)
    }

    /// Covariance of C, by rows, and o of each triad, by rows.
    fn covariance(&self) -> Vec<(String, Vec<f64>)> {
        let of = |sensor: Sensor| {
            let covariance = self
                .made
                .fit
                .sensor(sensor)?
                .estimated
                .triad
                .inverse_covariance;
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
            name: format!("fit of {}", self.made.result.device),
            units: self.units.clone(),
        }
    }
}

/// A calibration of several sessions.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct SessionsFit {
    made: SessionsMade,
    model: Arc<mimu::Calibration>,
}

#[pymethods]
impl SessionsFit {
    /// JSON of the result, as `mimu fit --json` writes it for several recordings.
    fn json(&self) -> PyResult<String> {
        json(&self.made.json())
    }

    /// The text that `mimu fit` prints.
    fn text(&self) -> String {
        self.made.text(false)
    }

    /// The text as a page has it.
    fn html(&self) -> String {
        fragment::of_sessions(&self.made.result)
    }

    /// The calibration that it gives.
    fn calibration(&self) -> Calibration {
        Calibration {
            model: self.model.clone(),
            name: format!("sessions of {}", self.made.result.device),
            units: None,
        }
    }
}

/// Calibrates the gyro and the accelerometer of a recording, by the arguments of `mimu fit`.
#[pyfunction]
#[pyo3(signature = (recording, arguments, *, noise))]
pub(crate) fn fit(
    py: Python<'_>,
    recording: &Recording,
    arguments: Vec<OsString>,
    noise: Option<&Noise>,
) -> PyResult<Fit> {
    let (source, units) = (recording.source.clone(), recording.units.clone());
    let noise = noise.map(|noise| noise.file.clone());
    let work = move || {
        let args: FitArgs = of_contents("fit", arguments)?;
        let samples = source.samples().ok().map(|samples| &**samples);
        Ok(args.fitted((&*source.opener(), samples), noise.as_deref())?)
    };
    let made = done(py, work, refused)?;
    let model = Arc::new(made.calibration.clone());
    Ok(Fit { made, model, units })
}

/// One calibration of several sessions of a unit, by the arguments of `mimu fit`.
#[pyfunction]
#[pyo3(signature = (recordings, arguments, *, noise))]
pub(crate) fn fit_sessions(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    arguments: Vec<OsString>,
    noise: Option<&Noise>,
) -> PyResult<SessionsFit> {
    let sources = sources(py, &recordings)?;
    let noise = noise.map(|noise| noise.file.clone());
    let work = move || {
        let args: FitArgs = of_contents("fit", arguments)?;
        let open = sources.iter();
        let open: Vec<_> = open
            .map(|s| (s.opener(), s.samples().ok().map(|samples| &**samples)))
            .collect();
        Ok(args.combined(&open, noise.as_deref())?)
    };
    let made = done(py, work, refused)?;
    let model = Arc::new(made.calibration.clone());
    Ok(SessionsFit { made, model })
}
