//! The judgement of a fit.

use super::errors::{self, BEYOND_NOISE, ErrorFigures};
use super::input;
use crate::fit::plausible::input_size;
use crate::fit::{Fit, SensorFit};
use crate::judgement::Judgement;
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

impl Judgement {
    /// The judgement of a fit: the worst that its errors, its recording and its warnings lead to.
    pub fn of_fit(fit: &Fit) -> Self {
        let figures = fit.sensors.iter().map(|s| ErrorFigures::of_fit(fit, s));
        let figures: Vec<ErrorFigures> = figures.collect();
        let problems = RecordingProblem::of(fit);
        let by_input = input::judgements(&problems, fit.all_warnings());
        let by_errors = errors::judge(&figures);
        // The input comes first: of two equally bad reasons it is the cause.
        let all = by_input.into_iter().chain([by_errors.clone()]);
        Self::worst(all).unwrap_or(by_errors)
    }
}
