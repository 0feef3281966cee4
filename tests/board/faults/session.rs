//! A session of `mimu wizard` beside a commanded board, and what has come of it.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use mimu_board::commanded::Commanded;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::table::TableTruth;
use serde_json::Value;

/// Longest a session may take by the wall's clock.
const LONGEST: Duration = Duration::from_secs(900);

/// fang's unit, warmed up long ago, on a table without flaws on an Earth that does not turn: what is left is noise.
pub fn unit(seed: u64, fixture: &str) -> Result<RigTruth, String> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../rig/rigs/fang.toml");
    let mut file = RigFile::read(Path::new(path))?;
    if fixture == "table" {
        file.earth_rate = Some(false);
        file.table = TableTruth::ideal();
    }
    file.unit.supply_error_ppm = Some(0.0);
    file.converter.reference_error_ppm = Some(0.0);
    file.thermal.on_before_s = Some(f64::INFINITY);
    file.effect.clear();
    RigTruth::resolve(&file, seed)
}

/// A session with everything that belongs to it.
pub struct Sitting {
    pub board: Commanded,
    pub truth: RigTruth,
    folder: PathBuf,
    arguments: Vec<String>,
    child: Option<Child>,
    began: Instant,
}

/// What has become of a session.
pub struct Ended {
    pub seconds: f64,
    /// By the unit's clock, s.
    pub recorded_s: f64,
    pub dwells: u64,
    pub thrown: u64,
    pub interrupted: usize,
    pub verdict: String,
    /// Largest errors of what the device holds now, gyro (deg/s at 60 deg/s) and accelerometer (mg at 1 g), if it holds anything.
    pub stored: Option<[f64; 2]>,
    /// Why it stopped.
    pub stopped: Option<String>,
    pub notes: Vec<String>,
}

impl Sitting {
    /// A board on a fixture, and no command yet.
    pub fn new(fixture: &str, seed: u64, folder: &Path, more: &[&str]) -> Result<Self, String> {
        let truth = unit(seed, fixture)?;
        let mut unit_id = [0; 12];
        unit_id[4..].copy_from_slice(&seed.to_be_bytes());
        let image = mimu_board_tests::image();
        let board = Commanded::start(&image, fixture, &truth, seed, unit_id, folder)?;
        let driver = include_str!("../demo/turntable.toml");
        let driver = driver.replace("HOST:PORT", &board.address().to_string());
        std::fs::write(folder.join("driver.toml"), driver).map_err(|e| e.to_string())?;
        let arguments = more.iter().map(|a| a.to_string()).collect();
        Ok(Self {
            board,
            truth,
            folder: folder.to_owned(),
            arguments,
            child: None,
            began: Instant::now(),
        })
    }

    /// Starts the command, or starts it again.
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
            .args(["wizard", "-o", "session", "--port", "port"])
            .args(["--gravity", "9.793", "--warm-up", "0", "--yes"])
            .args(["--events", "events.jsonl", "--json", "outcome.json"])
            .args(&self.arguments)
            .stdin(Stdio::null())
            .stdout(log)
            .stderr(errors.map_err(|e| e.to_string())?)
            .spawn()
            .map_err(|e| format!("mimu: {e}; build it beside this program"))?;
        self.child = Some(child);
        Ok(())
    }

    /// How many events of a kind the running command has told.
    pub fn told(&self, event: &str) -> usize {
        let text = std::fs::read_to_string(self.folder.join("events.jsonl")).unwrap_or_default();
        let wanted = format!("{{\"event\":\"{event}\"");
        text.lines().filter(|l| l.starts_with(&wanted)).count()
    }

    /// The pose that is asked for now, as the bench is told it.
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

    /// Waits until `ready`; `false` if the command has ended before.
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

    /// Kills the command; `false` if it had ended before.
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
            Some(file) => {
                let by_hand = self.arguments.iter().any(|a| a == "hands");
                Some(errors(&self.folder.join(file), &self.truth, by_hand)?)
            }
            None => None,
        };
        let text = |v: &Value| v.as_str().unwrap_or_default().to_owned();
        let notes = found["notes"].as_array().into_iter().flatten().map(text);
        Ok(Ended {
            seconds: self.began.elapsed().as_secs_f64(),
            recorded_s: found["recorded_s"].as_f64().unwrap_or(f64::NAN),
            dwells: found["dwells"].as_u64().unwrap_or(0),
            thrown: found["thrown"].as_u64().unwrap_or(0),
            interrupted: self.told("interrupted"),
            verdict: text(&found["verdict"]),
            stored,
            stopped: (!status.success()).then(|| read("error.txt").trim().to_owned()),
            notes: notes.collect(),
        })
    }
}

