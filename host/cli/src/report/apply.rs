//! A compensated recording as text.

use std::fmt::Write as _;

use mimu::calibration::apply::Applied;
use mimu::quantity::plural;

use crate::report::text::warn;

/// Result of `mimu apply`.
pub fn apply_text(applied: &Applied) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}: {}, compensated, rad/s and m/s²",
        applied.recording,
        plural(applied.rows, "row")
    );
    if let Some(judgement) = &applied.judgement {
        let _ = writeln!(out, "  calibration: {judgement}");
    }
    match applied.effects.as_slice() {
        [] => {}
        effects => {
            let _ = writeln!(out, "  effects removed: {}", effects.join(", "));
        }
    }
    let sensors = [
        ("gyro", applied.sensors.gyro),
        ("accel", applied.sensors.accel),
    ];
    for (name, counts) in sensors {
        let Some(counts) = counts else {
            continue;
        };
        for (n, why) in [
            (counts.empty, "without a reading"),
            (counts.clipped, "at a rail"),
        ] {
            if n > 0 {
                let _ = writeln!(out, "  {name}: {} {why}, left empty", plural(n, "sample"));
            }
        }
    }
    warn(&mut out, applied.warnings.iter());
    out
}
