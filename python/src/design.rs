//! The design of an experiment.

use std::ffi::OsString;

use mimu_cli::called;
use mimu_cli::report::{self, fragment};
use pyo3::prelude::*;

use crate::error::refused;
use crate::work::{done, json};

/// A designed experiment.
#[pyclass(frozen, module = "mimu._mimu")]
pub(crate) struct Design {
    design: mimu::result::design::Design,
    plan: String,
}

#[pymethods]
impl Design {
    /// JSON of the result, as `mimu design --json` writes it.
    fn json(&self) -> PyResult<String> {
        json(&self.design)
    }

    /// The text that `mimu design` prints.
    fn text(&self) -> String {
        report::design_text(&self.design, false)
    }

    /// The text within a page.
    fn html(&self) -> String {
        fragment::of_design(&self.design)
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
    let (design, plan) = done(py, work, refused)?;
    Ok(Design { design, plan })
}
