//! The pages in `docs/papers` against what their program computes.

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
