//! What a subcommand leaves: text or JSON, files that appear whole or not at all, and progress while it works.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anstream::AutoStream;
use anstyle::AnsiColor;
use indicatif::{ProgressBar, ProgressStyle};
use mimu::recording_problem::OfRecording;
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::{Staged, stage};
use serde::Serialize;

use crate::arguments::JsonArgs;
use crate::report::text;

/// Refuses outputs that cannot be written, before the work, and those that would overwrite an input or each other.
pub(crate) fn check_outputs(outputs: &[Option<&Path>], inputs: &[&Path]) -> Result<()> {
    let mut taken: Vec<PathBuf> = inputs
        .iter()
        .filter_map(|p| p.canonicalize().ok())
        .collect();
    for path in outputs.iter().flatten() {
        // Only a try: dropped, it leaves nothing.
        let folder = stage(path, String::new())?.folder();
        let name = path.file_name().unwrap_or_default();
        let full = path.canonicalize().unwrap_or_else(|_| folder.join(name));
        if !full.exists() || full.is_file() {
            if taken.contains(&full) {
                let problem = "an input or another result has this name";
                return Err(Error::new(path.display(), problem, "choose another name"));
            }
            taken.push(full);
        }
    }
    Ok(())
}

/// The time, RFC 3339, in whole seconds.
pub fn now() -> String {
    let now = jiff::Timestamp::now().round(jiff::Unit::Second);
    now.unwrap_or_default().to_string()
}

/// Progress in thousandths, on a terminal only.
pub(crate) fn progress(what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(1000).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {percent:>3} % {eta}") {
        bar.set_style(style);
    }
    bar
}

/// Prints the text, or writes the JSON and prints the text unless both would go to standard output. All files appear
/// when all of them are written.
pub(crate) fn print(
    json: &JsonArgs,
    text: &str,
    result: &impl Serialize,
    files: impl IntoIterator<Item = Staged>,
) -> Result<()> {
    let mut pretty = serde_json::to_string_pretty(result).map_err(|e| {
        Error::new(
            "--json",
            e,
            "report this error: the result cannot be written",
        )
    })?;
    pretty.push('\n');
    let file = json.file().map(|path| stage(path, pretty.clone()));
    for staged in files.into_iter().chain(file.transpose()?) {
        staged.publish()?;
    }
    let shown = match (&json.path, json.file()) {
        (Some(_), None) => &pretty,
        _ => text,
    };
    show(shown)
}

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

/// Beginnings of lines that stand out on a terminal.
const HEADS: [(&str, AnsiColor); 5] = [
    ("problems of this recording:", AnsiColor::Red),
    ("problems of these recordings:", AnsiColor::Red),
    ("warning:", AnsiColor::Yellow),
    ("verdict:", AnsiColor::Green),
    ("next:", AnsiColor::Cyan),
];

/// `text` with the heads of its lines in colour.
fn coloured(text: &str) -> String {
    let line = |line: &str| match HEADS.iter().find(|(head, _)| line.starts_with(head)) {
        Some((head, colour)) => {
            let style = colour.on_default().bold();
            format!("{style}{head}{style:#}{}", &line[head.len()..])
        }
        None => line.to_owned(),
    };
    text.split_inclusive('\n').map(line).collect()
}

/// Prints text to standard output: in colour on a terminal, unless NO_COLOR is set or the terminal knows none.
pub(crate) fn show(text: &str) -> Result<()> {
    let mut out = AutoStream::auto(std::io::stdout().lock());
    let text = coloured(text);
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        // `mimu fit ... | head` is no error.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Error::io(Path::new("standard output"), &e)),
    }
}
