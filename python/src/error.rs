//! Errors in Python: `mimu.Error` with the parts of the line that the command prints.

use mimu_cli::called::Refusal;
use mimu_recording::error::Error;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Place of an error, read from `PLACE` of its line: `FILE, row 7, column gyro_x`.
#[derive(Default)]
struct Place<'a> {
    file: Option<&'a str>,
    row: Option<u64>,
    column: Option<&'a str>,
}

impl<'a> Place<'a> {
    fn of(place: &'a str) -> Self {
        let mut parts = place.split(", ");
        let mut found = Self {
            file: parts.next().filter(|file| !file.is_empty()),
            ..Self::default()
        };
        for part in parts {
            match part.split_once(' ') {
                Some(("row", number)) => found.row = number.parse().ok(),
                // Counted without the header, unlike rows that are lines of an editor.
                Some(("data", number)) => {
                    found.row = number.strip_prefix("row ").and_then(|n| n.parse().ok());
                }
                Some(("column", name)) => found.column = Some(name),
                _ if part == "t_s" => found.column = Some(part),
                _ => {}
            }
        }
        found
    }
}

/// `text` with options of the command as keywords: `--rate-hz` is `rate_hz` in Python.
pub(crate) fn keywords(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find("--") {
        let (before, option) = (&rest[..at], &rest[at + 2..]);
        let part = |c: char| c.is_ascii_lowercase() || c == '-';
        let length = option.find(|c| !part(c)).unwrap_or(option.len());
        out.push_str(before);
        // What follows a dash in a sentence or a name is no option.
        let is_one = option.starts_with(|c: char| c.is_ascii_lowercase())
            && !before.ends_with(|c: char| c.is_alphanumeric() || c == '-');
        match is_one {
            true => out.push_str(&option[..length].replace('-', "_")),
            false => out.push_str(&rest[at..at + 2 + length]),
        }
        rest = &option[length..];
    }
    out + rest
}

/// The exception for an error of the library.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let refused = error.refused();
        let place = Place::of(&refused.place);
        let parts = PyDict::new(py);
        parts.set_item("kind", kind(error))?;
        parts.set_item("place", &refused.place)?;
        parts.set_item("problem", keywords(&refused.problem))?;
        parts.set_item("remedy", keywords(&refused.remedy))?;
        parts.set_item("file", place.file)?;
        parts.set_item("row", place.row)?;
        parts.set_item("column", place.column)?;
        let class = py.import("mimu._error")?.getattr("Error")?;
        let exception = class.call((keywords(&error.to_string()),), Some(&parts))?;
        Ok(PyErr::from_value(exception))
    };
    made().unwrap_or_else(|other| other)
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
            PyTypeError::new_err(keywords(problem))
        }
        Refusal::Usage(problem) => {
            let place = problem
                .split_whitespace()
                .find(|word| word.starts_with("--"));
            let place = place.map_or("arguments".into(), |word| {
                word.trim_matches('\'').to_owned()
            });
            let remedy = "see the documentation of the function";
            raised(py, &Error::new(keywords(&place), problem, remedy))
        }
    }
}
