//! The command in a folder, and its answer.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

/// What a command answers.
#[derive(Debug)]
pub struct Ran {
    pub status: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

/// The command with these arguments, without an input.
pub fn command<S: AsRef<OsStr>>(folder: &Path, arguments: impl IntoIterator<Item = S>) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mimu"));
    command.current_dir(folder).args(arguments);
    // A busy machine makes no test fail.
    command.env("MIMU_PATIENCE", "50");
    command.stdin(Stdio::null());
    command
}

pub fn run<S: AsRef<OsStr>>(folder: &Path, arguments: impl IntoIterator<Item = S>) -> Ran {
    ran(&mut command(folder, arguments))
}

/// What a command answers.
pub fn ran(command: &mut Command) -> Ran {
    let out = command.output().unwrap();
    Ran {
        status: out.status.code(),
        stdout: String::from_utf8(out.stdout).expect("output is UTF-8"),
        stderr: String::from_utf8(out.stderr).expect("output is UTF-8"),
    }
}

/// The command, its arguments separated by spaces.
pub fn mimu(folder: &Path, arguments: &str) -> Ran {
    run(folder, arguments.split_whitespace())
}

impl Ran {
    pub fn json(&self) -> Value {
        assert_eq!(self.status, Some(0), "{}", self.stderr);
        serde_json::from_str(&self.stdout).unwrap()
    }

    /// The line of a refusal, the last on standard error, after checking that it has its three parts and contains these words.
    pub fn refused(&self, words: &[&str]) -> &str {
        let line = self.stderr.lines().last().unwrap_or_default();
        println!("    {line}");
        assert_eq!(self.status, Some(1), "{}{}", self.stdout, self.stderr);
        let told = line.strip_prefix("mimu: ").expect(line);
        let (place, rest) = told.split_once(": ").expect(line);
        let (problem, remedy) = rest.split_once("; ").expect(line);
        let mut parts = [place, problem, remedy].into_iter();
        assert!(parts.all(|p| !p.trim().is_empty()), "{line}");
        says(line, words);
        line
    }
}

/// Standard output of a command that succeeds.
pub fn done(folder: &Path, arguments: &str) -> String {
    let ran = mimu(folder, arguments);
    assert_eq!(ran.status, Some(0), "mimu {arguments}: {}", ran.stderr);
    ran.stdout
}

/// Its result as JSON.
pub fn json(folder: &Path, arguments: &str) -> Value {
    mimu(folder, &format!("{arguments} --json -")).json()
}

/// The line of a refusal, which is the last on standard error.
pub fn refused(folder: &Path, arguments: &str) -> String {
    let ran = mimu(folder, arguments);
    assert_eq!(ran.status, Some(1), "mimu {arguments}: {}", ran.stderr);
    let line = ran.stderr.lines().last().unwrap_or_default().to_owned();
    assert!(line.starts_with("mimu: "), "mimu {arguments}: {line}");
    line
}

/// Checks a table of refusals: arguments behind `command`, the exit status, and words of the message. Those with status 1 are one line; none prints a result.
pub fn all_refused(folder: &Path, command: &str, cases: &[(&str, i32, &str)]) {
    for (arguments, status, words) in cases {
        let ran = mimu(folder, &format!("{command} {arguments}"));
        assert_eq!(ran.status, Some(*status), "{arguments}: {}", ran.stderr);
        says(&ran.stderr, &[words]);
        let is_line = *status == 2 || ran.stderr.lines().count() == 1;
        assert!(is_line && ran.stdout.is_empty(), "{arguments}: {ran:?}");
    }
}

/// Checks that `text` contains all these words.
#[track_caller]
pub fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is not in: {text}");
    }
}

/// Imports the example, a recording by hand of a unit with readings in counts (tests/example), as `counts`, and fits it to `counts.toml`.
pub fn example(folder: &Path) {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/example");
    for name in ["accel.txt", "gyro.txt"] {
        std::fs::copy(example.join(name), folder.join(name)).unwrap();
    }
    done(
        folder,
        "import accel.txt gyro.txt --columns t_s,accel_x,accel_y,accel_z --columns t_s,gyro_x,gyro_y,gyro_z --raw-unit count \
         --gravity 9.80665 -o counts",
    );
    done(folder, "fit counts -o counts.toml");
}
