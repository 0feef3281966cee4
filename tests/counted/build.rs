//! Gives the linker the memory layout, as the firmware's build does, and an empty `defmt.x`: the target's flags require this file, and nothing here
//! logs.

use std::{env, fs, path::PathBuf};

fn main() {
    let from = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap()).join("../../memory.x");
    let directory = PathBuf::from(env::var("OUT_DIR").unwrap());
    fs::copy(&from, directory.join("memory.x")).expect("memory.x is at the workspace root");
    fs::write(directory.join("defmt.x"), "").expect("a file can be written there");
    println!("cargo:rustc-link-search={}", directory.display());
    println!("cargo:rerun-if-changed={}", from.display());
    println!("cargo:rerun-if-changed=build.rs");
}
