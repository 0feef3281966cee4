//! The judgement of a fit.

use super::errors::{self, ErrorFigures};
use super::input;
use crate::fit::plausible::input_size;
use crate::fit::{Fit, SensorFit};
use crate::judgement::{Judgement, JudgementKind};
use crate::observable::Observable;
use crate::quantity::{Figure, significant};
use crate::readable;
use crate::recording_problem::RecordingProblem;
use crate::unseen::{self, Test};
use crate::warning::Warning;

impl ErrorFigures {
    /// The figures of one triad of `fit`.
    pub fn of_fit(fit: &Fit, sensor: &SensorFit) -> Self {
        let held_out = sensor.held_out_rms();
        // Of a unit in one pose, with the matrix given, the input does not change: no share of it can remain.
        let input = Some(input_size(&fit.prepared, sensor)).filter(|size| *size > 0.0);
        Self {
            sensor: sensor.sensor,
            readable: sensor.figure.readable(sensor.sensor),
            error: held_out.unwrap_or(sensor.rms()),
            unseen: held_out.is_some(),
            input: input.unwrap_or(f64::INFINITY),
            test: sensor.test,
            cause: None,
            too_few: too_few(sensor),
        }
    }
}

/// How many dwells or turns would test the model, if `sensor` has fewer.
fn too_few(sensor: &SensorFit) -> Option<String> {
    let each = sensor.figure.components() as f64;
    let what = match sensor.figure {
        Figure::Direction => "turns",
        Figure::Input | Figure::GravityMagnitude | Figure::RateMagnitude => "dwells",
    };
    let test = sensor.test.filter(|test| !test.can_fail())?;
    let count = sensor.residuals.iter().filter(|r| !r.within).count();
    // As many as the degrees of freedom of what was held out show.
    let rows = each * count as f64;
    let parameters = rows * (1.0 - test.dof / test.count as f64);
    let wanted = unseen::fewest(count, each, parameters)?;
    Some(format!(
        "{count} {what} for {parameters:.0} parameters are too few to test the model; record at least {wanted}"
    ))
}

/// The rates at rest of a gyro that gravity judges are in no figure of its turns. If they differ between dwells by more than biases usually wander,
/// in noise of a dwell mean, that is an error too. Diagnoses draw the same line.
const WANDERS: f64 = 4.0;

/// `Unexplained` if the rates at rest, or the headings after whole turns, differ too much.
fn of_groups(sensor: &SensorFit) -> Vec<Judgement> {
    let group = |group: Observable| {
        let all = sensor.estimated.scatter.iter();
        let (_, scatter) = all.into_iter().find(|(g, _)| *g == group)?;
        Test::of_scatter(scatter, scatter.dof)
    };
    let rests = sensor.static_rms.and_then(|(rms, _)| {
        let test = group(Observable::Rest)?;
        (test.ratio > WANDERS.hypot(1.0).max(test.limit)).then(|| {
            format!(
                "{}: the rates at rest differ between dwells by {} rms, {} times the noise of a dwell",
                sensor.sensor,
                readable::error(sensor.sensor.unit()).write(rms),
                significant(test.ratio)
            )
        })
    });
    let headings = group(Observable::WholeTurns).filter(Test::fails).map(|test| {
        format!(
            "{}: the headings after whole turns err by {} times the stated placement and the noise",
            sensor.sensor,
            significant(test.ratio)
        )
    });
    let all = rests.into_iter().chain(headings);
    all.map(|reason| Judgement::new(JudgementKind::Unexplained, reason))
        .collect()
}

/// `Untested` if the recording has a gyro that it does not calibrate for want of turns: the calibration is then that of an accelerometer, which nobody asked for.
fn without_turns(fit: &Fit) -> Option<Judgement> {
    let is_it = |of: &&Warning| matches!(of, Warning::Of(_, why) if **why == Warning::NoTurn);
    let why = fit.warnings.iter().find(is_it)?;
    let reason = format!("{why}; if the accelerometer is all you want, calibrate it alone");
    Some(Judgement::new(JudgementKind::Untested, reason))
}

impl Judgement {
    /// The judgement of a fit: the worst that its errors, its recording and its warnings lead to.
    pub fn of_fit(fit: &Fit) -> Self {
        let figures = fit.sensors.iter().map(|s| ErrorFigures::of_fit(fit, s));
        let figures: Vec<ErrorFigures> = figures.collect();
        let problems = RecordingProblem::of(fit);
        let by_input = input::judgements(&problems, fit.all_warnings());
        let by_errors = errors::judge(&figures);
        let by_groups = fit.sensors.iter().flat_map(of_groups);
        // What is missing and the input come first: of two equally bad reasons they are the cause.
        let all = without_turns(fit).into_iter().chain(by_input);
        let all = all.chain([by_errors.clone()]).chain(by_groups);
        Self::worst(all).unwrap_or(by_errors)
    }
}
