//! Files of an installed command: manual and completions.

use std::path::Path;

use super::command::{done, mimu, says};

#[test]
fn every_subcommand_has_a_page_with_its_flags_and_every_shell_a_script() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("new/man1");
    done(folder.path(), "man -o new/man1");
    let page = |name: &str| std::fs::read_to_string(pages.join(name)).unwrap();
    for (name, text) in [
        ("mimu.1", "Exit status 0"),
        ("mimu-fit.1", "holdout"),
        ("mimu-fit.1", "mimu fit rec"),
        ("mimu-export-px4.1", "qgc"),
        ("mimu-device-upload.1", "port"),
    ] {
        says(&page(name), &[text]);
    }
    for shell in ["bash", "zsh", "fish"] {
        let script = done(Path::new("."), &format!("completions {shell}"));
        says(&script, &["holdout"]);
    }
    std::fs::write(folder.path().join("taken"), "").unwrap();
    let refused = mimu(folder.path(), "man -o taken");
    assert_eq!(refused.status, Some(1));
    says(&refused.stderr, &["taken"]);
}
