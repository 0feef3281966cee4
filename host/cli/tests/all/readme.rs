//! The README and the documentation show the actual output of the command.

use std::path::Path;
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
