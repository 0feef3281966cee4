//! What the README shows is what the command prints.

use std::path::Path;
use std::process::Command;

#[test]
fn the_fit_in_the_readme_is_that_of_the_demo() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let demo = Command::new("bash")
        .arg(root.join("tests/demo.sh"))
        .arg(env!("CARGO_BIN_EXE_mimu"))
        .env("MIMU_DATA", "/nonexistent")
        .output()
        .unwrap();
    assert!(
        demo.status.success(),
        "{}",
        String::from_utf8_lossy(&demo.stderr)
    );
    let printed = String::from_utf8(demo.stdout).unwrap();
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let shown = readme.split("```\n").nth(1).unwrap().trim_end();
    assert!(
        printed.contains(shown),
        "the README shows\n{shown}\nand the demo prints\n{printed}"
    );
}
