//! Makes `tests/demo/accel.txt` and `gyro.txt`: a simulated unit in 20 poses by hand, as two text files of 12-bit counts.
//!
//! `cargo run -p mimu-tests --example demo_trace`. The same files every time.

use std::fmt::Write as _;

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::samples;
use mimu_rig::rig_file::RigTruth;
use mimu_tests::bench;

const PLAN: &str = r#"
format = "mimu-plan/1"
sample_rate_hz = 50.0
carrier = "hands"
[[step]]
poses = 20
dwell_s = 2.0
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let plan = Plan::parse(Source::new("plan of the demo", PLAN))?;
    let mut random = Random::new(2014, "unit");
    let (gyro, accel) = (bench::gyro(&mut random), bench::accel(&mut random));
    let truth = RigTruth::resolve(&bench::clean(gyro, accel), 2014)?;
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("demo");
    for (name, pick) in [("accel", true), ("gyro", false)] {
        let mut text = format!("% {name}: time in s, x, y, z in counts of 5 V / 4096\n");
        for row in samples(&plan, &truth, 2014)? {
            let volts = if pick {
                row.readings.accel
            } else {
                row.readings.gyro
            };
            let counts = volts.map(|v| (v * 4096.0 / 5.0).round());
            let _ = writeln!(
                text,
                "{:.2} {} {} {}",
                row.instant.motion.t_s, counts[0], counts[1], counts[2]
            );
        }
        std::fs::write(folder.join(format!("{name}.txt")), text)?;
    }
    Ok(())
}
