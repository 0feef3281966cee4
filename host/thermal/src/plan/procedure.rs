//! What chamber and table do in each procedure, and when.

use mimu::plan::design::model::Setting;
use mimu::plan::design::tour::Motion;
use mimu::plan::{Step, TableAxis, chamber};
use mimu::{Fixture, duration};
use mimu_recording::error::{Argument, Error, Result};
use nalgebra::Vector3;
use serde::Serialize;

use super::Request;
use crate::basis::Shape;

/// Sequences of temperatures and motions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, strum::IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Procedure {
    /// Set points, at each of which the unit takes the chamber's temperature before it is measured: fang, section 3.
    Soak,
    /// Positions and quarter turns while the chamber goes up and down: niu, section 3.2.
    Niu,
    /// Six faces and rates about all axes while the chamber goes up and down.
    Ramp,
    /// At rest with z up while the chamber goes up, as autopilots calibrate themselves.
    RestRamp,
}

impl Procedure {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// A procedure in time.
#[derive(Debug, Clone)]
pub struct Schedule {
    /// Temperature of the chamber: s and °C, linear between, held outside.
    pub chamber_c: Vec<[f64; 2]>,
    /// Time before the first round, s.
    pub lead_in_s: f64,
    /// Number of times that all steps are done.
    pub rounds: usize,
    /// From the beginning of a round to that of the next, s.
    pub round_s: f64,
    /// Whether the table waits for the next round; if not, rounds follow each other.
    pub waits: bool,
    /// What is done in a round.
    pub steps: Vec<Step>,
    /// Beginning and end of each step in a round, s.
    pub times_s: Vec<[f64; 2]>,
}

/// Time to come to rest and to begin a turn, s: niu, 3.2, ten seconds a position of which nine are measured.
const NIU_SETTLE_S: f64 = 0.95;
const NIU_RAMPS_S: f64 = 0.05;
/// Rate of niu's turns, deg/s.
const NIU_DPS: f64 = 10.0;

impl Schedule {
    /// The schedule of a procedure.
    ///
    /// # Errors
    /// Too few set points for the curves; soaks that are too short for their dwells.
    pub fn of(request: &Request) -> Result<Self> {
        match request.procedure {
            Procedure::Soak => soak(request),
            Procedure::Niu => Ok(sweep(request, niu(request))),
            Procedure::Ramp => Ok(sweep(request, faces_and_rates(request))),
            Procedure::RestRamp => Ok(rest_ramp(request)),
        }
    }

    /// From power-on to the end of the last dwell, s.
    pub fn duration_s(&self) -> f64 {
        let last = self.times_s.last().map_or(0.0, |t| t[1]);
        self.lead_in_s + (self.rounds - 1) as f64 * self.round_s + last
    }

    /// Dwells and turns.
    pub fn dwells(&self) -> usize {
        self.rounds * self.steps.len()
    }

