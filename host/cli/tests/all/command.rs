//! The command in a folder, its arguments separated by spaces.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

pub fn mimu(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mimu"));
    command.current_dir(folder);
    command.args(arguments.split_whitespace()).output().unwrap()
}

/// Standard output of a command that succeeds.
pub fn done(folder: &Path, arguments: &str) -> String {
    let out = mimu(folder, arguments);
    let error = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "mimu {arguments}: {error}");
    String::from_utf8(out.stdout).unwrap()
}

/// Its result as JSON.
pub fn json(folder: &Path, arguments: &str) -> Value {
    serde_json::from_str(&done(folder, &format!("{arguments} --json -"))).unwrap()
}

/// The line of a refusal, which is the last on standard error.
pub fn refused(folder: &Path, arguments: &str) -> String {
    let out = mimu(folder, arguments);
    let error = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "mimu {arguments}: {error}");
    let line = error.lines().last().unwrap_or_default().to_owned();
    assert!(line.starts_with("mimu: "), "mimu {arguments}: {error}");
    line
}

/// Checks that `text` contains all these words.
#[track_caller]
pub fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is not in: {text}");
    }
}
