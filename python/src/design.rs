//! The design of an experiment.

use std::ffi::OsString;

use mimu_cli::called::{self, Designed};
use mimu_cli::report::fragment;
use pyo3::prelude::*;

use crate::error::refused;
use crate::work::{done, json};

/// A designed experiment.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Design {
    made: Designed,
    plan: String,
}

#[pymethods]
impl Design {
    /// JSON of the result, as `mimu design --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.made)
    }

    /// The text that `mimu design` prints.
    fn text(&self) -> String {
        self.made.text(false)
    }

    /// The text as HTML.
    fn html(&self) -> String {
        fragment::of_text(&self.made.text(true))
    }

    /// The plan for a table or a person, as `mimu design -o` writes it.
    fn plan(&self) -> &str {
        &self.plan
    }
}

/// Designs an experiment by the arguments of `mimu design`.
#[pyfunction]
pub(crate) fn design(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<Design> {
    let work = move || called::design(arguments);
    let (made, plan) = done(py, work, refused)?;
    Ok(Design { made, plan })
}
