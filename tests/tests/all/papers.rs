//! The pages in `docs/papers` against what their program computes.

use std::path::{Path, PathBuf};
use std::process::Command;

#[test]
fn the_figures_of_the_papers_page_come_out_as_they_stand_there() {
    let output = Command::new(env!("CARGO_BIN_EXE_papers"))
        .arg("--check")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
}

/// The list of all items, `docs/papers/coverage.md`.
fn coverage() -> (PathBuf, String) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = std::fs::read_to_string(root.join("docs/papers/coverage.md")).unwrap();
    (root, text)
}

/// Contents of all Rust files below `folder`, one after the other.
fn sources(folder: &Path, into: &mut String) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push_str(&std::fs::read_to_string(&path).unwrap());
        }
    }
}

#[test]
fn every_file_test_and_block_in_the_coverage_of_the_papers_exists() {
    let (root, text) = coverage();
    let mut code = String::new();
    for folder in ["core", "host", "rig", "tests"] {
        sources(&root.join(folder), &mut code);
    }
    let pages = ["papers", "thermal"].map(|folder| {
        let mut text = String::new();
        for entry in std::fs::read_dir(root.join("docs").join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "md") {
                text.push_str(&std::fs::read_to_string(path).unwrap());
            }
        }
        text
    });
    let rows = text.lines().filter(|l| l.starts_with("- "));
    let (mut files, mut tests, mut blocks) = (0, 0, 0);
    for row in rows {
        for name in row.split('`').skip(1).step_by(2) {
            let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
            if name.contains('/') {
                assert!(root.join(name).exists(), "{name}");
                files += 1;
            } else if name.chars().all(word) && name.contains('_') {
                assert!(code.contains(&format!("fn {name}(")), "{name}");
                tests += 1;
            }
        }
        for name in row.split('*').skip(1).step_by(2) {
            let place = format!("<!-- {name} -->");
            assert!(pages.iter().any(|p| p.contains(&place)), "{name}");
            blocks += 1;
        }
    }
    assert!(
        files > 40 && tests > 10 && blocks > 30,
        "{files} {tests} {blocks}"
    );
}
