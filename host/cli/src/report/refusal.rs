//! What is wrong with recordings that a command refuses.

use std::io::Write as _;

use anstream::AutoStream;
use mimu::recording_problem::OfRecording;
use mimu_recording::error::Error;
use serde::Serialize;

use super::text;
use crate::arguments::JsonArgs;
use crate::output::{coloured, show};

/// What a command that refused its recordings writes to standard output, if its JSON goes there.
#[derive(Serialize)]
struct Refusal<'a> {
    format: &'static str,
    error: Refused<'a>,
    recording_problems: &'a [OfRecording],
}

/// The error line in its parts.
#[derive(Serialize)]
struct Refused<'a> {
    place: &'a str,
    problem: &'a str,
    remedy: &'a str,
}

/// Lists what is wrong with the recordings that a command refused: to standard error, above the line with the error, and in JSON if that
/// goes to standard output. A file of JSON is a result, and there is none.
pub(crate) fn refused(
    error: &Error,
    problems: &[OfRecording],
    several: bool,
    json: Option<&JsonArgs>,
) {
    let mut out = String::new();
    text::problems(&mut out, problems, several, true);
    let mut to = AutoStream::auto(std::io::stderr().lock());
    // Standard error that cannot be written shows no error line either.
    let _ = to.write_all(coloured(&out).as_bytes());
    if json.is_some_and(|json| json.path.is_some() && json.file().is_none()) {
        let told = error.refused();
        let refusal = Refusal {
            format: "mimu-refusal/1",
            error: Refused {
                place: &told.place,
                problem: &told.problem,
                remedy: &told.remedy,
            },
            recording_problems: problems,
        };
        if let Ok(pretty) = serde_json::to_string_pretty(&refusal) {
            let _ = show(&(pretty + "\n"));
        }
    }
}
