//! Makes `tests/demo/accel.txt` and `gyro.txt`: a simulated unit in 20 poses by hand, as two text files of 12-bit counts.
//!
//! `cargo run -p mimu-tests --example demo_trace`. The same files every time.

use std::fmt::Write as _;

use mimu_tests::simulation::{ByHand, Random, Unit, by_hand};

fn main() -> std::io::Result<()> {
    let mut random = Random::new(2014);
    let unit = Unit::any(&mut random);
    let plan = ByHand {
        poses: 20,
        dwell_s: 2.5,
        turn_s: 1.5,
        rate_hz: 100.0,
    };
    let samples = by_hand(&unit, plan, &mut random);
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("demo");
    for (name, pick) in [("accel", true), ("gyro", false)] {
        let mut text = format!("% {name}: time in s, x, y, z in counts of 5 V / 4096\n");
        for s in &samples {
            let counts =
                (if pick { s.accel } else { s.gyro }).map(|volts| (volts * 4096.0 / 5.0).round());
            let _ = writeln!(
                text,
                "{:.2} {} {} {}",
                s.t_s, counts[0], counts[1], counts[2]
            );
        }
        std::fs::write(folder.join(format!("{name}.txt")), text)?;
    }
    Ok(())
}
