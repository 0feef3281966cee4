//! A verification as text.

use std::fmt::Write as _;

use mimu::calibration::verify::{Causes, SensorVerification, Verification};
use mimu::judge::errors::BEYOND_NOISE;
use mimu::judgement::JudgementKind;
use mimu::quantity::{AXES, Figure, Sensor, plus_minus, significant};
use mimu::readable;
use mimu::warning::Warning;

use crate::report::text::{counted, kinds, warn, warn_within, wrap};

/// Result of `mimu verify`: a summary, or with `verbose` all warnings.
pub fn verify_text(verification: &Verification, verbose: bool) -> String {
    let mut out = format!("judgement: {}\n", verification.judgement);
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
    for (name, s) in verification.sensors.present() {
        if let Some(causes) = s.causes.as_ref().filter(|_| verbose || beyond_noise(s)) {
            causes_text(&mut out, name, causes);
        }
    }
    let all = verification.warnings.iter();
    match verbose {
        true => warn(&mut out, all),
        false => {
            let decisive = |w: &&Warning| w.to_string() == verification.judgement.reason;
            let kinds = kinds(all.filter(|w| !decisive(w)), Warning::is_like);
            warn_within(
                &mut out,
                kinds.map(|(w, more)| counted(w.to_string(), more)),
                1,
            );
        }
    }
    let _ = writeln!(out, "next: {}", next(verification));
    out
}

fn beyond_noise(s: &SensorVerification) -> bool {
    s.rms > BEYOND_NOISE * s.noise_floor
}

/// How much the bias has changed, and how much of the error that explains.
fn causes_text(out: &mut String, name: Sensor, causes: &Causes) {
    let unit = readable::parameter(name.unit());
    let changes = AXES.iter().enumerate().map(|(k, axis)| {
        let [change, half] =
            [causes.bias_change[k], causes.bias_change_interval[k]].map(|v| v * unit.factor);
        format!("{axis} {}", plus_minus(change, half))
    });
    let changes: Vec<String> = changes.collect();
    let text = format!(
        "the bias has changed by {} {}; of the error {}",
        changes.join(", "),
        unit.unit,
        causes.words()
    );
    wrap(out, &format!("{name}: "), &text);
}

/// Next step after the verification.
fn next(verification: &Verification) -> String {
    let again = "fit this recording (mimu fit), and compare both calibrations (mimu compare)";
    let contradicted = |w: &Warning| {
        matches!(
            w,
            Warning::OtherGravity {
                contradicted: true,
                ..
            }
        )
    };
    if verification.warnings.iter().any(contradicted) {
        return "give the recording the gravity of its place (mimu import --gravity), and verify again".into();
    }
    match verification.judgement.kind {
        JudgementKind::Good => return "use the calibration".into(),
        JudgementKind::Untested => {
            return "record more dwells or turns on another day, and verify with that recording"
                .into();
        }
        JudgementKind::Suspect => {
            return "correct what the judgement names (mimu import), and verify again".into();
        }
        JudgementKind::Unexplained | JudgementKind::Misfit => {}
    }
    let worst = verification.worst().and_then(|(_, s)| s.causes.as_ref());
    match worst {
        Some(c) if c.bias.value >= c.matrix.value.max(c.rest.value) => {
            "estimate the biases again and keep the matrices (mimu diagnose REC --calibration FILE -o NEW)".into()
        }
        Some(c) if c.rest.value >= c.matrix.value => {
            "find what the model lacks (mimu diagnose REC)".into()
        }
        _ => again.into(),
    }
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
