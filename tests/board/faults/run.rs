//! The command `mimu wizard`, started once or several times, and its results.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use mimu_tests::stored_calibration::{Truth, errors};

/// Longest time of a session by the wall clock.
const LONGEST: Duration = Duration::from_secs(900);

/// The command, which may be started more than once.
pub struct Run {
    pub folder: PathBuf,
    /// Argument of `--port`.
    pub port: String,
    /// Argument of `--gravity`.
    pub gravity: String,
    /// Whether `--yes` answers all questions; otherwise typed lines do.
    pub yes: bool,
    pub arguments: Vec<String>,
    truth: Truth,
    child: Option<Child>,
    began: Instant,
}

/// Result of a session.
pub struct Ended {
    pub seconds: f64,
    /// By the unit's clock, s, if anything was recorded.
    pub recorded_s: Option<f64>,
    pub dwells: u64,
    pub discarded: u64,
    pub interrupted: usize,
    pub verdict: String,
    /// Largest errors of the device's present calibration, gyro (deg/s at 60 deg/s) and accelerometer (mg at 1 g), if there is one.
    pub stored: Option<[f64; 2]>,
    /// Why it stopped.
    pub stopped: Option<String>,
    pub notes: Vec<String>,
}

impl Run {
    pub fn new(folder: &Path, port: &str, truth: Truth, more: &[&str]) -> Self {
        Self {
            folder: folder.to_owned(),
            port: port.into(),
            gravity: "9.793".into(),
            yes: true,
            arguments: more.iter().map(|a| a.to_string()).collect(),
            truth,
            child: None,
            began: Instant::now(),
        }
    }

    /// Starts the command, for the first time or again.
    pub fn run(&mut self) -> Result<(), String> {
        let here = std::env::current_exe().map_err(|e| e.to_string())?;
        let log = std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(self.folder.join("log.txt"))
            .map_err(|e| e.to_string())?;
        let errors = std::fs::File::create(self.folder.join("error.txt"));
        let child = Command::new(here.with_file_name("mimu"))
            .current_dir(&self.folder)
            .args(["wizard", "-o", "session", "--port", &self.port])
            .args(["--gravity", &self.gravity, "--warm-up", "0"])
            .args(["--events", "events.jsonl", "--json", "outcome.json"])
            .args(self.yes.then_some("--yes"))
            .args(&self.arguments)
            .stdin(if self.yes {
                Stdio::null()
            } else {
                Stdio::piped()
            })
            .stdout(log)
            .stderr(errors.map_err(|e| e.to_string())?)
            .spawn()
            .map_err(|e| format!("mimu: {e}; build it beside this program"))?;
        self.child = Some(child);
        Ok(())
    }

    /// Types a line.
    pub fn type_line(&mut self, line: &str) -> Result<(), String> {
        let input = self.child.as_mut().and_then(|c| c.stdin.as_mut());
        let written = input
            .ok_or("nobody reads what is typed")?
            .write_all(format!("{line}\n").as_bytes());
        written.map_err(|e| e.to_string())
    }

    /// Ends the command by a signal like Ctrl-C; returns how long it took, s.
    pub fn interrupt(&mut self) -> Result<f64, String> {
        let child = self.child.as_mut().ok_or("no command runs")?;
        let signal = Command::new("kill")
            .args(["-TERM", &child.id().to_string()])
            .status();
        signal.map_err(|e| e.to_string())?;
        let since = Instant::now();
        child.wait().map_err(|e| e.to_string())?;
        Ok(since.elapsed().as_secs_f64())
    }

    /// The truth for comparison.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// The errors of the present stored calibration, in words.
    pub fn first_stored(&self) -> Result<String, String> {
        let [gyro, accel] = errors(&self.folder.join("session/calibration.toml"), &self.truth)?;
        let s = self.began.elapsed().as_secs_f64();
        Ok(format!(
            "errs by {gyro:.4} deg/s and {accel:.3} mg, after {} dwells and {s:.0} s",
            self.told("dwell")
        ))
    }

