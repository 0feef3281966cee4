//! Result of `mimu diagnose`.

mod page;
mod text;

pub use page::{Sections, body, diagnosis_page};
pub use text::{Detail, diagnosis_text, not_in_plan_text};

use mimu::diagnose::Verdict;
use mimu::fit::Split;
use mimu::quantity::significant;
use mimu::readable;
use mimu::result::diagnosis::{DiagnosisResult, SensorDiagnosisResult};

/// If the reference's errors exceed this many noise floors, they limit the judgement of a clean unit instead of the noise.
const OPEN: f64 = 3.0;

/// Meaning of the verdict, as a sentence fragment.
fn meaning(d: &DiagnosisResult) -> &'static str {
    let open = |s: &SensorDiagnosisResult| s.reference_rms > OPEN * s.noise_floor;
    // Reported below, not judged.
    let usual = d.leftover.iter().any(|l| l.usual);
    match d.verdict {
        Verdict::Clean if d.sensors.present().any(|(_, s)| open(s)) => {
            "noise, and the accelerometer's uncertainty in these poses, explain the residual of the affine calibration"
        }
        Verdict::Clean if usual => {
            "noise, and biases that wander as much as usual, explain the residual of the affine calibration"
        }
        Verdict::Clean => "noise explains the residual of the affine calibration",
        Verdict::Explained if usual => {
            "with the effects below, noise and biases that wander as much as usual explain what remains"
        }
        Verdict::Explained => "with the effects below, noise explains what remains",
        Verdict::Untestable => {
            "no effect was found, and the recording has too little data to judge"
        }
        Verdict::Unexplained if d.unexplained().next().is_some() => {
            "an error of unknown origin remains"
        }
        Verdict::Unexplained => {
            "an unlisted alternative model fits as well as an effect that was found"
        }
    }
}

/// Remarks on the error figures of a sensor, as sentence fragments. `with_share` includes the fraction of the error that is explained.
fn remarks(s: &SensorDiagnosisResult, with_share: bool) -> Vec<String> {
    let mut all = Vec::new();
    if !s.held_out_rms_after.is_finite() {
        all.push(
            "no part of the recording can be held out: the rest would determine too little".into(),
        );
    } else if s.held_out == Split::Interleaved {
        all.push(
            "held out: every fourth dwell, because a single block of time contains the evidence"
                .into(),
        );
    }
    if s.reference_rms > s.noise_floor {
        all.push(format!(
            "the directions of gravity come from the accelerometer, and its errors add at most {} rms to the noise floor",
            readable::error(s.unit).write(s.reference_rms)
        ));
    }
    if let (Some(share), true) = (s.explained, with_share) {
        all.push(format!(
            "the effects explain {} % of the held-out mean square beyond noise and errors of the reference",
            significant(100.0 * share)
        ));
    }
    all
}
