//! A verification for people.

use std::fmt::Write as _;

use mimu::calibration::verify::Verification;
use mimu::quantity::Figure;
use mimu::readable;

use crate::report::text::warn;

/// Result of `mimu verify`.
pub fn verify_text(verification: &Verification) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{:<7}{:>14}{:>14}{:>14}{:>14}{:>12}",
        "", "one scale", "calibrated", "largest", "noise floor", "over"
    );
    for (name, s) in verification.sensors.present() {
        let figure = readable::error(s.unit);
        let [raw, rms, max, floor] =
            [s.rms_raw, s.rms, s.max, s.noise_floor].map(|v| match v.is_finite() {
                true => figure.write(v),
                false => "unknown".into(),
            });
        let noun = match s.figure {
            Figure::Direction => "turns",
            Figure::Input | Figure::GravitySize | Figure::RateSize => "dwells",
        };
        let over = format!("{} {noun}", s.count);
        let _ = writeln!(
            out,
            "{name:<7}{raw:>14}{rms:>14}{max:>14}{floor:>14}{over:>12}"
        );
        let below = [
            ("as it came", s.rms_as_they_came.map(|v| figure.write(v))),
            ("effects left in", s.rms_affine.map(|v| figure.write(v))),
            (
                "at rest",
                s.static_rms.map(|v| readable::error("rad/s").write(v)),
            ),
        ];
        for (label, value) in below {
            if let Some(value) = value {
                let _ = writeln!(out, "{:<7}{label:>14}{value:>14}", "");
            }
        }
    }
    for (name, s) in verification.sensors.present() {
        let _ = writeln!(out, "{name}: {}, rms", s.figure.description());
    }
    out.push_str(
        "one scale: the means of the calibration's scale factors and of its biases on all three axes, no misalignment\n",
    );
    warn(&mut out, verification.warnings.iter());
    out
}
