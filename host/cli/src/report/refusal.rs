//! Refusals: faults of recordings, and `mimu-refusal/1` in place of a result.

use std::io::Write as _;
use std::sync::{Mutex, PoisonError};

use anstream::AutoStream;
use mimu::{Judgement, JudgementKind, OfRecording};
use mimu_recording::error::{Error, Refused};
use serde::Serialize;

use super::page::problems_text;
use crate::output::{coloured, show};

/// JSON on standard output of a command that refused.
#[derive(Serialize)]
struct Refusal<'a> {
    format: &'static str,
    /// Null if it is not about data: a file that is not there, an option.
    judgement: Option<Judgement>,
    error: &'a Refused,
    recording_problems: &'a [OfRecording],
}

/// Faults of the recordings that the command has refused.
static PROBLEMS: Mutex<Vec<OfRecording>> = Mutex::new(Vec::new());

/// Lists the faults of refused recordings on standard error, before the error line, and keeps them for [`print_refusal`].
pub(crate) fn refused(problems: &[OfRecording], several: bool) {
    let out = problems_text(problems, several, true);
    let mut to = AutoStream::auto(std::io::stderr().lock());
    // If standard error cannot be written, the error line cannot be shown either.
    let _ = to.write_all(coloured(&out).as_bytes());
    *PROBLEMS.lock().unwrap_or_else(PoisonError::into_inner) = problems.to_vec();
}

/// Prints the refusal as JSON. A JSON file is not written, because there is no result.
pub(crate) fn print_refusal(error: &Error) {
    let problems = PROBLEMS.lock().unwrap_or_else(PoisonError::into_inner);
    let told = error.refused();
    let judged = |kind, reason: String| Some(Judgement { kind, reason });
    let judgement = match (problems.first(), error) {
        (Some(problem), _) => judged(JudgementKind::Suspect, problem.problem.to_string()),
        (None, Error::Undetermined(_)) => judged(JudgementKind::Untested, told.problem.clone()),
        _ => None,
    };
    let refusal = Refusal {
        format: "mimu-refusal/1",
        judgement,
        error: told,
        recording_problems: &problems,
    };
    if let Ok(pretty) = serde_json::to_string_pretty(&refusal) {
        // As above.
        let _ = show(&(pretty + "\n"));
    }
}
