//! Procedures over temperature, planned: what the chamber and the table do, and how well every curve is known afterwards.
//!
//! The sigmas are those of the regression of the estimate ([`crate::regression`]), with one cubic or one line for each parameter instead of
//! smooth splines. The die is assumed to have the temperature of the chamber, so the precision of a lag is not predicted.

mod prediction;
mod procedure;

pub use prediction::{At, SensorPrediction};
pub use procedure::{Procedure, Schedule};

use mimu::plan::design::budget::DwellNoise;
use mimu::{Fixture, Plan, duration, significant};
use mimu_recording::error::{Argument, Error, Result};
use serde::Serialize;

use crate::basis::{CURVATURE_SPAN, SLOPE_SPAN, Shape};

/// Longest plan that a bench carries out, s.
const LONGEST_S: f64 = 48.0 * 3600.0;

/// What is to be planned.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Sequence of temperatures and motions.
    pub procedure: Procedure,
    /// Temperatures of the chamber, °C.
    pub range_c: [f64; 2],
    /// Curve of every parameter: [`Shape::Line`] or [`Shape::Cubic`].
    pub shape: Shape,
    /// Rate of the chamber from one temperature to the next, K/min.
    pub kelvin_per_min: f64,
    /// Set points of a soak.
    pub set_points: usize,
    /// Whether a soak returns through its set points: niu, Table 2, measures each after heating and after cooling.
    pub both_ways: bool,
    /// Temperatures of the chamber on a ramp, °C, and the time at each, s: niu's three profiles (Table 2), for example. Rounds begin at the
    /// first. Empty: from the lower end of the range to the upper and back.
    pub course: Vec<[f64; 2]>,
    /// Time at a set point of a soak, or before a ramp and at its end, s.
    pub soak_s: f64,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Largest rate of the table, deg/s.
    pub largest_dps: f64,
    /// Samples a second.
    pub sample_rate_hz: f64,
    /// Noise of gyro and accelerometer, SI.
    pub noise: [DwellNoise; 2],
}

/// A procedure with its duration and what it determines.
#[derive(Debug, Clone, Serialize)]
pub struct Planned {
    /// `mimu-thermal-plan/1`.
    pub format: &'static str,
    /// Procedure.
    pub procedure: Procedure,
    /// °C.
    pub range_c: [f64; 2],
    /// `line` or `cubic`.
    pub curves: &'static str,
    /// s.
    pub duration_s: f64,
    /// Dwells and turns.
    pub dwells: usize,
    /// Predicted standard deviations.
    pub sensors: Vec<SensorPrediction>,
    /// What it cannot distinguish.
    pub inseparable: Vec<&'static str>,
    /// Noise of gyro and accelerometer that the prediction is for, SI.
    pub noise: [DwellNoise; 2],
    /// What chamber and table do.
    #[serde(skip)]
    pub schedule: Schedule,
}

/// Plans a procedure.
///
/// # Errors
/// A span that determines no such curve; too few set points; a set point that is too short for its dwells; a course that does not fit the procedure
/// or the range; more than two days.
pub fn plan(request: &Request) -> Result<Planned> {
    let [from, to] = request.range_c;
    let curves = check_span(to - from, request.shape)?;
    check_course(request)?;
    let schedule = Schedule::of(request)?;
    let duration_s = schedule.duration_s();
    if duration_s > LONGEST_S {
        return Err(Error::new(
            request.procedure.name(),
            format!(
                "it takes {}, but a plan has two days at most",
                duration(duration_s)
            ),
            "choose fewer set points, shorter soaks or a faster ramp",
        ));
    }
    let inseparable = match request.procedure {
        Procedure::RestRamp => INSEPARABLE_AT_REST.to_vec(),
        _ => Vec::new(),
    };
    Ok(Planned {
        format: "mimu-thermal-plan/1",
        procedure: request.procedure,
        range_c: request.range_c,
        curves,
        duration_s,
        dwells: schedule.dwells(),
        sensors: prediction::predict(request, &schedule)?,
        inseparable,
        noise: request.noise,
        schedule,
    })
}

/// The plan `mimu-plan/1`, for a table in a chamber.
pub fn to_toml(planned: &Planned, sample_rate_hz: f64) -> String {
    let [from, to] = planned.range_c;
    let schedule = &planned.schedule;
    let round_s = (schedule.rounds > 1 && schedule.waits).then_some(schedule.round_s);
    Plan::new(Fixture::ThreeAxis, sample_rate_hz, schedule.steps.clone())
        .in_chamber(schedule.chamber_c.iter().copied())
        .in_rounds(schedule.lead_in_s, schedule.rounds as u32, round_s)
        .to_toml(&format!(
            "Procedure {} from {from} to {to} °C, by mimu {}.",
            planned.procedure.name(),
            env!("CARGO_PKG_VERSION")
        ))
}

/// One pose, one ramp, from power-on.
const INSEPARABLE_AT_REST: [&str; 3] = [
    "accelerometer, along gravity: only the sum of the bias and 1 g times the change of the scale factor is determined; the bias of z is predicted as if the scale factor were known",
    "all other scale factors and cross terms: nothing excites them",
    "warm-up since power-on, lag of the dies and slope over temperature: one ramp at one rate changes all three together; return at another rate, or soak and measure again",
];

/// Refuses a course for a procedure that has its own, one outside the range, and a return without set points.
fn check_course(request: &Request) -> Result<()> {
    let refuse = |what: &str, problem: String, remedy: &str| Err(Error::new(what, problem, remedy));
    let name = request.procedure.name();
    let ramps = matches!(request.procedure, Procedure::Niu | Procedure::Ramp);
    let [from, to] = request.range_c;
    match request.course.as_slice() {
        _ if request.both_ways && request.procedure != Procedure::Soak => refuse(
            "return through the set points",
            format!("the procedure {name} has no set points"),
            "choose the procedure soak",
        ),
        [] => Ok(()),
        _ if !ramps => refuse(
            "course of the chamber",
            format!("the procedure {name} has its own"),
            "leave the course out, or choose niu or ramp",
        ),
        [_] => refuse(
            "course of the chamber",
            "one temperature is no ramp".into(),
            "give the temperatures that the chamber turns round at",
        ),
        course => match course.iter().find(|[c, _]| !(from..=to).contains(c)) {
            Some([c, _]) => refuse(
                "course of the chamber",
                format!("{c} °C is outside the range of {from} to {to} °C"),
                "widen the range",
            ),
            None => Ok(()),
        },
    }
}

/// Refuses a span that does not determine such a curve; otherwise returns the name of the curve.
fn check_span(kelvin: f64, shape: Shape) -> Result<&'static str> {
    let refuse = |least: f64, what: &str, remedy: &str| {
        let problem = format!("{} K: {what} needs {least} K", significant(kelvin));
        Err(Error::new("range of temperatures", problem, remedy).about(Argument::Range))
    };
    if !(kelvin >= SLOPE_SPAN) {
        let what = "below that span noise and drift look like a slope over temperature, which";
        return refuse(SLOPE_SPAN, what, "widen the range");
    }
    match shape {
        Shape::Line => Ok("line"),
        _ if kelvin < CURVATURE_SPAN => {
            let what = "below that span the slope looks like curvature, which";
            let error = refuse(
                CURVATURE_SPAN,
                what,
                "widen the range, or choose straight lines",
            );
            error.map_err(|e| e.about(Argument::Curves))
        }
        _ => Ok("cubic"),
    }
}
