//! Columns of the linear problems that an experiment will pose, and what is to be seen in them.
//!
//! With a known input each sensor axis is a problem of its own, with its bias and its row of the matrix; with gravity alone the
//! three axes of an accelerometer are one, and a gyro shows its bias at rest.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::super::reach::Carrier;
use super::stop::{Stop, forms};
use super::{APART, Question, SEEN, Sought};
use crate::diagnose::candidate::Candidate;
use crate::diagnose::effect::Moment;
use crate::quantity::AXES;
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// What a dwell measures of a sensor's error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its component along one sensor axis.
    Axis(usize),
    /// Its component along gravity.
    Size,
}

/// What a column is the derivative by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// Bias of an axis.
    Bias(usize),
    /// Element of the matrix: axis, input.
    Matrix(usize, usize),
    /// Coefficient of a suspect: index of the suspect, and among its active ones.
    Coefficient(usize, usize),
    /// A suspect as a whole.
    Whole(usize),
}

/// One linear problem.
#[derive(Debug, Clone)]
pub struct Block {
    /// Sensor.
    pub sensor: Sensor,
    /// What a dwell measures of it.
    pub part: Part,
    /// Which of the values of nonlinear constants it is for.
    pub version: usize,
    /// Whether the new recording has to manage it alone: its calibration.
    pub alone: bool,
    /// Columns.
    pub columns: Vec<What>,
}

/// What has to be seen: information, the inverse of a variance, summed over one column of some blocks.
#[derive(Debug, Clone)]
pub struct Goal {
    /// Block and column.
    pub members: Vec<(usize, usize)>,
    /// Information that is enough.
    pub limit: f64,
    /// Suspect it is about; `None` for the calibration.
    pub suspect: Option<usize>,
    /// Coefficient.
    pub name: String,
}

/// All of them.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Blocks.
    pub blocks: Vec<Block>,
    /// Goals.
    pub goals: Vec<Goal>,
}

/// Information wanted of an affine parameter, in dwells at full input: that its error is at most twice what a dwell would have.
const AFFINE: f64 = 0.25;

impl Layout {
    /// Of the affine parameters of all sensors, and of those suspects that are to be in.
    pub fn new(question: &Question, has: impl Fn(usize) -> bool) -> Self {
        let mut layout = Self {
            blocks: Vec::new(),
            goals: Vec::new(),
        };
        for &sensor in &question.sensors {
            layout.calibration(question, sensor);
            let of_sensor = (0..question.suspects.len())
                .filter(|i| has(*i) && question.suspects[*i].candidate.sensor == sensor);
            let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
            for i in of_sensor {
                let group = question.suspects[i].group;
                groups.entry(group).or_default().push(i);
            }
            for own in groups.values() {
                let bends = |i: &usize| question.suspects[*i].candidate.form_range().is_some();
                let versions = if own.iter().any(bends) { 3 } else { 1 };
                for version in 0..versions {
                    layout.suspects(question, sensor, version, own);
                }
            }
        }
        layout
    }

    fn calibration(&mut self, question: &Question, sensor: Sensor) {
        for (part, columns) in affine(question, sensor) {
            let block = self.blocks.len();
            for (k, what) in columns.iter().enumerate() {
                self.goals.push(Goal {
                    members: vec![(block, k)],
                    limit: AFFINE,
                    suspect: None,
                    name: what.to_string(),
                });
            }
            self.blocks.push(Block {
                sensor,
                part,
                version: 0,
                alone: true,
                columns,
            });
        }
    }

    fn suspects(&mut self, question: &Question, sensor: Sensor, version: usize, own: &[usize]) {
        let mut whole: Vec<Vec<(usize, usize)>> = vec![Vec::new(); own.len()];
        for (part, mut columns) in affine(question, sensor) {
            let block = self.blocks.len();
            for (i, members) in own.iter().zip(&mut whole) {
                let suspect = &question.suspects[*i];
                let axes = suspect.candidate.axes();
                let here = |axis: &usize| part == Part::Size || part == Part::Axis(*axis);
                if suspect.sought == Sought::Whole {
                    if axes.iter().any(here) {
                        members.push((block, columns.len()));
                        columns.push(What::Whole(*i));
                    }
                    continue;
                }
                let names = suspect.candidate.names();
                for k in (0..axes.len()).filter(|k| here(&axes[*k])) {
                    if suspect.sought == Sought::Each {
                        self.goals.push(Goal {
                            members: vec![(block, columns.len())],
                            limit: SEEN * SEEN,
                            suspect: Some(*i),
                            name: names[k].0.clone(),
                        });
                    }
                    columns.push(What::Coefficient(*i, k));
                }
            }
            self.blocks.push(Block {
                sensor,
                part,
                version,
                alone: false,
                columns,
            });
        }
        for (i, members) in own.iter().zip(whole) {
            if !members.is_empty() {
                self.goals.push(Goal {
                    members,
                    limit: APART * APART,
                    suspect: Some(*i),
                    name: "the whole of it".into(),
                });
            }
        }
    }
}

