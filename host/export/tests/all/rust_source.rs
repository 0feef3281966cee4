//! The module compiles for the target without an allocator, and computes bit by bit what a device computes with the stored bytes.

use std::path::{Path, PathBuf};
use std::process::Command;

use mimu::calibration::Calibration;
use mimu_core::stored;
use mimu_device::Image;
use mimu_export::rust::Rust;
use mimu_export::{Nothing, Sources, Target};

use crate::body::mag;
use crate::stream::{COUNTS, VOLTS, lines};
use crate::unit::calibration_of;

const MAIN: &str = "mod stream;
fn main() {
    let compensator = exported::calibration::compensator().unwrap();
    let counts = std::env::args().nth(1).is_some_and(|unit| unit == \"count\");
    for line in stream::lines(&compensator, if counts { stream::COUNTS } else { stream::VOLTS }) {
        println!(\"{line}\");
    }
}
";

/// A crate with the module of `calibration`; its only dependency is `mimu-core`.
fn crate_of(calibration: &Calibration) -> PathBuf {
    let from = Sources {
        calibration: Some((calibration, "test")),
        ..Sources::default()
    };
    let source = Rust::export(&from, &Nothing {}).unwrap().content;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("exported");
    std::fs::create_dir_all(folder.join("src")).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let core = root.join("core").canonicalize().unwrap();
    let manifest = format!(
        "[package]\nname = \"exported\"\nedition = \"2024\"\n[dependencies]\nmimu-core = {{ path = {core:?} }}\n[workspace]\n"
    );
    let write = |file: &str, text: &[u8]| std::fs::write(folder.join(file), text).unwrap();
    write("Cargo.toml", manifest.as_bytes());
    write("src/calibration.rs", &source);
    write(
        "src/lib.rs",
        b"#![no_std]\n#![deny(warnings)]\npub mod calibration;\n",
    );
    write("src/main.rs", MAIN.as_bytes());
    write("src/stream.rs", include_bytes!("stream.rs"));
    // The tested versions, without network access.
    std::fs::copy(root.join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    folder
}

fn cargo(folder: &Path, arguments: &[&str]) -> String {
    let out = Command::new(env!("CARGO"))
        .current_dir(folder)
        .args(&arguments[..1])
        .args(["--offline", "--quiet"])
        .args(&arguments[1..])
        .env("CARGO_TARGET_DIR", folder.join("target"))
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "cargo {arguments:?}: {error}");
    String::from_utf8(out.stdout).unwrap()
}

#[test]
fn a_program_with_the_module_computes_what_the_device_computes_bit_by_bit() {
    // One after the other in one crate, whose dependencies are compiled once.
    for (raw_unit, over_temperature) in
        [("V", true), ("V", false), ("count", true), ("count", false)]
    {
        let mut calibration = calibration_of(raw_unit, over_temperature);
        // A magnetometer does not change what the two triads compute.
        calibration.body.extend((raw_unit == "count").then(mag));
        let folder = crate_of(&calibration);
        let theirs = cargo(&folder, &["run", "--", raw_unit]);
        let image = Image::new(&calibration, "test").unwrap();
        let device = stored::decode(&image.bytes).unwrap().compensator;
        let ours = lines(&device, if raw_unit == "count" { COUNTS } else { VOLTS });
        assert_eq!(theirs.lines().count(), ours.len());
        for (at, (theirs, ours)) in theirs.lines().zip(&ours).enumerate() {
            assert_eq!(theirs, ours, "sample {at}");
        }
        assert_eq!(device.effects.is_some(), over_temperature);
        cargo(
            &folder,
            &["check", "--lib", "--target", "thumbv7em-none-eabihf"],
        );
    }
}
