//! The README and the documentation show the actual output of the command.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::command::mimu;

#[test]
fn the_fit_in_the_readme_is_that_of_the_example() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let example = Command::new("bash")
        .arg(root.join("tests/example.sh"))
        .arg(env!("CARGO_BIN_EXE_mimu"))
        .env("MIMU_DATA", "/nonexistent")
        .output()
        .unwrap();
    assert!(
        example.status.success(),
        "{}",
        String::from_utf8_lossy(&example.stderr)
    );
    let printed = String::from_utf8(example.stdout).unwrap();
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let (_, below) = readme.split_once("make example -->\n```\n").unwrap();
    let shown = below.split("```\n").next().unwrap().trim_end();
    assert!(
        printed.contains(shown),
        "the README shows\n{shown}\nand the example prints\n{printed}"
    );
}

/// A block below `<!-- mimu ARGUMENTS -->` is part of that command's output; a first line with the command itself is ignored.
#[test]
fn what_the_page_of_designs_shows_is_what_the_command_prints() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = std::fs::read_to_string(root.join("docs/design.md")).unwrap();
    let mut checked = 0;
    for part in page.split("<!-- mimu ").skip(1) {
        let (arguments, rest) = part.split_once(" -->\n```\n").unwrap();
        let shown = rest.split("\n```").next().unwrap();
        let shown = match shown.strip_prefix("$ ") {
            Some(typed) => typed.split_once('\n').unwrap().1,
            None => shown,
        };
        let printed = mimu(Path::new("."), arguments).stdout;
        assert!(
            printed.contains(shown),
            "docs/design.md shows for `mimu {arguments}`\n{shown}\nand it prints\n{printed}"
        );
        checked += 1;
    }
    assert!(checked >= 2, "{checked} blocks");
}

/// README, CONTRIBUTING and the pages of `docs/`, with their text.
fn pages() -> Vec<(PathBuf, String)> {
    fn below(folder: &Path, into: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => below(&path, into),
                false => into.push(path),
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut paths = vec![root.join("README.md"), root.join("CONTRIBUTING.md")];
    below(&root.join("docs"), &mut paths);
    paths.retain(|p| p.extension().is_some_and(|e| e == "md"));
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

/// A table of last year's results must not name an effect that was removed since.
#[test]
fn pages_name_only_effects_that_exist() {
    let listed = mimu::effects::all().map(|e| e.id);
    let exist: BTreeSet<&str> = listed
        .chain(mimu_rig::effects::specs().map(|s| s.id))
        .collect();
    let mut named = 0;
    for (path, text) in pages() {
        let about = path.to_string_lossy();
        if !["effects", "diagnosis", "thermal"]
            .iter()
            .any(|p| about.contains(p))
        {
            continue;
        }
        for word in text.split('`').skip(1).step_by(2) {
            let is_id = word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
            if is_id && (word.starts_with("gyro_") || word.starts_with("accel_")) {
                assert!(exist.contains(word), "{}: {word}", path.display());
                named += 1;
            }
        }
    }
    assert!(named > 50, "{named}");
}

/// Options in commands of these pages, in a line that calls `mimu`.
#[test]
fn pages_name_only_options_that_exist() {
    let folder = tempfile::tempdir().unwrap();
    let man = Command::new(env!("CARGO_BIN_EXE_mimu"))
        .args(["man", "-o"])
        .arg(folder.path())
        .status();
    assert!(man.unwrap().success());
    let mut manual = String::new();
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        let page = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        manual.push_str(&page.replace("\\-", "-"));
    }
    let is_part = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let mut named = 0;
    for (path, text) in pages() {
        for line in text
            .lines()
            .filter(|l| l.contains("mimu ") && !l.contains("cargo ") && !l.contains("mimu-rig "))
        {
            for rest in line.split(" --").skip(1) {
                let name = rest.split(|c| !is_part(c)).next().unwrap_or_default();
                if name.starts_with(|c: char| c.is_ascii_lowercase()) {
                    let option = format!("--{name}");
                    assert!(
                        manual.contains(&option),
                        "{}: {option} in {line}",
                        path.display()
                    );
                    named += 1;
                }
            }
        }
    }
    assert!(named > 100, "{named}");
}
