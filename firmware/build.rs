//! Hands the linker the memory layout, which `link.x` of cortex-m-rt includes by the name
//! `memory.x`.

use std::{env, fs, path::PathBuf};

fn main() {
    let from = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap()).join("../memory.x");
    let directory = PathBuf::from(env::var("OUT_DIR").unwrap());
    // A copy, and not the workspace itself on the search path, where the linker would look for
    // every other file too.
    fs::copy(&from, directory.join("memory.x")).expect("memory.x stands at the workspace root");
    println!("cargo:rustc-link-search={}", directory.display());
    println!("cargo:rerun-if-changed={}", from.display());
    println!("cargo:rerun-if-changed=build.rs");
}
