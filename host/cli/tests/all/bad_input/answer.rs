//! Runs the command, and checks its answer.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::generator::*;
use crate::command::{Ran, run};

/// Result of the command.
pub struct Run {
    pub status: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

pub fn mimu<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Run {
    let Ran {
        status,
        stdout,
        stderr,
    } = run(Path::new("."), arguments);
    Run {
        status,
        stdout,
        stderr,
    }
}

impl Run {
    /// The line of a refusal, after checking that it is a refusal and has its three parts. A command that has read the recording first lists its
    /// problems, and a fit also the dwells.
    pub fn refusal(&self) -> &str {
        let text = self.stderr.strip_suffix('\n').unwrap_or(&self.stderr);
        let (before, line) = text.rsplit_once('\n').unwrap_or(("", text));
        let mut lines = before.lines().peekable();
        if lines.next_if(|l| l.starts_with("problems of th")).is_some() {
            let listed = std::iter::from_fn(|| lines.next_if(|l| l.starts_with("  - ")));
            assert!(listed.count() > 0, "{text}");
        }
        let table = lines.next();
        assert!(
            table.is_none_or(|head| head.starts_with("step ") && head.contains("first row")),
            "{text}"
        );
        assert_eq!(
            self.status,
            Some(1),
            "stderr: {line}\nstdout: {}",
            self.stdout
        );
        assert!(
            !line.is_empty() && !line.contains(char::is_control),
            "{line:?}"
        );
        let told = line.strip_prefix("mimu: ").expect(line);
        let (place, rest) = told.split_once(": ").expect(line);
        let (problem, remedy) = rest.split_once("; ").expect(line);
        assert!(
            [place, problem, remedy]
                .iter()
                .all(|p| !p.trim().is_empty()),
            "{line}"
        );
        // A refusal prints no result; with `--json -` it prints itself as JSON.
        if !self.stdout.is_empty() {
            let told: Value = serde_json::from_str(&self.stdout).expect(&self.stdout);
            assert_eq!(told["format"], "mimu-refusal/1", "{told}");
            let part = |key: &str| told["error"][key].as_str().unwrap().replace('\n', " ");
            for part in ["place", "problem", "remedy"].map(part) {
                assert!(line.contains(&part), "{part:?} is not in: {line}");
            }
            let keys = told.as_object().unwrap().keys();
            assert_eq!(
                keys.collect::<Vec<_>>(),
                ["error", "format", "judgement", "recording_problems"]
            );
        }
        line
    }

    pub fn refused(&self, words: &[&str]) {
        let line = self.refusal();
        println!("    {line}");
        for word in words {
            assert!(line.contains(word), "{word:?} is not in: {line}");
        }
    }

    pub fn json(&self) -> Value {
        assert_eq!(self.status, Some(0), "{}", self.stderr);
        assert!(self.stderr.is_empty(), "{}", self.stderr);
        serde_json::from_str(&self.stdout).expect("JSON on standard output")
    }
}

pub fn warnings(result: &Value) -> Vec<String> {
    let all = result["warnings"].as_array().expect("warnings");
    all.iter()
        .map(|w| w["text"].as_str().or(w.as_str()).unwrap().to_string())
        .collect()
}

pub fn warned(result: &Value, words: &[&str]) {
    let all = warnings(result);
    println!("    {}", all.join("\n    "));
    for word in words {
        assert!(
            all.iter().any(|w| w.contains(word)),
            "{word:?} is not in: {all:#?}"
        );
    }
}

/// Distance of each parameter of `sensor` from the truth, in halves of its 95 % interval; returns the largest.
pub fn distance(result: &Value, sensor: &str) -> f64 {
    let (p, b) = match sensor {
        "gyro" => (GYRO_P, GYRO_B),
        _ => (ACCEL_P, ACCEL_B),
    };
    let c = inverse(&p);
    let o = times(&c, &b).map(|x| -x);
    let parameters = result["sensors"][sensor]["parameters"]
        .as_array()
        .expect(sensor);
    let mut worst: f64 = 0.0;
    for (i, row) in ["x", "y", "z"].iter().enumerate() {
        let mut check = |name: String, truth: f64| {
            let found = parameters
                .iter()
                .find(|p| p["name"] == name.as_str())
                .unwrap();
            let number = |key: &str| found[key].as_f64().expect("a number");
            let half = 0.5 * (number("upper") - number("lower"));
            // Parameters that the choice of frame makes zero have no interval.
            if truth != 0.0 || half > 0.0 {
                worst = worst.max((number("value") - truth).abs() / half);
            } else {
                assert_eq!(number("value"), 0.0);
            }
        };
        for (j, column) in ["x", "y", "z"].iter().enumerate() {
            check(format!("C_{row}{column}"), c[i][j]);
        }
        check(format!("o_{row}"), o[i]);
    }
    worst
}

pub fn right(result: &Value) {
    for sensor in ["gyro", "accel"] {
        let worst = distance(result, sensor);
        assert!(
            worst < 2.0,
            "{sensor}: {worst} times half of the interval from the truth; {:#?}",
            warnings(result)
        );
    }
}

/// A folder that contains a recording.
pub struct Place {
    pub folder: tempfile::TempDir,
}

impl Place {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    pub fn with(samples: &Samples) -> Self {
        let place = Self::new();
        samples.write(&place.recording());
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn text(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    pub fn recording(&self) -> PathBuf {
        self.path("rec")
    }

    pub fn fit(&self, arguments: &[&str]) -> Run {
        let recording = self.text("rec");
        let fixed = ["fit", &recording, "--json", "-"];
        mimu(fixed.into_iter().chain(arguments.iter().copied()))
    }

    /// Names in the folder, sorted; hidden ones too.
    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}
