//! `tests/data.sh`, which brings the public recordings, against a mirror of two files.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use mimu_tests::says;
use tempfile::TempDir;

/// SHA-256 of `one\n` and of `two\n`, by `sha256sum`.
const ONE: &str = "2c8b08da5ce60398e1f19af0e5dccc744df274b826abe585eaba68c525434806";
const TWO: &str = "27dd8ed44a83ff94d557f9fd0412ed5a8cbca69ea04922d88c01184a07300a5a";

/// A mirror whose files contain `one` and `second`, a table, and a place for the data.
struct Mirror {
    folder: TempDir,
}

impl Mirror {
    fn new(second: &str) -> Self {
        let mirror = Self {
            folder: TempDir::new().expect("a folder"),
        };
        let files = mirror.path("from/someone/imu/0123abc/raw data");
        std::fs::create_dir_all(&files).expect("a folder");
        std::fs::write(files.join("one.csv"), "one\n").expect("a file");
        std::fs::write(files.join("two.csv"), second).expect("a file");
        let table = format!(
            "# a comment\nset unit someone/imu 0123abc MIT raw data\n{ONE}  one.csv\n{TWO}  two.csv\n"
        );
        std::fs::write(mirror.path("table"), table).expect("a file");
        mirror
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the script; `None` if this machine cannot.
    fn bring(&self) -> Option<Output> {
        if Command::new("curl").arg("--version").output().is_err() {
            println!("skipped: no curl");
            return None;
        }
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("data.sh");
        let run = Command::new("bash")
            .arg(script)
            .arg(self.path("table"))
            .env("MIMU_DATA", self.path("data"))
            .env(
                "MIMU_DATA_FROM",
                format!("file://{}", self.path("from").display()),
            )
            .output();
        Some(run.expect("bash runs"))
    }

    /// Names of all files in the folder of the data.
    fn brought(&self) -> Vec<String> {
        let files = std::fs::read_dir(self.path("data/unit")).expect("the folder");
        let mut names: Vec<String> = files
            .map(|f| {
                f.expect("a file")
                    .file_name()
                    .to_string_lossy()
                    .into_owned()
            })
            .collect();
        names.sort();
        names
    }
}

#[test]
fn public_recordings_arrive_with_their_source_and_are_fetched_once() {
    let mirror = Mirror::new("two\n");
    let Some(first) = mirror.bring() else { return };
    assert!(first.status.success(), "{first:?}");
    assert_eq!(mirror.brought(), ["SOURCE.txt", "one.csv", "two.csv"]);
    let source = std::fs::read_to_string(mirror.path("data/unit/SOURCE.txt")).unwrap();
    says(&source, &["someone/imu", "0123abc", "MIT"]);
    // Without the mirror, a second run succeeds only if it fetches nothing.
    std::fs::remove_dir_all(mirror.path("from")).unwrap();
    let second = mirror.bring().unwrap();
    assert!(second.status.success(), "{second:?}");
}

#[test]
fn a_public_recording_with_another_checksum_is_refused_and_leaves_nothing() {
    let mirror = Mirror::new("changed\n");
    let Some(run) = mirror.bring() else { return };
    assert!(!run.status.success());
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(said.contains("two.csv") && said.contains(TWO), "{said}");
    assert_eq!(mirror.brought(), ["SOURCE.txt", "one.csv"]);
}

#[test]
fn a_changed_file_at_the_place_of_a_public_recording_is_kept_and_named() {
    let mirror = Mirror::new("two\n");
    std::fs::create_dir_all(mirror.path("data/unit")).unwrap();
    std::fs::write(mirror.path("data/unit/one.csv"), "mine\n").unwrap();
    let Some(run) = mirror.bring() else { return };
    assert!(!run.status.success());
    assert!(String::from_utf8_lossy(&run.stderr).contains("one.csv"));
    let kept = std::fs::read_to_string(mirror.path("data/unit/one.csv")).unwrap();
    assert_eq!(kept, "mine\n");
}

#[test]
fn every_source_of_the_table_of_public_recordings_is_documented() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let table = std::fs::read_to_string(root.join("data.txt")).unwrap();
    let page = std::fs::read_to_string(root.join("../docs/recordings.md")).unwrap();
    let sets = table.lines().filter(|line| line.starts_with("set "));
    let mut count = 0;
    for set in sets {
        let words: Vec<&str> = set.split(' ').collect();
        let folder = words[1].split('/').next().unwrap();
        let row = page
            .lines()
            .find(|l| l.starts_with(&format!("| `{folder}`")));
        let row = row.unwrap_or_else(|| panic!("docs/recordings.md lacks {folder}"));
        assert!(
            row.contains(words[2]) && row.contains(&words[3][..7]),
            "{row}"
        );
        count += 1;
    }
    assert!(count > 0);
}
