//! `mimu device` and `mimu record`, from their arguments to their exit status: with the firmware's release image on the emulated board ([`board`]),
//! and with a scripted device, which can be told to misbehave. Both are behind pseudo-terminals.
#![cfg(unix)]

mod board;
pub(crate) mod calibration;
mod conversation;
mod fuzz;
mod kept;
mod matek;
mod peer;
mod ports;
mod recording;
mod temperature;
pub(crate) mod terminal;
mod thermal_record;

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use serde_json::Value;

/// A folder for the files of a test.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a calibration file.
    fn calibration(&self, raw_unit: &str, effects: &str) -> String {
        let path = self.path("cal.toml");
        std::fs::write(&path, calibration::text(raw_unit, effects)).unwrap();
        path.display().to_string()
    }
}

/// Result of the command.
struct Ran {
    status: Option<i32>,
    stdout: String,
    stderr: String,
}

fn command(place: &Place, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mimu"));
    command.current_dir(place.0.path()).args(arguments);
    command.stdin(Stdio::null());
    command
}

fn mimu(place: &Place, arguments: &[&str]) -> Ran {
    let out = command(place, arguments).output().unwrap();
    Ran {
        status: out.status.code(),
        stdout: String::from_utf8(out.stdout).unwrap(),
        stderr: String::from_utf8(out.stderr).unwrap(),
    }
}

fn start(place: &Place, arguments: &[&str]) -> Child {
    let mut command = command(place, arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

impl Ran {
    fn json(&self) -> Value {
        assert_eq!(self.status, Some(0), "{}", self.stderr);
        serde_json::from_str(&self.stdout).unwrap()
    }

    /// The line of a refusal, which must contain these words.
    fn refused(&self, words: &[&str]) -> &str {
        let line = self.stderr.lines().last().unwrap_or_default();
        println!("    {line}");
        assert_eq!(self.status, Some(1), "{}{}", self.stdout, self.stderr);
        let told = line.strip_prefix("mimu: ").expect(line);
        let (place, rest) = told.split_once(": ").expect(line);
        let (problem, remedy) = rest.split_once("; ").expect(line);
        assert!(
            [place, problem, remedy]
                .iter()
                .all(|p| !p.trim().is_empty()),
            "{line}"
        );
        for word in words {
            assert!(line.contains(word), "{word:?} is not in: {line}");
        }
        line
    }
}
