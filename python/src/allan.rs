//! Noise of a unit at rest.

use std::sync::Arc;

use mimu::result::allan::AllanResult;
use mimu::survey::{Options, Part, survey_all};
use mimu_allan::Deviation;
use mimu_cli::report::{self, allan_plot, fragment};
use mimu_recording::error::Result;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::calibration::Calibration;
use crate::noise::Noise;
use crate::recording::{Recording, sources};
use crate::work::{computed, json};

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
    fn noise(&self) -> PyResult<Noise> {
        let file = self.result.noise_file(&self.created);
        let file = file.ok_or_else(|| PyValueError::new_err("no recording is given"))?;
        Ok(Noise {
            file: Arc::new(file),
        })
    }
}

/// Allan deviation and noise model of a unit at rest.
#[pyfunction]
#[pyo3(signature = (recordings, *, from_s, to_s, step, kind, per_decade, confidence, calibration))]
#[expect(clippy::too_many_arguments)]
pub(crate) fn allan(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    from_s: Option<f64>,
    to_s: Option<f64>,
    step: Option<i32>,
    kind: &str,
    per_decade: usize,
    confidence: f64,
    calibration: Option<&Calibration>,
) -> PyResult<Allan> {
    let refuse = |problem: String| Err(PyValueError::new_err(problem));
    if !(1..=100).contains(&per_decade) {
        return refuse(format!(
            "per_decade={per_decade}: write a number from 1 to 100"
        ));
    }
    if !(0.5..=0.999).contains(&confidence) {
        return refuse(format!(
            "confidence={confidence}: write a probability from 0.5 to 0.999"
        ));
    }
    let part = match (step, from_s, to_s) {
        (None, None, None) => Part::Whole,
        (Some(step), None, None) => Part::Step(step),
        (Some(_), ..) => {
            return refuse("both step and times choose the segment: give only one".into());
        }
        (None, Some(from), Some(to)) if !(from < to) => {
            return refuse(format!(
                "from_s={from} is not before to_s={to}: exchange them"
            ));
        }
        (None, from_s, to_s) => Part::Span { from_s, to_s },
    };
    let options = Options {
        part,
        kind: match kind {
            "allan" => Deviation::Allan,
            "modified" => Deviation::Modified,
            "hadamard" => Deviation::Hadamard,
            _ => return refuse(format!("kind={kind:?}: write allan, modified or hadamard")),
        },
        per_decade,
        confidence,
    };
    let sources = sources(&recordings, "recordings")?;
    let model = calibration.map(|calibration| calibration.model.clone());
    computed(py, move || {
        let samples = sources
            .iter()
            .map(|s| s.samples().map(|s| s.as_ref().clone()));
        let samples: Vec<_> = samples.collect::<Result<_>>()?;
        let surveys = survey_all(&samples, model.as_deref(), options, |_| {})?;
        Ok(Allan {
            result: AllanResult::of(&surveys),
            created: mimu_cli::now(),
        })
    })
}
