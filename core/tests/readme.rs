//! The README's program is that of the example, which is compiled for the device and compared with the PC's command.

#[test]
fn the_readme_shows_the_example() {
    let readme = include_str!("../README.md");
    let program = include_str!("../examples/stream/calibrate.rs");
    assert!(readme.contains(program.trim_end()));
    assert!(program.lines().count() <= 20);
}
