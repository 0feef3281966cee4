//! The judgement of a fit.

use super::errors::{self, BEYOND_NOISE, ErrorFigures, Few};
use super::input;
use crate::fit::plausible::input_size;
use crate::fit::{Fit, SensorFit};
use crate::judgement::{Judgement, JudgementKind};
use crate::observable::Observable;
use crate::quantity::{Figure, Sensor, significant};
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
            few: Few::of_fit(fit, sensor),
        }
    }
}

impl Few {
    /// `Some` if noise alone may bring the held-out error of `sensor` beyond [`BEYOND_NOISE`]: twelve poses for the nine parameters of an
    /// accelerometer had 3.9 times the noise held out, and less than the noise in sample.
    ///
    /// The directions that judge turns come from the accelerometer's fit to the same dwells: where these are too few, the turns are not tested
    /// either.
    pub fn of_fit(fit: &Fit, sensor: &SensorFit) -> Option<Self> {
        match (sensor.figure, fit.sensor(Sensor::Accel)) {
            (Figure::Direction, Some(accel)) => Self::of(sensor).or_else(|| {
                let of_dwells = Self::of(accel)?;
                Some(Self {
                    corrected_rms: sensor.rms(),
                    ..of_dwells
                })
            }),
            _ => Self::of(sensor),
        }
    }

    /// By the data of one sensor alone.
    fn of(sensor: &SensorFit) -> Option<Self> {
        let parts = sensor.held_out.parts;
        if sensor.held_out.count == 0 || parts < 2 {
            return None;
        }
        let residuals = sensor.residuals.iter().filter(|r| !r.within).count();
        // Rows of a dwell or a turn in a group.
        let (what, each) = match sensor.figure {
            Figure::Input | Figure::GravityMagnitude | Figure::RateMagnitude => ("dwells", 1.0),
            // A direction has two angles.
            Figure::Direction => ("turns", 2.0),
        };
        let of_figure = |group: Observable| match sensor.figure {
            Figure::Input => matches!(group, Observable::Axis(_)),
            Figure::GravityMagnitude | Figure::RateMagnitude => group == Observable::Magnitude,
            Figure::Direction => group == Observable::Turns,
        };
        let scatter = sensor.estimated.scatter.iter();
        let groups = scatter.filter(|(group, _)| of_figure(*group));
        let least = groups.map(|(_, s)| s.dof).min_by(f64::total_cmp)?;
        let rows = each * residuals as f64;
        let parameters = (rows - least).max(0.0);
        let by_noise = |rows| errors::held_out_by_noise(rows, parameters, parts);
        if by_noise(rows) <= BEYOND_NOISE {
            return None;
        }
        let wanted = (residuals..).find(|n| by_noise(each * *n as f64) <= BEYOND_NOISE)?;
        Some(Self {
            residuals,
            what,
            parameters: parameters.round() as usize,
            corrected_rms: sensor.rms() * (rows / least).sqrt(),
            wanted,
        })
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
