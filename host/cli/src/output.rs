//! Output of the subcommands: text or JSON, files that are written complete or not at all, and progress.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anstream::AutoStream;
use anstyle::AnsiColor;
use indicatif::{ProgressBar, ProgressStyle};
use mimu_recording::error::{Error, Result};
use mimu_recording::result_file::{Staged, stage};
pub use mimu_wizard::session::now;
use serde::Serialize;

use crate::arguments::JsonArgs;

/// Whether a result was printed as JSON, so that no refusal follows it.
static JSON_PRINTED: AtomicBool = AtomicBool::new(false);

/// Whether this command has printed a result as JSON.
pub(crate) fn json_printed() -> bool {
    JSON_PRINTED.load(Ordering::Relaxed)
}

/// Before the work, refuses outputs that cannot be written, and those that would overwrite an input or each other.
pub(crate) fn check_outputs(
    outputs: &[Option<&Path>],
    inputs: impl IntoIterator<Item: AsRef<Path>>,
) -> Result<()> {
    let inputs = inputs.into_iter();
    let mut taken: Vec<_> = inputs.flat_map(|p| p.as_ref().canonicalize()).collect();
    for path in outputs.iter().flatten() {
        // Dropped at once: only tests that the folder is writable.
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

/// An argument as a shell takes it.
pub(crate) fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=+./,:@%".contains(c);
    match !argument.is_empty() && argument.chars().all(plain) {
        true => argument.to_owned(),
        false => format!("'{}'", argument.replace('\'', r"'\''")),
    }
}

/// Progress of work that takes long: a bar on a terminal, nothing in a pipe. In the browser it is a line `progress: WHAT THOUSANDTHS` on the standard
/// error for the page, which has no terminal.
pub(crate) struct Progress {
    bar: ProgressBar,
    what: &'static str,
}

/// Begins to show the progress of `what`.
pub(crate) fn progress(what: &'static str) -> Progress {
    let bar = ProgressBar::new(1000).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {percent:>3} % {eta}") {
        bar.set_style(style);
    }
    Progress { bar, what }
}

impl Progress {
    /// This share is done.
    pub fn reach(&self, share: f64) {
        let thousandths = (share * 1000.0) as u64;
        let more = thousandths > self.bar.position();
        self.bar.set_position(thousandths);
        if cfg!(target_os = "wasi") && more {
            eprintln!("progress: {} {thousandths}", self.what);
        }
    }

    /// All is done: the bar disappears.
    pub fn finish(&self) {
        self.bar.finish();
    }
}

/// Files of results, and the text that names them. They are published only after all of them were written.
pub(crate) struct Results {
    text: String,
    files: Vec<Staged>,
}

impl Results {
    /// Results with this text so far.
    pub(crate) fn new(text: String) -> Self {
        let files = Vec::new();
        Self { text, files }
    }

    /// Appends to the text.
    pub(crate) fn say(&mut self, text: &str) {
        self.text += text;
    }

    /// Writes what `make` gives to the file at `path`, if one is asked for, and names it as `what`.
    pub(crate) fn file<C: Into<Vec<u8>>>(
        &mut self,
        what: &str,
        path: Option<&PathBuf>,
        make: impl FnOnce() -> Result<C>,
    ) -> Result<()> {
        if let Some(path) = path {
            self.files.push(stage(path, make()?)?);
            self.text += &format!("\n{what}: {}\n", path.display());
        }
        Ok(())
    }

    /// Prints the text as [`print`] does, and publishes the files.
    pub(crate) fn print(self, json: &JsonArgs, result: &impl Serialize) -> Result<()> {
        print(json, &self.text, result, self.files)
    }
}

/// Prints the text, or writes the JSON and prints the text unless both would go to standard output. The files are published only after all of them
/// were written.
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
    let shown = match json.is_standard_output() {
        true => &pretty,
        false => text,
    };
    JSON_PRINTED.store(json.is_standard_output(), Ordering::Relaxed);
    show(shown)
}

/// Beginnings of lines that are coloured on a terminal.
const HEADS: [(&str, AnsiColor); 6] = [
    ("problems of this recording:", AnsiColor::Red),
    ("problems of these recordings:", AnsiColor::Red),
    ("warning:", AnsiColor::Yellow),
    ("verdict:", AnsiColor::Green),
    ("judgement:", AnsiColor::Green),
    ("next:", AnsiColor::Cyan),
];

/// `text` with its heads in colour.
pub(crate) fn coloured(text: &str) -> String {
    let line = |line: &str| match HEADS.iter().find(|(head, _)| line.starts_with(head)) {
        Some((head, colour)) => {
            let style = colour.on_default().bold();
            format!("{style}{head}{style:#}{}", &line[head.len()..])
        }
        None => line.to_owned(),
    };
    text.split_inclusive('\n').map(line).collect()
}

/// Prints text to standard output: in colour on a terminal that supports it, unless NO_COLOR is set.
pub(crate) fn show(text: &str) -> Result<()> {
    let mut out = AutoStream::auto(std::io::stdout().lock());
    let text = coloured(text);
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        // `mimu fit ... | head` is not an error.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Error::io(Path::new("standard output"), &e)),
    }
}
