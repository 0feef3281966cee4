//! The plan of an experiment, `PLAN.toml`: the designer writes it, a person reads it, and the bench carries it out.

use std::ops::Range;
use std::path::Path;

use serde::Deserialize;

use crate::located::Source;
use crate::place::Place;
use crate::rotation::{Rotation, Vector};

mod reader;
mod reading;
mod step;
mod turn;

pub use turn::{TableAxis, Turn};

/// A checked plan.
#[derive(Debug, Clone)]
pub struct Plan {
    source: Source,
    /// Unit under test.
    pub device: String,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Storage format of the samples.
    pub samples: Samples,
    /// What holds the board.
    pub carrier: CarriedBy,
    /// Whether the recording numbers the dwells.
    pub numbered: bool,
    /// Place of the bench.
    pub place: Place,
    /// Chamber temperature: time (s, increasing) and °C at each breakpoint. [`Plan::chamber_c`] interpolates.
    pub chamber: Vec<[f64; 2]>,
    /// Time in the first pose before the first dwell, powered, s.
    pub lead_in_s: f64,
    /// The steps, in order.
    pub steps: Vec<Step>,
    /// How many times all steps are carried out.
    pub rounds: u32,
    /// Time from the beginning of a round to that of the next, s. If missing, rounds follow without a pause.
    pub round_s: Option<f64>,
    round_at: Range<usize>,
}

/// Storage of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Samples {
    /// Apache Parquet.
    Parquet,
    /// Comma-separated values.
    Csv,
}

/// What holds the board and moves it through the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CarriedBy {
    /// A turntable.
    Table,
    /// A person.
    Hands,
}

/// One `[[step]]`: one or several poses, each with `repeat` dwells; or a turn.
#[derive(Debug, Clone)]
pub struct Step {
    /// Body direction that points up.
    pub pose: Pose,
    /// Rotation about the vertical from the body's nominal heading, rad. A person reaches it only approximately.
    pub heading: Option<f64>,
    /// Rate about the vertical during the dwell, by the outer axis, rad/s.
    pub rate: f64,
    /// Rate about the body's z axis during the dwell, by the inner axis, rad/s.
    pub spin: f64,
    /// A turn by an angle in place of the dwells.
    pub turn: Option<Turn>,
    /// Whole turns by hand before the dwell.
    pub whole: Option<WholeTurns>,
    /// Duration of a slow tumble by hand before the dwell, s.
    pub tumble_s: Option<f64>,
    /// Duration of each dwell, s; for a turn, without its ramps.
    pub dwell_s: f64,
    /// Successive dwells in each pose.
    pub repeat: u32,
    at: Places,
}

impl Step {
    /// A step that is not from a file: a pose at rest.
    pub(crate) fn commanded(up: Vector, heading: Option<f64>, dwell_s: f64) -> Self {
        Self {
            pose: Pose::Up(up),
            heading,
            rate: 0.0,
            spin: 0.0,
            turn: None,
            whole: None,
            tumble_s: None,
            dwell_s,
            repeat: 1,
            at: Places::default(),
        }
    }

    /// Number of its dwells.
    pub fn dwells(&self) -> u64 {
        let poses = match self.pose {
            Pose::Up(_) | Pose::Here => 1,
            Pose::Many(poses) => poses,
        };
        u64::from(poses) * u64::from(self.repeat)
    }
}

/// Turns by hand from where the board lies, after which it is put back there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WholeTurns {
    /// Number of turns; negative: the other direction. If it is not whole, the board is not put back where it lay.
    pub count: f64,
    /// Their axis, unit vector in the body.
    pub about: Vector,
}

/// Pose of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pose {
    /// Body direction that points up, unit vector.
    Up(Vector),
    /// This number of poses: spread evenly by a table, chosen as people do by hand.
    Many(u32),
    /// Where the previous step ended.
    Here,
}

/// Positions of an entry's values in the file.
#[derive(Debug, Clone, Default)]
struct Places {
    pose: Range<usize>,
    heading: Range<usize>,
    rate: Range<usize>,
    spin: Range<usize>,
}

/// Abilities of a table, for [`Plan::check`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Whether there is an outer (vertical) axis.
    pub outer: bool,
    /// Range of the middle axis, rad: zero with the body's z axis up.
    pub middle: [f64; 2],
    /// Highest rates of the outer and the inner axis, rad/s.
    pub rate: [f64; 2],
}

/// Sine of the angle between the inner axis and the vertical below which the two axes coincide.
pub(crate) const UPRIGHT: f64 = 1e-9;

impl Limits {
    /// Whether the middle axis reaches an angle, rad, apart from rounding.
    pub fn reaches(&self, angle: f64) -> bool {
        angle >= self.middle[0] - 1e-9 && angle <= self.middle[1] + 1e-9
    }
}

impl Plan {
    /// Reads a plan from a file.
    pub fn read(path: &Path) -> Result<Self, String> {
        Self::parse(Source::read(path)?)
    }