    /// Reason of its last wait.
    pub fn last_waiting(&self) -> String {
        let text = std::fs::read_to_string(self.folder.join("events.jsonl")).unwrap_or_default();
        let last = text
            .lines()
            .rfind(|l| l.starts_with("{\"event\":\"waiting\""))
            .unwrap_or_default();
        let event: Value = serde_json::from_str(last).unwrap_or_default();
        event["why"].as_str().unwrap_or_default().to_owned()
    }

    /// Text of the last event of a kind.
    pub fn last_words(&self, event: &str) -> String {
        let text = std::fs::read_to_string(self.folder.join("events.jsonl")).unwrap_or_default();
        let wanted = format!("{{\"event\":\"{event}\"");
        let last = text
            .lines()
            .rfind(|l| l.starts_with(&wanted))
            .unwrap_or_default();
        let event: Value = serde_json::from_str(last).unwrap_or_default();
        event["words"].as_str().unwrap_or_default().to_owned()
    }

    /// Number of events of a kind from the running command.
    pub fn told(&self, event: &str) -> usize {
        let text = std::fs::read_to_string(self.folder.join("events.jsonl")).unwrap_or_default();
        let wanted = format!("{{\"event\":\"{event}\"");
        text.lines().filter(|l| l.starts_with(&wanted)).count()
    }

    /// The presently requested pose, as a command for the bench.
    pub fn asked_pose(&self) -> Result<String, String> {
        let text = std::fs::read_to_string(self.folder.join("events.jsonl")).unwrap_or_default();
        let last = text.lines().rfind(|l| l.starts_with("{\"event\":\"step\""));
        let event: Value = serde_json::from_str(last.unwrap_or_default()).unwrap_or_default();
        let up = event["step"]["up"]
            .as_array()
            .ok_or("no pose was asked for")?;
        let up: Vec<String> = up.iter().map(Value::to_string).collect();
        Ok(format!("MOVE {}", up.join(" ")))
    }

    /// Waits until `ready`; returns `false` if the command has ended before.
    pub fn wait_for(&mut self, ready: impl Fn(&Self) -> bool) -> Result<bool, String> {
        loop {
            if ready(self) {
                return Ok(true);
            }
            let child = self.child.as_mut().ok_or("no command runs")?;
            if child.try_wait().map_err(|e| e.to_string())?.is_some() {
                return Ok(false);
            }
            if self.began.elapsed() > LONGEST {
                let _ = child.kill();
                return Err("the session does not end".into());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Kills the command; returns `false` if it had ended before.
    pub fn kill(&mut self) -> Result<bool, String> {
        let mut child = self.child.take().ok_or("no command runs")?;
        let ended = child.try_wait().map_err(|e| e.to_string())?.is_some();
        if ended {
            self.child = Some(child);
            return Ok(false);
        }
        child
            .kill()
            .and_then(|()| child.wait())
            .map_err(|e| e.to_string())?;
        Ok(true)
    }

    /// Waits for the end.
    pub fn end(mut self) -> Result<Ended, String> {
        self.wait_for(|_| false)?;
        let mut child = self.child.take().ok_or("no command runs")?;
        let status = child.wait().map_err(|e| e.to_string())?;
        let read = |name: &str| std::fs::read_to_string(self.folder.join(name)).unwrap_or_default();
        let outcome: Value = serde_json::from_str(&read("outcome.json")).unwrap_or_default();
        let found = &outcome["units"][0];
        let stored = match found["stored"].as_str() {
            Some(file) => Some(errors(&self.folder.join(file), &self.truth)?),
            None => None,
        };
        let text = |v: &Value| v.as_str().unwrap_or_default().to_owned();
        let notes = found["notes"].as_array().into_iter().flatten().map(text);
        Ok(Ended {
            seconds: self.began.elapsed().as_secs_f64(),
            recorded_s: found["recorded_s"].as_f64(),
            dwells: found["dwells"].as_u64().unwrap_or(0),
            discarded: found["discarded"].as_u64().unwrap_or(0),
            interrupted: self.told("interrupted"),
            verdict: text(&found["verdict"]),
            stored,
            stopped: (!status.success()).then(|| read("error.txt").trim().to_owned()),
            notes: notes.collect(),
        })
    }
}
