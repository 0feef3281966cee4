//! Whether the input is what it is declared to be.

use crate::judgement::{Judgement, JudgementKind};
use crate::recording_problem::RecordingProblem;
use crate::warning::Warning;
use mimu_recording::health::Fault;

/// The kind of judgement that `warning` alone leads to; `None` if a good result may have it.
///
/// `Suspect`: the readings contradict their unit, rate, sign, range or columns. All data agree with such an input, so no residual shows it.
/// The ends of a 16-bit converter are none of these: samples there are known to be clipped and are left out.
/// `Untested`: the data cannot contradict the result.
pub fn of_warning(warning: &Warning) -> Option<JudgementKind> {
    match warning {
        Warning::Of(_, warning) | Warning::Channel(_, warning) => of_warning(warning),
        Warning::CalibrationOfOther { .. }
        | Warning::NoisierThanGyros { .. }
        | Warning::ImplausibleRate { .. }
        | Warning::Restless { .. }
        | Warning::RateOff { .. }
        | Warning::TrustedClock(_)
        | Warning::Gravity { .. }
        | Warning::OtherGravity {
            contradicted: true, ..
        }
        | Warning::NoiseOfAnother { .. }
        | Warning::LeftHanded
        | Warning::Turned { .. }
        | Warning::WideTurn { .. }
        | Warning::RatesContradict { .. }
        | Warning::OtherUnit { .. }
        | Warning::OtherDevice { .. }
        | Warning::BiasRemoved(_) => Some(JudgementKind::Suspect),
        Warning::Health(finding) => of_finding(finding.fault),
        Warning::NoResiduals
        | Warning::FewResiduals
        | Warning::PoorlyDetermined { .. }
        | Warning::UnseenPoses { .. }
        | Warning::LeftOpen { .. }
        | Warning::SameRecording
        | Warning::NothingToJudge => Some(JudgementKind::Untested),
        Warning::NoBetter {
            undecided: None, ..
        }
        | Warning::Worse { .. }
        | Warning::FaceDiffers { .. }
        | Warning::WholeTurnsContradict { .. }
        | Warning::Outliers { .. } => Some(JudgementKind::Unexplained),
        _ => None,
    }
}

/// The same for a fault of the readings.
fn of_finding(fault: Fault) -> Option<JudgementKind> {
    let suspect = matches!(
        fault,
        Fault::Dead { .. }
            | Fault::RunAtEnd { .. }
            | Fault::CalmEnd { .. }
            | Fault::NoGravity { .. }
            | Fault::NotSi { .. }
            | Fault::NotCounts { .. }
            | Fault::Turning { .. }
    );
    suspect.then_some(JudgementKind::Suspect)
}

/// The kind of judgement that a problem of a recording alone leads to; `None` if a good result may have it.
pub fn of_problem(problem: &RecordingProblem) -> Option<JudgementKind> {
    match problem {
        RecordingProblem::Offset(..) => Some(JudgementKind::Suspect),
        RecordingProblem::MissingPoses(_) => Some(JudgementKind::Untested),
        RecordingProblem::Seen(_, warnings) => warnings.iter().filter_map(of_warning).max(),
        RecordingProblem::SlowForTurns(_)
        | RecordingProblem::Temperatures(..)
        | RecordingProblem::LostSamples(_) => None,
    }
}

/// The judgements that `warnings` and `problems` lead to, in their order. A warning that is also a problem is judged once.
pub fn judgements<'a>(
    problems: impl IntoIterator<Item = &'a RecordingProblem>,
    warnings: impl IntoIterator<Item = &'a Warning>,
) -> Vec<Judgement> {
    let of_problems = problems
        .into_iter()
        .filter_map(|p| Some(Judgement::new(of_problem(p)?, p)));
    let others = warnings.into_iter().filter(|w| !w.is_of_recording());
    let of_warnings = others.filter_map(|w| Some(Judgement::new(of_warning(w)?, w)));
    of_problems.chain(of_warnings).collect()
}
