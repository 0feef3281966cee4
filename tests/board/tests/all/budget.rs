//! The cost of the firmware against its limits.

use std::process::Command;

#[test]
fn no_figure_of_the_firmware_is_over_its_budget() {
    let output = Command::new(env!("CARGO_BIN_EXE_budget"))
        .arg("--check")
        .output()
        .unwrap();
    print!("{}", String::from_utf8_lossy(&output.stdout));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
}
