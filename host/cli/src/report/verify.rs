//! A verification as text.

use std::fmt::Write as _;

use mimu::calibration::verify::{SensorVerification, Verification};
use mimu::quantity::{Figure, significant};
use mimu::readable;
use mimu::warning::Warning;

use crate::report::text::{counted, kinds, warn, warn_within, wrap};

/// Result of `mimu verify`: a summary, or with `verbose` all warnings.
pub fn verify_text(verification: &Verification, verbose: bool) -> String {
    let mut out = String::new();
    for (name, s) in verification.sensors.present() {
        wrap(&mut out, &format!("{name}: "), &verdict(s));
    }
    let _ = writeln!(out);
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
            Figure::Input | Figure::GravityMagnitude | Figure::RateMagnitude => "dwells",
        };
        let over = format!("{} {noun}", s.count);
        let _ = writeln!(
            out,
            "{name:<7}{raw:>14}{rms:>14}{max:>14}{floor:>14}{over:>12}"
        );
        let below = [
            ("uncalibrated", s.rms_uncalibrated.map(|v| figure.write(v))),
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
    wrap(
        &mut out,
        "one scale: ",
        "on all three axes the mean of the calibration's scale factors and that of its biases, without misalignment",
    );
    match verbose {
        true => warn(&mut out, verification.warnings.iter()),
        false => {
            let kinds = kinds(verification.warnings.iter(), Warning::is_like);
            warn_within(
                &mut out,
                kinds.map(|(w, more)| counted(w.to_string(), more)),
                0,
            );
        }
    }
    out
}

/// Effect of the calibration on a sensor's error.
fn verdict(s: &SensorVerification) -> String {
    let figure = readable::error(s.unit);
    let (other, what) = match s.rms_uncalibrated {
        Some(came) => (came, "uncalibrated"),
        None => (s.rms_raw, "with one scale"),
    };
    let [rms, before] = [s.rms, other].map(|v| figure.write(v));
    let how = match s.rms < other {
        true => format!("{rms} rms instead of {before} {what}"),
        false => format!("{rms} rms, not better than {before} {what}"),
    };
    match s.noise_floor.is_finite() && s.noise_floor > 0.0 {
        true => format!(
            "{how}; {} times the noise",
            significant(s.rms / s.noise_floor)
        ),
        false => format!("{how}; the noise is unknown"),
    }
}
