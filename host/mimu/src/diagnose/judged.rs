//! The judgement of a diagnosis.

use super::decision::{Leftover, WANDERS};
use super::{Diagnosis, SensorDiagnosis};
use crate::judge::errors::{self, ErrorFigures};
use crate::judge::input;
use crate::judgement::{Judgement, JudgementKind};
use crate::readable;
use crate::unseen::Test;

impl Diagnosis {
    /// The judgement: the worst that residuals, errors, recordings and warnings lead to.
    pub fn judgement(&self) -> Judgement {
        let problems = self.problems.iter().map(|p| &p.problem);
        let by_input = input::judgements(problems, self.after.all_warnings());
        let untested = self.untestable.iter().map(|(sensor, why)| {
            Judgement::new(JudgementKind::Untested, format!("{sensor}: {why}"))
        });
        let open = self.sensors.iter().filter_map(of_residuals);
        let figures: Vec<ErrorFigures> = self
            .sensors
            .iter()
            .filter_map(|s| self.figures(s))
            .collect();
        let by_errors = errors::judge(&figures);
        let all = by_input.into_iter().chain(untested).chain(open);
        Judgement::worst(all.chain([by_errors.clone()])).unwrap_or(by_errors)
    }

    /// Error figures with the effects that were found; without any, those of the fit.
    fn figures(&self, found: &SensorDiagnosis) -> Option<ErrorFigures> {
        let fit = self.before.sensor(found.sensor)?;
        let of_fit = ErrorFigures::of_fit(&self.before, fit);
        let decision = &found.decision;
        if decision.accepted.is_empty() {
            return Some(of_fit);
        }
        let [_, held_out] = decision.held_out_rms;
        let error = if held_out.is_finite() {
            held_out
        } else {
            decision.rms[1]
        };
        // What is predicted of the errors is the same with the effects as without.
        let test = |test: Test| Test {
            ratio: test.ratio * error / of_fit.error,
            limit: test.limit.max(WANDERS),
            ..test
        };
        Some(ErrorFigures {
            error,
            unseen: held_out.is_finite(),
            test: of_fit.test.map(test).filter(|_| of_fit.error > 0.0),
            ..of_fit
        })
    }
}

/// `Unexplained` if a residual of the sensor has no explanation, or more than one.
fn of_residuals(found: &SensorDiagnosis) -> Option<Judgement> {
    let decision = &found.decision;
    let by_noise = |l: &&Leftover| l.strength;
    let largest = decision
        .unexplained()
        .max_by(|a, b| by_noise(a).total_cmp(&by_noise(b)));
    let reason = match (largest, decision.undecided.first()) {
        (Some(l), _) => format!(
            "{}, {}: {} rms beyond the noise, which correlates with {}",
            l.sensor,
            l.stratum,
            readable::error(l.unit()).write(l.strength),
            l.against
        ),
        (None, Some(undecided)) => format!(
            "{}: {} and {} explain the residual alike",
            found.sensor, undecided.id, undecided.law
        ),
        (None, None) => return None,
    };
    Some(Judgement::new(JudgementKind::Unexplained, reason))
}