/// The problems of a sensor with their affine columns.
fn affine(question: &Question, sensor: Sensor) -> Vec<(Part, Vec<What>)> {
    let turns = matches!(question.carrier, Carrier::ThreeAxis | Carrier::Faces);
    let each = |columns: &dyn Fn(usize) -> Vec<What>| -> Vec<(Part, Vec<What>)> {
        (0..3).map(|i| (Part::Axis(i), columns(i))).collect()
    };
    let whole = |i: usize| -> Vec<What> {
        let matrix = (0..3).map(|j| What::Matrix(i, j));
        std::iter::once(What::Bias(i)).chain(matrix).collect()
    };
    match (question.reference, sensor) {
        (Reference::Table, Sensor::Gyro) if !turns => each(&|i| vec![What::Bias(i)]),
        (Reference::Table, _) => each(&whole),
        (Reference::Gravity, Sensor::Gyro) => each(&|i| vec![What::Bias(i)]),
        (Reference::Gravity, Sensor::Accel) => {
            let lower = (0..3).flat_map(|i| (0..=i).map(move |j| What::Matrix(i, j)));
            let biases = (0..3).map(What::Bias);
            vec![(Part::Size, lower.chain(biases).collect())]
        }
    }
}

impl Block {
    /// Row of a stop: SI per unit of the parameters.
    pub fn row(&self, question: &Question, stop: &Stop, row: &mut Vec<f64>) {
        let up = stop.setting.up;
        for what in &self.columns {
            let error = self.error(question, stop, *what);
            row.push(match self.part {
                Part::Axis(i) => error[i],
                Part::Size => up.dot(&error),
            });
        }
    }

    /// Error of the three sensor axes that a unit of `what` makes at a stop.
    fn error(&self, question: &Question, stop: &Stop, what: What) -> Vector3<f64> {
        match what {
            What::Bias(_) | What::Matrix(..) => {
                affine_error(self.sensor, what, &stop.moment(self.sensor, None))
            }
            What::Coefficient(i, k) => {
                let suspect = &question.suspects[i].candidate;
                let values = self.regressors(suspect, stop);
                Vector3::ith(suspect.axes()[k], values[k])
            }
            What::Whole(i) => {
                let suspect = &question.suspects[i];
                let values = self.regressors(&suspect.candidate, stop);
                let axes = suspect.candidate.axes();
                let each =
                    (0..axes.len()).map(|k| Vector3::ith(axes[k], values[k] * suspect.sizes[k]));
                each.sum()
            }
        }
    }

    /// Nonlinear constant of a suspect in this block.
    pub fn form(&self, candidate: &Candidate) -> f64 {
        forms(candidate)[self.version]
    }

    fn regressors(&self, candidate: &Candidate, stop: &Stop) -> Vec<f64> {
        let form = self.form(candidate);
        let moment = stop.moment(self.sensor, candidate.lag_s(form));
        let mut out = vec![0.0; candidate.active.len()];
        candidate.regressors(&moment, form, &mut out);
        out
    }
}

/// Error of the three sensor axes that a unit of an affine parameter makes.
pub(super) fn affine_error(sensor: Sensor, what: What, at: &Moment) -> Vector3<f64> {
    let input = match sensor {
        Sensor::Gyro => at.rate,
        Sensor::Accel => at.force,
    };
    match what {
        What::Bias(i) => Vector3::ith(i, 1.0),
        What::Matrix(i, j) => Vector3::ith(i, input[j]),
        What::Coefficient(..) | What::Whole(..) => Vector3::zeros(),
    }
}

impl std::fmt::Display for What {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bias(i) => write!(f, "b_{}", AXES[*i]),
            Self::Matrix(i, j) => write!(f, "P_{}{}", AXES[*i], AXES[*j]),
            Self::Coefficient(i, k) => write!(f, "coefficient {k} of suspect {i}"),
            Self::Whole(i) => write!(f, "suspect {i}"),
        }
    }
}