    /// Chamber temperature at a time (s), °C: linear between the breakpoints, constant outside, 25 °C if there are none.
    pub fn chamber_c(&self, t_s: f64) -> f64 {
        let after = self.chamber.partition_point(|[t, _]| *t <= t_s);
        match (
            after.checked_sub(1).map(|i| self.chamber[i]),
            self.chamber.get(after),
        ) {
            (Some([t0, c0]), Some([t1, c1])) => c0 + (c1 - c0) * (t_s - t0) / (t1 - t0),
            (Some([_, c]), None) | (None, Some(&[_, c])) => c,
            (None, None) => 25.0,
        }
    }

    /// Refuses steps that the table cannot carry out, in one line with the step's line and the limit.
    pub fn check(&self, limits: &Limits) -> Result<(), String> {
        for step in &self.steps {
            limits.check(step).map_err(|beyond| self.beyond(&beyond))?;
        }
        Ok(())
    }

    /// One line about a step beyond a table's limits.
    pub(crate) fn beyond(
        &self,
        Beyond {
            at,
            problem,
            remedy,
        }: &Beyond,
    ) -> String {
        self.source.error(at, problem, remedy)
    }
}

/// A step that a table cannot carry out.
#[derive(Debug, Clone)]
pub(crate) struct Beyond {
    at: Range<usize>,
    pub(crate) problem: String,
    pub(crate) remedy: &'static str,
}

impl Beyond {
    /// For the turn or the pose of a step.
    pub(crate) fn step(step: &Step, problem: String, remedy: &'static str) -> Self {
        let at = step.at.pose.clone();
        Self {
            at,
            problem,
            remedy,
        }
    }

    /// For the time from round to round.
    pub(crate) fn rounds(plan: &Plan, problem: String, remedy: &'static str) -> Self {
        let at = plan.round_at.clone();
        Self {
            at,
            problem,
            remedy,
        }
    }
}

impl Limits {
    /// Refuses a step that a table of these limits cannot carry out.
    pub(crate) fn check(&self, step: &Step) -> Result<(), Beyond> {
        let refused = |at: &Range<usize>, problem: String, remedy| {
            Err(Beyond {
                at: at.clone(),
                problem,
                remedy,
            })
        };
        if let Pose::Up(up) = step.pose {
            let (middle, _) = tilt(up);
            if !self.reaches(middle) && !self.reaches(-middle) {
                return refused(
                    &step.at.pose,
                    format!(
                        "`up` needs the middle axis at {:.1} degrees, but its range is {:.1} to {:.1}",
                        middle.to_degrees(),
                        self.middle[0].to_degrees(),
                        self.middle[1].to_degrees()
                    ),
                    "choose a pose within reach, or remount the unit",
                );
            }
            if !self.outer {
                let upright = up[0].hypot(up[1]) < UPRIGHT;
                let remedy = "use `spin_dps`, or turn the inner axis upright (`up` along z)";
                if step.rate != 0.0 && !upright {
                    let problem = "`rate_dps` is about the vertical, but the table has no vertical axis in this pose";
                    return refused(&step.at.rate, problem.into(), remedy);
                }
                if step.heading.is_some_and(|h| h != 0.0) && !upright {
                    let problem = "`heading_deg` needs an outer axis, but the table has none";
                    return refused(&step.at.heading, problem.into(), "leave it out");
                }
            }
        } else if !self.outer && step.rate != 0.0 {
            let problem = "`rate_dps` is about the vertical, but the table may have no vertical axis in this pose";
            return refused(&step.at.rate, problem.into(), "use `spin_dps`");
        }
        let (outer, inner) = if self.outer {
            (step.rate, step.spin)
        } else {
            (0.0, step.rate.abs() + step.spin.abs())
        };
        for (rate, limit, at, key) in [
            (outer, self.rate[0], &step.at.rate, "rate_dps"),
            (inner, self.rate[1], &step.at.spin, "spin_dps"),
        ] {
            if rate.abs() > limit * (1.0 + 1e-12) {
                return refused(
                    at,
                    format!(
                        "`{key}`: {} is more than the table's {}",
                        shown(rate.abs()),
                        shown(limit)
                    ),
                    "slow down",
                );
            }
        }
        Ok(())
    }
}

/// Degrees as in the plan: without the rounding errors of radians.
fn shown(angle: f64) -> f64 {
    (1e6 * angle.to_degrees()).round() / 1e6
}

/// Attitude (body into level axes) with the body direction `up` (unit vector) upright, turned by `heading`
/// (rad) about the vertical: `Rz(heading) Rx(m) Rz(i)` with up = (sin m sin i, sin m cos i, cos m), m from
/// 0 to π, and i = 0 where up is along z.
pub fn attitude(up: Vector, heading: f64) -> Rotation {
    let (middle, inner) = tilt(up);
    Rotation::about([0.0, 0.0, 1.0], heading)
        * Rotation::about([1.0, 0.0, 0.0], middle)
        * Rotation::about([0.0, 0.0, 1.0], inner)
}

/// The angles m and i of [`attitude`], rad.
pub(crate) fn tilt(up: Vector) -> (f64, f64) {
    let across = up[0].hypot(up[1]);
    let inner = if across < UPRIGHT {
        0.0
    } else {
        up[0].atan2(up[1])
    };
    (across.atan2(up[2]), inner)
}
