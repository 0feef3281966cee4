//! The judgement of a diagnosis.

use super::decision::{Leftover, WANDERS};
use super::{Diagnosis, SensorDiagnosis};
use crate::fit::plausible::input_size;
use crate::judge::errors::{self, ErrorFigures, Few};
use crate::judge::input;
use crate::judgement::{Judgement, JudgementKind};
use crate::readable;

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

    /// Error figures with the effects that were found.
    fn figures(&self, found: &SensorDiagnosis) -> Option<ErrorFigures> {
        let fit = self.before.sensor(found.sensor)?;
        let decision = &found.decision;
        let held_out = decision.held_out_rms[1];
        Some(ErrorFigures {
            sensor: found.sensor,
            figure: fit.figure,
            rms: decision.rms[1],
            held_out_rms: held_out.is_finite().then_some(held_out),
            noise_floor: decision.noise_floor.hypot(decision.reference_rms),
            input: input_size(&self.before.prepared, fit),
            usual: WANDERS,
            cause: None,
            few: Few::of_fit(&self.before, fit),
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
