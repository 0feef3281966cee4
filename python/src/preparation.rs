//! How the dwells of a recording are found, which of them are always kept, and its noise.

use std::sync::Arc;

use mimu::noise::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::signal::dwell::Keep;
use mimu::signal::stillness::{DwellSearch, STILL_FACTOR, Steps};
use mimu_recording::error::Result;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::noise::Noise;

/// How recordings are prepared for estimation.
#[derive(Clone)]
pub(crate) struct Preparation {
    pub(crate) still_factor: f64,
    steps: Steps,
    keep: Keep,
    noise: Option<Arc<NoiseFile>>,
}

/// Dwells that are kept: `all`, or their numbers.
#[derive(FromPyObject)]
pub(crate) enum KeptSteps {
    Word(String),
    Numbers(Vec<i32>),
}

impl Preparation {
    /// From the options given in Python.
    ///
    /// # Errors
    /// A word is unknown.
    pub(crate) fn of(
        still: Option<f64>,
        steps: Option<&str>,
        keep: Option<KeptSteps>,
        noise: Option<&Noise>,
    ) -> PyResult<Self> {
        let unknown = |what: String| Err(PyValueError::new_err(what));
        Ok(Self {
            still_factor: still.unwrap_or(STILL_FACTOR),
            steps: match steps {
                None => Steps::AsRecorded,
                Some("given") => Steps::Given,
                Some("found") => Steps::Found,
                Some("at rest") => Steps::AtRest,
                Some(other) => return unknown(format!("steps={other:?}: write given or found")),
            },
            keep: match keep {
                None => Keep::default(),
                Some(KeptSteps::Numbers(steps)) => Keep::Steps(steps),
                Some(KeptSteps::Word(word)) if word == "all" => Keep::Everything,
                Some(KeptSteps::Word(other)) => {
                    let problem = "write all, or a list of numbers of dwells";
                    return unknown(format!("keep={other:?}: {problem}"));
                }
            },
            noise: noise.map(|noise| noise.file.clone()),
        })
    }

    pub(crate) fn search(&self) -> DwellSearch {
        DwellSearch {
            still_factor: self.still_factor,
            steps: self.steps,
        }
    }

    /// `prepared` with its noise, and with the dwells that must be kept.
    pub(crate) fn complete(&self, prepared: Prepared) -> Result<Prepared> {
        let mut prepared = match &self.noise {
            Some(file) => prepared.with_noise(file)?,
            None => prepared,
        };
        prepared.dwells.keep = self.keep.clone();
        Ok(prepared)
    }
}
