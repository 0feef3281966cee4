//! The firmware's release image on the emulated board, on a turntable or in hands that take commands, and the command beside it.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mimu_board::front::Front;
use mimu_board::image::{Image, release_image};
use mimu_board::running::Board;
use mimu_board::serve::{Pace, Served};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::table::TableTruth;
use serde_json::Value;

/// A board that runs.
pub struct Bench {
    pub folder: tempfile::TempDir,
    pub truth: RigTruth,
    control: BufReader<TcpStream>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

pub fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

fn image() -> Image {
    let path = release_image();
    let path = match path.is_absolute() {
        true => path,
        false => in_repository(&path.display().to_string()),
    };
    Image::read(&path).unwrap_or_else(|problem| panic!("{problem}"))
}

/// fang's unit, warmed up long ago, on a table without flaws on an Earth that does not turn: what is left is noise.
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
    pub fn new(carrier: &str, truth: RigTruth, seed: u64) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let place = format!(
            "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"{carrier}\"\nlatitude_deg = 30.5\ngravity_mps2 = 9.793\n\
             lead_in_s = 1.0\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 1.0\n"
        );
        let plan = Plan::parse(Source::new("place", &place)).unwrap();
        let front = Front::commanded(&plan, &truth, seed).unwrap();
        let board = Board::new(&image(), front).unwrap();
        let mut served =
            Served::new(board, Pace::Fast, Some(&folder.path().join("flash"))).unwrap();
        let address = served.listen("127.0.0.1:0", seed).unwrap();
        served.link(&folder.path().join("port")).unwrap();
        served.start().unwrap();
        let driver =
            std::fs::read_to_string(in_repository("tests/board/demo/turntable.toml")).unwrap();
        let driver = driver.replace("HOST:PORT", &address.to_string());
        std::fs::write(folder.path().join("driver.toml"), driver).unwrap();
        let end = Arc::new(AtomicBool::new(false));
        let ended = end.clone();
        let thread = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                served.step().unwrap();
            }
        });
        let stream = TcpStream::connect(address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        Self {
            folder,
            truth,
            control: BufReader::new(stream),
            end,
            thread: Some(thread),
        }
    }

    /// Tells the bench something; it has to agree.
    pub fn tell(&mut self, line: &str) {
        assert_eq!(self.ask(line), "OK", "{line}");
    }

    /// Tells or asks the bench something; what it answers.
    pub fn ask(&mut self, line: &str) -> String {
        self.control
            .get_mut()
            .write_all(format!("{line}\n").as_bytes())
            .unwrap();
        let mut answer = String::new();
        self.control.read_line(&mut answer).unwrap();
        answer.trim().to_owned()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The command, with what every session here has in common.
    pub fn wizard(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mimu"));
        command
            .current_dir(self.folder.path())
            .args([
                "wizard",
                "-o",
                "session",
                "--port",
                "port",
                "--driver",
                "driver.toml",
            ])
            .args(["--gravity", "9.793", "--warm-up", "0", "--yes"])
            .args(["--events", "events.jsonl", "--json", "outcome.json"])
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Waits until the running command has told of so many events of this kind; `false` if it has ended before.
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
            assert!(
                since.elapsed() < Duration::from_secs(300),
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

impl Drop for Bench {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
