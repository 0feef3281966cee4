//! A trim as text.

use std::fmt::Write as _;

use super::text::warn;
use mimu::quantity::AXES;
use mimu_device::{DeviceResult, Trimmed};

/// Result of `mimu device trim`.
pub fn trim_text(result: &DeviceResult<Trimmed>) -> String {
    let (mut out, found) = (String::new(), &result.found);
    let _ = writeln!(
        out,
        "{}: trimmed at {:.1} °C: stored {} (read back); before: {}",
        result.port, found.temp_c, found.hash, found.before
    );
    let _ = writeln!(
        out,
        "{:<9}{:>26}{:>26}   means of {:.0} s and their standard deviations",
        "", "before", "after", found.averaged_s
    );
    // rad/s is shown as deg/s, m/s² as mg.
    let triads = [
        ("gyro", &found.triads.gyro, 1_f64.to_degrees(), "deg/s"),
        ("accel", &found.triads.accel, 1000.0 / 9.80665, "mg"),
    ];
    for (name, triad, factor, unit) in triads {
        for (i, axis) in AXES.iter().enumerate() {
            let figure = |mean: &[f64; 3], sigma: &[f64; 3]| {
                let [mean, sigma] = [mean[i], sigma[i]].map(|v| v * factor);
                format!("{mean:+.4} ± {sigma:.4} {unit}")
            };
            let before = figure(&triad.before, &triad.sigma_before);
            let line = match triad.trimmed {
                true => format!(
                    "{before:>26}{:>26}",
                    figure(&triad.after, &triad.sigma_after)
                ),
                false => format!("{:>26}{:>26}", "kept", "kept"),
            };
            let _ = writeln!(out, "{:<9}{line}", format!("{name} {axis}"));
        }
    }
    if !found.triads.accel.trimmed {
        let _ = writeln!(
            out,
            "the accelerometer's offsets are unchanged, because its pose was not given (--up +z --gravity 9.81)"
        );
    }
    warn(&mut out, found.warnings.iter());
    out
}
