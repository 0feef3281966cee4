//! Sessions of the virtual bench, and the same without noise, which gives the true readings of a unit.

use std::path::Path;

use mimu_rig::located::Source;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_tests::bench::recorded;
use mimu_thermal::session::Session;
use nalgebra::Vector3;

/// A file of the bench: `rigs/niu-mtig.toml`.
pub fn read(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../rig")
        .join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A rig file with nothing left to draw: the unit of this seed. Another seed then changes only the noise.
pub fn unit(text: &str, seed: u64) -> RigFile {
    let file = RigFile::parse(&Source::new("rig", text)).expect("a rig file");
    RigTruth::resolve(&file, seed).expect("a rig").file
}

/// `file` without noise, apart from its thermometer's and a hundredth of a millivolt of the converter's: a channel that repeats one value would be
/// taken for stuck or clipped. Its converter has 24 bits, because without noise the quantisation steps of 16 bits would be errors that a mean keeps.
pub fn noiseless(file: &RigFile) -> RigFile {
    let mut file = file.clone();
    for axes in [&mut file.unit.gyro_axes, &mut file.unit.accel_axes] {
        axes.white_si = Some([0.0; 3]);
        axes.instability_si = Some([0.0; 3]);
        axes.walk_si = Some([0.0; 3]);
        axes.white_per_sample = Some([0.0; 3]);
    }
    file.curves.gyro.noise_at_c_raw = None;
    file.curves.accel.noise_at_c_raw = None;
    file.converter.noise_codes = Some(100.0);
    file.converter.bits = Some(24);
    file
}

/// A plan carried out, and read as a user's recording is.
pub fn session(plan: &str, file: &RigFile, seed: u64) -> Session {
    Session::of(&recorded(plan, file, seed)).expect("its thermometer works")
}

/// Root mean squares of the errors of each axis.
pub fn rms(errors: &[Vector3<f64>]) -> Vector3<f64> {
    let squares: Vector3<f64> = errors.iter().map(|e| e.map(|x| x * x)).sum();
    squares.map(|s| f64::sqrt(s / errors.len().max(1) as f64))
}
