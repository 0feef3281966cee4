//! Hands the linker the memory layout, which `link.x` of cortex-m-rt includes by the name
//! `memory.x`, and the image the commit that it is built from.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// What the image is made of, seen from this folder. A change elsewhere makes no other image.
const SOURCES: [&str; 7] = [
    ".",
    "../core",
    "../Cargo.toml",
    "../Cargo.lock",
    "../memory.x",
    "../rust-toolchain.toml",
    "../.cargo",
];

fn main() {
    let here = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap());
    let from = here.join("../memory.x");
    let directory = PathBuf::from(env::var("OUT_DIR").unwrap());
    // A copy, and not the workspace itself on the search path, where the linker would look for
    // every other file too.
    fs::copy(&from, directory.join("memory.x")).expect("memory.x is at the workspace root");
    println!("cargo:rustc-link-search={}", directory.display());
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
    }
    println!("cargo:rustc-env=MIMU_FIRMWARE_VERSION={}", version(&here));
}

/// The version and the commit, `-dirty` if the sources are not those of it; the version alone where they are in no repository.
fn version(here: &Path) -> String {
    let version = env::var("CARGO_PKG_VERSION").unwrap();
    let git = |arguments: &[&str]| {
        // Without locks, so that a build beside a commit disturbs neither.
        let mut command = Command::new("git");
        command.current_dir(here).arg("--no-optional-locks");
        let out = command.args(arguments).output().ok()?;
        let text = String::from_utf8(out.stdout).ok()?;
        out.status.success().then(|| text.trim().to_owned())
    };
    // An unpacked archive may lie within somebody else's repository, which knows nothing of it.
    if git(&["ls-files", "--error-unmatch", "build.rs"]).is_none() {
        return version;
    }
    // It grows with every commit and with every change of branch.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo:rerun-if-changed={log}");
    }
    let Some(commit) = git(&["rev-parse", "--short=8", "HEAD"]) else {
        return version;
    };
    let status = ["status", "--porcelain", "--untracked-files=no", "--"];
    let changed = git(&[&status[..], &SOURCES].concat());
    match changed.as_deref() {
        Some("") => format!("{version}-{commit}"),
        _ => format!("{version}-{commit}-dirty"),
    }
}
