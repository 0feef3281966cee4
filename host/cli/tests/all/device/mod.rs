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

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use crate::command::Ran;

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

fn command(place: &Place, arguments: &[&str]) -> Command {
    crate::command::command(place.0.path(), arguments)
}

fn mimu(place: &Place, arguments: &[&str]) -> Ran {
    crate::command::run(place.0.path(), arguments)
}

fn start(place: &Place, arguments: &[&str]) -> Child {
    let mut command = command(place, arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}
