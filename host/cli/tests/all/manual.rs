//! Files of an installed command: manual and completions.

use std::process::{Command, Output};

fn mimu(arguments: &[&str]) -> Output {
    let mimu = Command::new(env!("CARGO_BIN_EXE_mimu"))
        .args(arguments)
        .output();
    mimu.unwrap()
}

#[test]
fn every_subcommand_has_a_page_with_its_flags_and_every_shell_a_script() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("new/man1");
    let done = mimu(&["man", "-o", pages.to_str().unwrap()]);
    assert!(done.status.success(), "{done:?}");
    let page = |name: &str| std::fs::read_to_string(pages.join(name)).unwrap();
    for (name, text) in [
        ("mimu.1", "Exit status 0"),
        ("mimu-fit.1", "holdout"),
        ("mimu-fit.1", "mimu fit rec"),
        ("mimu-export-px4.1", "qgc"),
        ("mimu-device-upload.1", "port"),
    ] {
        let page = page(name);
        assert!(page.contains(text), "{name} lacks {text}: {page}");
    }
    for shell in ["bash", "zsh", "fish"] {
        let script = mimu(&["completions", shell]).stdout;
        let script = String::from_utf8(script).unwrap();
        assert!(script.contains("holdout"), "{shell}: {script}");
    }
    let file = folder.path().join("taken");
    std::fs::write(&file, "").unwrap();
    let refused = mimu(&["man", "-o", file.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("taken"));
}
