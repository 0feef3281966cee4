//! The command `mimu` of the wheel.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command with `arguments`, of which the first is the program; returns its exit status.
#[pyfunction]
pub(crate) fn run(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| mimu_cli::run(arguments))
}

/// Names of the options of a subcommand.
#[pyfunction]
pub(crate) fn options(subcommand: &str) -> Vec<String> {
    mimu_cli::called::options(subcommand)
}
