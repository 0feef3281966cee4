//! The firmware's release image on the emulated board, on a turntable or in hands under command, and the command beside it.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use mimu_board::commanded::{Commanded, Kind};
use mimu_board::image::{Image, digital_release_image, release_image};
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::table::TableTruth;
use serde_json::Value;

use crate::command::command;

/// A running board, in a folder that is removed with it.
pub struct Bench {
    pub truth: RigTruth,
    board: Commanded,
    _folder: tempfile::TempDir,
}

pub fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

pub fn image() -> Image {
    read(release_image())
}

/// That of the Matek H743.
pub fn digital_image() -> Image {
    read(digital_release_image())
}

fn read(path: PathBuf) -> Image {
    let path = match path.is_absolute() {
        true => path,
        false => in_repository(&path.display().to_string()),
    };
    Image::read(&path).unwrap_or_else(|problem| panic!("{problem}"))
}

/// fang's unit, long warmed up, on a table without flaws on an Earth that does not turn: the only remaining errors are noise.
pub fn unit(seed: u64) -> RigTruth {
    let mut file = RigFile::read(&in_repository("rig/rigs/fang.toml")).unwrap();
    file.earth_rate = Some(false);
    file.table = TableTruth::ideal();
    file.unit.supply_error_ppm = Some(0.0);
    file.converter.reference_error_ppm = Some(0.0);
    file.thermal.on_before_s = Some(f64::INFINITY);
    file.effect.clear();
    RigTruth::resolve(&file, seed).unwrap()
}

impl Bench {
    /// On a `table` or in `hands`.
    pub fn new(fixture: &str, truth: RigTruth, seed: u64) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut unit_id = [0; 12];
        unit_id[11] = seed as u8;
        let board = Commanded::start(
            Kind::Nucleo,
            &image(),
            fixture,
            &truth,
            seed,
            unit_id,
            folder.path(),
        )
        .unwrap();
        let driver =
            std::fs::read_to_string(in_repository("tests/board/demo/turntable.toml")).unwrap();
        let driver = driver.replace("HOST:PORT", &board.address().to_string());
        std::fs::write(folder.path().join("driver.toml"), driver).unwrap();
        Self {
            truth,
            board,
            _folder: folder,
        }
    }

    /// Sends the bench a command, which it must accept.
    pub fn tell(&mut self, line: &str) {
        self.board.tell(line).unwrap();
    }

    /// Sends the bench a query.
    pub fn ask(&mut self, line: &str) -> String {
        self.board.ask(line).unwrap()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.board.path(name)
    }

    /// The command, in the folder of the bench.
    pub fn mimu(&self, arguments: &str) -> Command {
        let mut command = command(&self.path(""), arguments.split(' '));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// The command with the arguments that all sessions share.
    pub fn wizard(&self, arguments: &[&str]) -> Command {
        let shared = "wizard -o session --port port --driver driver.toml --gravity 9.793 --warm-up 0 --yes --events events.jsonl --json outcome.json";
        let mut command = self.mimu(shared);
        command.args(arguments);
        command
    }

    /// Waits until the running command has reported so many events of this kind; returns `false` if it has ended before.
    pub fn heard(&self, child: &mut Child, event: &str, count: usize) -> bool {
        let wanted = format!("{{\"event\":\"{event}\"");
        let since = Instant::now();
        loop {
            let text = std::fs::read_to_string(self.path("events.jsonl")).unwrap_or_default();
            if text.lines().filter(|l| l.starts_with(&wanted)).count() >= count {
                return true;
            }
            if child.try_wait().unwrap().is_some() {
                return false;
            }
            // Only a session that hangs waits so long: without an end the tests would never tell.
            assert!(
                since.elapsed() < Duration::from_secs(1800),
                "no {event}:\n{text}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    pub fn outcome(&self) -> Value {
        let text = std::fs::read_to_string(self.path("outcome.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    }
}
