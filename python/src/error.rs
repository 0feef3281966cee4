//! Errors in Python: `mimu.Error` with the parts of the line that the command prints.

use mimu_cli::called::{Refusal, flags};
use mimu_recording::error::Error;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// `text` of the command with keywords in place of its options.
pub(crate) fn keywords(py: Python<'_>, text: &str) -> PyResult<String> {
    let said = py
        .import("mimu._error")?
        .call_method1("keywords", (text,))?;
    said.extract()
}

/// The exception for an error of the library.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let parts = error.refused();
    let parts = (
        &parts.place,
        &parts.problem,
        &parts.remedy,
        kind(error),
        flags(error),
    );
    let made = || {
        let class = py.import("mimu._error")?.getattr("Error")?;
        class.call_method1("of", parts)
    };
    made().map_or_else(|other| other, PyErr::from_value)
}

fn kind(error: &Error) -> &'static str {
    match error {
        Error::Io(..) => "io",
        Error::Undetermined(_) => "undetermined",
        Error::Device(_) => "device",
        _ => "invalid",
    }
}

/// The exception for a refused call.
pub(crate) fn refused(py: Python<'_>, refusal: &Refusal) -> PyErr {
    match refusal {
        Refusal::Data(error) => raised(py, error),
        // Python calls a keyword that does not exist an error of type, and a value that cannot be one of value.
        Refusal::Usage(problem) if problem.starts_with("unexpected argument") => {
            keywords(py, problem).map_or_else(|other| other, PyTypeError::new_err)
        }
        Refusal::Usage(problem) => {
            let mut words = problem.split([' ', '\'']);
            let place = words.find(|word| word.starts_with("--"));
            let remedy = "see the documentation of the function";
            raised(
                py,
                &Error::new(place.unwrap_or("arguments"), problem, remedy),
            )
        }
    }
}
