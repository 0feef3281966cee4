//! Time of a step of a unit and its conversion, with and without effects, which has to stay below a microsecond for three hours
//! at 1 kHz to be recorded in seconds. `cargo bench -p mimu-rig --bench step`. Prints figures and asserts nothing: times drift on
//! shared machines.

use std::time::Instant;

use mimu_rig::converter::Converter;
use mimu_rig::located::Source;
use mimu_rig::motion::Motion;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::rotation::Rotation;
use mimu_rig::unit::Unit;

fn main() {
    for effects in [0, 5] {
        let text = format!("format = \"mimu-rig/1\"\ndraw_effects = {effects}");
        let file = RigFile::parse(&Source::new("RIG.toml", text)).expect("a rig file");
        let truth = RigTruth::resolve(&file, 1).expect("a rig");
        let mut unit = Unit::new(&truth.unit, 1, 1e-3);
        let mut converter = Converter::new(&truth.converter, &truth.unit, 1);
        let motion = Motion {
            t_s: 0.0,
            attitude: Rotation::NONE,
            position: [0.0; 3],
            rate: [0.1, 0.2, 0.3],
            angular_acceleration: [0.0; 3],
            force: [0.0, 0.0, 9.8],
        };
        let (count, begun, mut sum) = (2_000_000, Instant::now(), 0.0);
        for _ in 0..count {
            sum += converter.read(&unit.step(&motion, 25.0)).gyro[0];
        }
        println!(
            "{effects} effects: {:.0} ns a step (mean reading {:.4})",
            begun.elapsed().as_secs_f64() / f64::from(count) * 1e9,
            sum / f64::from(count)
        );
    }
}
