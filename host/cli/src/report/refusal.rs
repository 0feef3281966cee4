//! Faults of recordings that a command refuses.

use std::io::Write as _;

use anstream::AutoStream;
use mimu::recording_problem::OfRecording;
use mimu_recording::error::Error;
use serde::Serialize;

use super::text;
use crate::arguments::JsonArgs;
use crate::output::{coloured, show};

/// JSON on standard output of a command that refused its recordings.
#[derive(Serialize)]
struct Refusal<'a> {
    format: &'static str,
    error: Refused<'a>,
    recording_problems: &'a [OfRecording],
}

/// The parts of the error line.
#[derive(Serialize)]
struct Refused<'a> {
    place: &'a str,
    problem: &'a str,
    remedy: &'a str,
}

/// Lists the faults of the refused recordings: on standard error before the error line, and as JSON if JSON goes to standard output. A JSON file is
/// not written, because there is no result.
pub(crate) fn refused(
    error: &Error,
    problems: &[OfRecording],
    several: bool,
    json: Option<&JsonArgs>,
) {
    let mut out = String::new();
    text::problems(&mut out, problems, several, true);
    let mut to = AutoStream::auto(std::io::stderr().lock());
    // If standard error cannot be written, the error line cannot be shown either.
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