/// The axes that a calibration by hand is given in, by rows: x along the accelerometer's x, and the xy plane through its y.
fn own_axes(accel: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>();
    let unit = |a: [f64; 3]| a.map(|v| v / dot(a, a).sqrt());
    let x = unit(accel[0]);
    let along = dot(accel[1], x);
    let y = unit([0, 1, 2].map(|i| accel[1][i] - along * x[i]));
    let z = [0, 1, 2].map(|i| x[(i + 1) % 3] * y[(i + 2) % 3] - x[(i + 2) % 3] * y[(i + 1) % 3]);
    [x, y, z]
}

/// Largest errors of a calibration file over inputs of full size along each axis, and none: deg/s, mg.
fn errors(file: &Path, truth: &RigTruth, by_hand: bool) -> Result<[f64; 2], String> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let table: toml::Table = text
        .parse()
        .map_err(|e| format!("{}: {e}", file.display()))?;
    let unit = &truth.file.unit;
    let pins = unit
        .gyro_reference_v
        .ok_or("the unit has no reference pins")?;
    let affine = [("gyro", &unit.gyro_affine), ("accel", &unit.accel_affine)];
    let body = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let axes = match (by_hand, &unit.accel_affine) {
        (true, Some(accel)) => own_axes(&accel.matrix),
        _ => body,
    };
    let mut worst = [0.0_f64; 2];
    for (k, (name, forward)) in affine.into_iter().enumerate() {
        let forward = forward.as_ref().ok_or("the unit has no affine model")?;
        let number = |v: &toml::Value| v.as_float().unwrap_or(f64::NAN);
        let list = |v: &toml::Value| -> Vec<f64> {
            v.as_array().into_iter().flatten().map(number).collect()
        };
        let c: Vec<Vec<f64>> = table[name]["C"]
            .as_array()
            .into_iter()
            .flatten()
            .map(list)
            .collect();
        let o = list(&table[name]["o"]);
        // The firmware reads the gyros against the first one's reference pin, as if that were nominal.
        let ratio = [2.5 / pins[0], 1.0][k];
        let size = [60f64.to_radians(), 9.793][k];
        for axis in 0..3 {
            for sign in [1.0, -1.0, 0.0] {
                let input: [f64; 3] =
                    std::array::from_fn(|i| if i == axis { sign * size } else { 0.0 });
                // In the body's axes, which the unit's truth is given in.
                let turned: [f64; 3] =
                    std::array::from_fn(|j| (0..3).map(|k| axes[k][j] * input[k]).sum());
                let raw: [f64; 3] = std::array::from_fn(|i| {
                    let sum: f64 = (0..3).map(|j| forward.matrix[i][j] * turned[j]).sum();
                    ratio * (sum + forward.bias[i])
                });
                let error = (0..3).map(|i| {
                    let sum: f64 = (0..3).map(|j| c[i][j] * raw[j]).sum();
                    (sum + o[i] - input[i]).powi(2)
                });
                worst[k] = worst[k].max(error.sum::<f64>().sqrt());
            }
        }
    }
    Ok([worst[0].to_degrees(), worst[1] * 1e3 / 9.80665])
}
