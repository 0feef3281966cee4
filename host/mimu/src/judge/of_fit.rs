//! The judgement of a fit.

use super::errors::{self, BEYOND_NOISE, ErrorFigures};
use super::input;
use crate::fit::plausible::input_size;
use crate::fit::{Fit, SensorFit};
use crate::judgement::{Judgement, JudgementKind};
use crate::observable::Observable;
use crate::quantity::significant;
use crate::readable;
use crate::recording_problem::RecordingProblem;

impl ErrorFigures {
    /// The figures of one triad of `fit`.
    pub fn of_fit(fit: &Fit, sensor: &SensorFit) -> Self {
        Self {
            sensor: sensor.sensor,
            figure: sensor.figure,
            rms: sensor.rms(),
            held_out_rms: sensor.held_out_rms(),
            noise_floor: sensor.noise_floor(),
            input: input_size(&fit.prepared, sensor),
            usual: BEYOND_NOISE,
            cause: None,
        }
    }
}

/// The rates at rest of a gyro that gravity judges are in no figure of its turns. If they differ between dwells by more than biases usually wander,
/// in noise of a dwell mean, that is an error too. Diagnoses draw the same line.
const WANDERS: f64 = 4.0;

/// `Unexplained` if the rates at rest differ too much.
fn of_rests(sensor: &SensorFit) -> Option<Judgement> {
    let (rms, _) = sensor.static_rms?;
    let of_rests = sensor.estimated.scatter.iter();
    let (_, scatter) = of_rests
        .into_iter()
        .find(|(group, _)| *group == Observable::Rest)?;
    let over = (scatter.chi2 / scatter.dof).sqrt();
    if !(scatter.dof >= 1.0 && over > WANDERS.hypot(1.0)) {
        return None;
    }
    let reason = format!(
        "{}: the rates at rest differ between dwells by {} rms, {} times the noise of a dwell",
        sensor.sensor,
        readable::error(sensor.sensor.unit()).write(rms),
        significant(over)
    );
    Some(Judgement::new(JudgementKind::Unexplained, reason))
}

impl Judgement {
    /// The judgement of a fit: the worst that its errors, its recording and its warnings lead to.
    pub fn of_fit(fit: &Fit) -> Self {
        let figures = fit.sensors.iter().map(|s| ErrorFigures::of_fit(fit, s));
        let figures: Vec<ErrorFigures> = figures.collect();
        let problems = RecordingProblem::of(fit);
        let by_input = input::judgements(&problems, fit.all_warnings());
        let by_errors = errors::judge(&figures);
        let by_rests = fit.sensors.iter().filter_map(of_rests);
        // The input comes first: of two equally bad reasons it is the cause.
        let all = by_input.into_iter().chain([by_errors.clone()]);
        let all = all.chain(by_rests);
        Self::worst(all).unwrap_or(by_errors)
    }
}
