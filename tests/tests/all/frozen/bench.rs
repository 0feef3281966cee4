//! A folder with recordings, in which the command runs.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use mimu_rig::rig_file::RigFile;
use mimu_tests::bench::written_in;
use serde_json::{Map, Value, json};

use super::snapshot;

/// Environment variable with the arguments of a command, a line each.
pub const ARGUMENTS: &str = "MIMU_FROZEN_COMMAND";

/// A folder with recordings, and the results of the commands that ran in it.
pub struct Bench {
    folder: tempfile::TempDir,
    results: RefCell<Map<String, Value>>,
}

impl Bench {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a folder"),
            results: RefCell::default(),
        }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn file(&self, name: &str, text: impl AsRef<[u8]>) -> &Self {
        std::fs::write(self.path(name), text).expect("writable");
        self
    }

    /// The recording `name` of a plan.
    pub fn recorded(&self, name: &str, plan: &str, file: &RigFile, seed: u64) -> &Self {
        written_in(&self.path(name), plan, file, seed);
        self
    }

    /// The means of the dwells of a recording whose samples are CSV, as a table with its inputs.
    pub fn means(&self, name: &str, recording: &str) -> &Self {
        let text = std::fs::read_to_string(self.path(recording).join("samples.csv")).expect("CSV");
        let mut lines = text.lines();
        let head: Vec<&str> = lines.next().expect("a head").split(',').collect();
        let of_kind = |name: &str| {
            ["gyro_", "accel_", "ref_"]
                .iter()
                .any(|k| name.starts_with(k))
        };
        let columns: Vec<usize> = (0..head.len()).filter(|k| of_kind(head[*k])).collect();
        let step = head
            .iter()
            .position(|name| *name == "step")
            .expect("dwells");
        let mut sums: BTreeMap<u32, (u32, Vec<f64>)> = BTreeMap::new();
        for cells in lines.map(|line| line.split(',').collect::<Vec<_>>()) {
            let Ok(step) = cells[step].parse() else {
                continue;
            };
            let (count, sum) = sums.entry(step).or_insert((0, vec![0.0; columns.len()]));
            *count += 1;
            for (sum, k) in sum.iter_mut().zip(&columns) {
                *sum += cells[*k].parse().unwrap_or(f64::NAN);
            }
        }
        let mut out = String::from("step,averaged");
        columns
            .iter()
            .for_each(|k| out += &format!(",{}", head[*k]));
        for (step, (count, sum)) in sums {
            out += &format!("\n{step},{count}");
            sum.iter()
                .for_each(|sum| out += &format!(",{}", sum / f64::from(count)));
        }
        self.file(name, out)
    }

    /// Moves a recording that was made in another folder here.
    pub fn take(&self, name: &str, folder: &Path) -> &Self {
        std::fs::rename(folder, self.path(name)).expect("on the same disk");
        self
    }

    /// Changes the text of a manifest.
    pub fn manifest(&self, recording: &str, change: impl Fn(String) -> String) -> &Self {
        let path = self.path(recording).join("recording.toml");
        let text = std::fs::read_to_string(&path).expect("written");
        std::fs::write(path, change(text)).expect("writable");
        self
    }

    /// Exit status.
    fn start(&self, arguments: &str) -> Option<i32> {
        let arguments: Vec<&str> = std::iter::once("mimu")
            .chain(arguments.split_whitespace())
            .collect();
        let ended = Command::new(std::env::current_exe().expect("this program"))
            .args(["frozen::command", "--exact", "--nocapture"])
            .env(ARGUMENTS, arguments.join("\n"))
            .current_dir(self.folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        ended.expect("it starts").code()
    }

    fn freeze(&self, arguments: &str, result: Value) {
        let mut results = self.results.borrow_mut();
        let before = results.insert(arguments.to_owned(), result);
        assert!(before.is_none(), "twice: mimu {arguments}");
    }

    /// Runs a command whose result is not frozen, such as an import, unless it fails.
    pub fn make(&self, arguments: &str) -> &Self {
        match self.start(arguments) {
            Some(0) => {}
            code => self.freeze(arguments, json!({ "exit": code })),
        }
        self
    }

    /// Runs `mimu` with the arguments, separated by white space, and freezes its exit status and its JSON. Paths are relative to the folder. A refusal is
    /// its exit status alone.
    pub fn mimu(&self, arguments: &str) -> &Self {
        let json = self.path("result.json");
        let code = self.start(&format!("{arguments} --json result.json"));
        let mut result = json!({ "exit": code });
        if let Ok(text) = std::fs::read_to_string(&json) {
            let found = serde_json::from_str(&text).expect("JSON");
            result["result"] = snapshot::of(&found);
            std::fs::remove_file(json).expect("removable");
        }
        self.freeze(arguments, result);
        self
    }

    pub fn results(self) -> Value {
        Value::Object(self.results.into_inner())
    }
}