    /// Temperature of the chamber at a time, °C.
    pub fn temp_c(&self, t_s: f64) -> f64 {
        chamber::temp_c(&self.chamber_c, t_s)
    }
}

/// Steps with their times in a round.
struct Round {
    steps: Vec<Step>,
    times_s: Vec<[f64; 2]>,
    length_s: f64,
    waits: bool,
}

fn soak(request: &Request) -> Result<Schedule> {
    let [from, to] = request.range_c;
    let needed = if request.shape == Shape::Line { 2 } else { 4 };
    let n = request.set_points;
    if n < needed {
        let problem = format!("{n} set points, but the curves have {needed} coefficients");
        let remedy = format!("choose at least {needed}, and one more to test the curves");
        return Err(Error::new("set points", problem, remedy).about(Argument::SetPoints));
    }
    let round = faces_and_rates(request);
    if round.length_s > request.soak_s {
        return Err(Error::new(
            "soak",
            format!(
                "{} at a set point, but its dwells and the moves take {}",
                duration(request.soak_s),
                duration(round.length_s)
            ),
            "soak for longer, or choose shorter dwells",
        )
        .about(Argument::Soak));
    }
    let apart = (to - from) / (n - 1) as f64;
    let round_s = request.soak_s + apart / request.kelvin_per_min * 60.0;
    let up = 0..n;
    let down = up.clone().rev().filter(|_| request.both_ways);
    let points: Vec<usize> = up.chain(down).collect();
    let corners = points.iter().enumerate().flat_map(|(k, point)| {
        let (t, c) = (k as f64 * round_s, from + *point as f64 * apart);
        [[t, c], [t + request.soak_s, c]]
    });
    Ok(Schedule {
        chamber_c: corners.collect(),
        lead_in_s: request.soak_s - round.length_s,
        rounds: points.len(),
        round_s,
        waits: true,
        steps: round.steps,
        times_s: round.times_s,
    })
}

/// The requested course, or up, held, and down again, with as many rounds as fit.
fn sweep(request: &Request, round: Round) -> Schedule {
    let [from, to] = request.range_c;
    let soak_s = request.soak_s;
    let usual = [[from, soak_s], [to, soak_s], [from, 0.0]];
    let (course, lead_in_s) = match request.course.as_slice() {
        // A round at each end of the range belongs to it.
        [] => (&usual[..], (soak_s - round.length_s).max(0.0)),
        given => (given, 0.0),
    };
    let (mut chamber_c, mut t) = (Vec::<[f64; 2]>::new(), 0.0);
    for [temp_c, held_s] in course {
        if let Some([_, before]) = chamber_c.last() {
            t += (temp_c - before).abs() / request.kelvin_per_min * 60.0;
        }
        chamber_c.push([t, *temp_c]);
        if *held_s > 0.0 {
            t += held_s;
            chamber_c.push([t, *temp_c]);
        }
    }
    let rounds = ((t - lead_in_s) / round.length_s).ceil() + 1.0;
    Schedule {
        chamber_c,
        lead_in_s,
        rounds: rounds as usize,
        round_s: round.length_s,
        waits: round.waits,
        steps: round.steps,
        times_s: round.times_s,
    }
}

fn rest_ramp(request: &Request) -> Schedule {
    let [from, to] = request.range_c;
    let ramp_s = (to - from) / request.kelvin_per_min * 60.0;
    let end_s = ramp_s + 2.0 * request.soak_s;
    Schedule {
        chamber_c: vec![
            [0.0, from],
            [request.soak_s, from],
            [request.soak_s + ramp_s, to],
        ],
        lead_in_s: 0.0,
        rounds: 1,
        round_s: end_s,
        waits: false,
        steps: vec![Step::dwell(Some(Vector3::z()), 0.0, end_s)],
        times_s: vec![[0.0, end_s]],
    }
}

/// Six faces at rest, then both ways about each axis.
fn faces_and_rates(request: &Request) -> Round {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let at_rest = axes.iter().flat_map(|up| [(*up, 0.0), (-up, 0.0)]);
    // Turned about the vertical at one rate with the axis up and with it down: this gives both directions in the body, and balanced forces.
    let rates = axes
        .iter()
        .flat_map(|up| [(*up, request.largest_dps), (-up, request.largest_dps)]);
    let settings: Vec<Setting> = at_rest
        .chain(rates)
        .map(|(up, dps)| Setting {
            up,
            rate: f64::to_radians(dps),
        })
        .collect();
    let motion = Motion::of(Fixture::ThreeAxis);
    let mut times_s = Vec::new();
    let mut t = 0.0;
    for (k, setting) in settings.iter().enumerate() {
        // From the last dwell of a round to its first.
        let before = if k == 0 { settings.len() - 1 } else { k - 1 };
        t += motion.between(&settings[before], setting);
        times_s.push([t, t + request.dwell_s]);
        t += request.dwell_s;
    }
    let steps = settings.iter().map(|s| Step::of(s, request.dwell_s));
    Round {
        steps: steps.collect(),
        times_s,
        // To a whole second, plus a second for a slower table.
        length_s: t.ceil() + 1.0,
        waits: true,
    }
}

/// Eight positions and eight quarter turns. niu's text does not give the order. This one turns both ways about each axis and reaches the
/// poses of its appendix, upside down: with z up instead of down the tilt stays within 90 degrees, which every table allows.
fn niu(request: &Request) -> Round {
    let rate_dps = NIU_DPS.min(request.largest_dps);
    let cycle = [
        (TableAxis::Middle, 90.0),
        (TableAxis::Inner, 90.0),
        (TableAxis::Middle, -90.0),
        (TableAxis::Inner, -90.0),
        (TableAxis::Middle, -90.0),
        (TableAxis::Inner, 90.0),
        (TableAxis::Middle, 90.0),
        (TableAxis::Inner, -90.0),
    ];
    let (mut steps, mut times_s, mut t) = (Vec::new(), Vec::new(), 0.0);
    for (k, (axis, angle_deg)) in cycle.into_iter().enumerate() {
        t += NIU_SETTLE_S;
        times_s.push([t, t + request.dwell_s]);
        t += request.dwell_s;
        let turn_s = 90.0 / rate_dps + NIU_RAMPS_S;
        times_s.push([t, t + turn_s]);
        t += turn_s;
        // Each dwell after the first is where the turn before has ended.
        let up = (k == 0).then(Vector3::z);
        steps.push(Step::dwell(up, 0.0, request.dwell_s));
        steps.push(Step::turn(axis, angle_deg, rate_dps));
    }
    Round {
        steps,
        times_s,
        length_s: t,
        waits: false,
    }
}
