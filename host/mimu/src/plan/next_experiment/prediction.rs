//! What an experiment will show of an effect: the sigma of each coefficient, from the information of its dwells.

use nalgebra::{DVector, Vector3};

use super::Setup;
use super::recipe::Experiment;
use crate::effects;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::{Effect, NonlinearParameter};
use crate::effects::quantity::Conditions;
use crate::observation::{ByTriad, LOWER, slope};
use crate::plan::design::information::{Inverse, Rows};
use crate::quantity::Sensor;
use crate::readable::STANDARD_GRAVITY;
use mimu_recording::Reference;

/// Sigmas at which a coefficient of its typical size is to be seen. A diagnosis tests from 3 on, which chance exceeds once in 400. At 5
/// it finds the effect in 98 of 100 recordings even if only one coefficient differs from zero, because its estimate then rarely falls
/// below 5 - 2 sigmas.
pub const SEEN: f64 = 5.0;
/// Square root of the deviance by which one of two effects is to be better. A diagnosis calls two confused below a difference of 12. The
/// standard deviation of the difference is twice its square root, and 36 is two of these above 12: 36 - 2 · 2 · 6.
pub const APART: f64 = 6.0;

/// What an experiment is to show.
#[derive(Debug, Clone)]
pub struct Target {
    /// The effect.
    pub candidate: Candidate,
    /// Sizes of its active coefficients, SI: those of data sheets, or those that were found.
    pub sizes: Vec<f64>,
    /// Whether each coefficient is to be seen; otherwise the effect, as found, is to be distinguished from `rivals`.
    pub each: bool,
    /// Effects that it must not be mistaken for, one at a time.
    pub rivals: Vec<Candidate>,
}

/// What is predicted for a target.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Name of the effect.
    pub id: String,
    /// Sigma over size of the coefficient that is seen worst, or of the whole effect beside its rivals; infinite if it is not
    /// determined.
    pub share: f64,
    /// The share that is enough.
    pub wanted: f64,
    /// Name, unit and sigma of each coefficient in it.
    pub coefficients: Vec<(String, String, f64)>,
}

impl Prediction {
    /// Whether it is enough.
    pub fn done(&self) -> bool {
        self.share <= self.wanted
    }
}

impl Target {
    /// A listed effect, each coefficient at its typical size, beside the affine parameters and any one rival. Rivals are the other listed
    /// effects of the sensor: those of time or temperature if it depends on these, else those that depend on neither.
    ///
    /// Earth rate, which is not an error, is no rival and has none: at rest it equals a g-sensitivity, and only another latitude
    /// distinguishes them.
    pub fn listed(effect: &'static Effect) -> Self {
        let candidate =
            apart_from_bias(Candidate::new(effect.sensor, CandidateKind::Effect(effect)));
        let others = effects::all().filter(|e| e.sensor == effect.sensor && e.id != effect.id);
        let rivals = others.map(|e| Candidate::new(e.sensor, CandidateKind::Effect(e)));
        let slow = candidate.is_slow();
        Self {
            sizes: candidate
                .active
                .iter()
                .map(|k| effect.coefficients[*k].typical)
                .collect(),
            rivals: rivals
                .filter(|r| effect.is_error() && r.is_error())
                .filter(|r| r.is_slow() == slow)
                .collect(),
            candidate,
            each: true,
        }
    }

    /// Whether it depends on time or temperature, so that only their course shows it.
    pub fn is_slow(&self) -> bool {
        self.candidate.is_slow() || (!self.each && self.rivals.iter().any(Candidate::is_slow))
    }

    /// What `experiment` will show of it.
    pub fn predicted(&self, setup: &Setup, experiment: &Experiment) -> Prediction {
        let count = self.sizes.len();
        let mut sigmas = vec![0.0_f64; count];
        let mut whole = 0.0_f64;
        for parameter in quarters(&self.candidate) {
            let own = Columns::of(setup, experiment, &self.candidate, parameter);
            let alone = if self.each { 1 } else { 0 };
            let beside = self.rivals.iter().map(Some);
            for rival in std::iter::repeat_n(None, alone).chain(beside) {
                let rival = rival.map(|r| Columns::of(setup, experiment, r, quarters(r)[1]));
                if self.each {
                    let found = own.sigmas(rival.as_ref());
                    sigmas
                        .iter_mut()
                        .zip(found)
                        .for_each(|(s, f)| *s = s.max(f));
                } else {
                    whole = whole.max(own.whole(&self.sizes).sigmas(rival.as_ref())[0]);
                }
            }
        }
        let names = self.candidate.names().into_iter().zip(&sigmas);
        let shares = sigmas
            .iter()
            .zip(&self.sizes)
            .map(|(s, size)| s / size.abs());
        let wanted = if self.each { SEEN } else { APART };
        Prediction {
            id: self.candidate.id(),
            share: if self.each {
                shares.fold(0.0, f64::max)
            } else {
                whole
            },
            // Allows for rounding of the inverse.
            wanted: (1.0 + 1e-9) / wanted,
            coefficients: match self.each {
                true => names.map(|((name, unit), s)| (name, unit, *s)).collect(),
                false => Vec::new(),
            },
        }
    }
}

/// The candidate without the coefficients that no attitude, rate, temperature or time distinguishes from a bias and from the coefficients
/// before: in gravity the squares of the force along three axes add up to a constant.
fn apart_from_bias(mut candidate: Candidate) -> Candidate {
    let parameter = quarters(&candidate)[1];
    let slots = candidate.slots();
    let mut values = vec![0.0; slots.len()];
    let mut columns = vec![DVector::zeros(STATES); slots.len()];
    for k in 0..STATES {
        // States spread evenly and independently of each other: multiples of irrational numbers.
        let even = |by: f64| 2.0 * (k as f64 * by).fract() - 1.0;
        let (z, turn) = (even(0.618_034), std::f64::consts::PI * even(0.414_214));
        let across = (1.0 - z * z).sqrt();
        let force = STANDARD_GRAVITY * Vector3::new(across * turn.cos(), across * turn.sin(), z);
        let rate = Vector3::new(even(0.732_051), even(0.236_068), even(0.645_751));
        let time_s = 1000.0 * (1.0 + even(0.302_776));
        let at = Conditions {
            session: 0,
            t_s: time_s,
            on_s: time_s,
            from_middle_s: time_s,
            duration_s: 1.0,
            rate,
            force,
            angular_acceleration: Vector3::zeros(),
            sensed: candidate.sensor.pick(rate, force),
            temperature_offset: 20.0 * even(0.316_625),
            lagged_temperature: 20.0 * even(0.872_983),
        };
        candidate.regressors(&at, parameter, &mut values);
        for (column, value) in columns.iter_mut().zip(&values) {
            column[k] = *value;
        }
    }
    let bias = DVector::repeat(STATES, 1.0).normalize();
    let mut spanned: [Vec<DVector<f64>>; 3] = std::array::from_fn(|_| vec![bias.clone()]);
    let mut kept: Vec<bool> = vec![false; candidate.active.len()];
    for ((coefficient, axis), column) in slots.into_iter().zip(columns) {
        let left = outside(&spanned[axis], column.clone());
        // Less is rounding. A column of zeros needs other conditions than these, and is not judged here.
        if left.norm() > 1e-9 * column.norm() || column.norm() == 0.0 {
            kept[coefficient] = true;
            spanned[axis].extend(left.try_normalize(0.0));
        }
    }
    let mut keep = kept.into_iter();
    candidate.active.retain(|_| keep.next().unwrap_or(true));
    candidate
}

/// Number of states at which coefficients are distinguished: more than any axis has coefficients.
const STATES: usize = 64;

/// Values of its nonlinear parameter that an experiment has to be good for: the quarters of its range, in the logarithm.
fn quarters(candidate: &Candidate) -> [f64; 3] {
    match candidate.parameter() {
        Some(NonlinearParameter { from, to, .. }) => {
            [0.25, 0.5, 0.75].map(|share| from * (to / from).powf(share))
        }
        None => [0.0; 3],
    }
}

/// One linear problem of a sensor: what its dwells measure of an error of its three axes, and the affine parameters in it.
struct Problem {
    /// What each dwell measures, SI per SI of the error.
    measured: Vec<Vector3<f64>>,
    /// Orthonormal basis of the affine parameters' columns.
    affine: Vec<DVector<f64>>,
    /// Whether all affine parameters are determined.
    calibrates: bool,
}

/// The problems of a sensor. With a known input there is one for each axis, with its bias and its row of the matrix. If only the
/// magnitude of gravity is known, the three axes of an accelerometer are one problem, and a gyro shows its biases at rest.
fn problems(setup: &Setup, sensor: Sensor, states: &[Conditions]) -> Vec<Problem> {
    let input = |at: &Conditions| sensor.pick(at.rate, at.force);
    let problem = |measured: Vec<Vector3<f64>>, parameters: &[usize]| {
        let mut affine = Vec::new();
        let each = states.iter().zip(&measured);
        let by: Vec<ByTriad> = each.map(|(at, along)| slope(along, &input(at))).collect();
        for parameter in parameters {
            let column = by.iter().map(|by| by[*parameter]);
            extend(&mut affine, DVector::from_iterator(by.len(), column));
        }
        Problem {
            calibrates: affine.len() == parameters.len(),
            measured,
            affine,
        }
    };
    let matrix = sensor == Sensor::Accel || setup.turns();
    if setup.reference == Reference::Gravity && sensor == Sensor::Accel {
        let up = states.iter().map(|at| at.force.normalize()).collect();
        return vec![problem(up, &LOWER)];
    }
    let each = (0..3).map(|i| {
        let row = (0..3).filter(|_| matrix).map(|j| 3 * i + j);
        let all: Vec<usize> = std::iter::once(9 + i).chain(row).collect();
        problem(vec![Vector3::ith(i, 1.0); states.len()], &all)
    });
    each.collect()
}

/// Whether an experiment alone determines the calibration of every sensor.
pub fn calibrates(setup: &Setup, experiment: &Experiment) -> bool {
    setup.sensors.iter().all(|sensor| {
        let states = experiment.states(*sensor, None);
        problems(setup, *sensor, &states)
            .iter()
            .all(|p| p.calibrates)
    })
}

/// An effect in the problems of its sensor.
struct Columns {
    problems: Vec<InProblem>,
}

/// An effect in one problem.
struct InProblem {
    /// Basis of the affine parameters.
    affine: Vec<DVector<f64>>,
    /// Column of each coefficient, over the sigma of a dwell's mean.
    coefficients: Vec<DVector<f64>>,
}

impl Columns {
    fn of(setup: &Setup, experiment: &Experiment, candidate: &Candidate, parameter: f64) -> Self {
        let sensor = candidate.sensor;
        let states = experiment.states(sensor, candidate.lag_s(parameter));
        let slots = candidate.slots();
        let regressors = states.iter().map(|at| {
            let mut out = vec![0.0; slots.len()];
            candidate.regressors(at, parameter, &mut out);
            out
        });
        let regressors: Vec<Vec<f64>> = regressors.collect();
        let sigma = setup.noise_of(sensor).sigma(experiment.dwell_s);
        let each = problems(setup, sensor, &states).into_iter().map(|p| {
            let zeros = DVector::<f64>::zeros(states.len());
            let mut columns = vec![zeros; candidate.active.len()];
            for (slot, (coefficient, axis)) in slots.iter().enumerate() {
                for (i, values) in regressors.iter().enumerate() {
                    columns[*coefficient][i] += p.measured[i][*axis] * values[slot] / sigma;
                }
            }
            // No dwell can be planned for a converter's codes: their columns are NaN here, and count as not excited.
            for column in &mut columns {
                if !column.iter().all(|v| v.is_finite()) {
                    column.fill(0.0);
                }
            }
            InProblem {
                affine: p.affine,
                coefficients: columns,
            }
        });
        Self {
            problems: each.collect(),
        }
    }

    /// All coefficients as one, at these sizes.
    fn whole(&self, sizes: &[f64]) -> Self {
        let sum = |columns: &[DVector<f64>]| {
            let mut sum = DVector::zeros(columns[0].len());
            for (column, size) in columns.iter().zip(sizes) {
                sum.axpy(*size, column, 1.0);
            }
            sum
        };
        let each = self.problems.iter().map(|p| InProblem {
            affine: p.affine.clone(),
            coefficients: vec![sum(&p.coefficients)],
        });
        Self {
            problems: each.collect(),
        }
    }

    /// Sigma of each coefficient beside the affine parameters and a rival, if there is one, as far as the rival is seen itself; infinite
    /// if it is not determined.
    fn sigmas(&self, rival: Option<&Self>) -> Vec<f64> {
        let count = self.problems[0].coefficients.len();
        let mut information = vec![0.0; count];
        for (p, own) in self.problems.iter().enumerate() {
            let columns = &own.coefficients;
            let mut basis = own.affine.clone();
            for column in rival.iter().flat_map(|r| &r.problems[p].coefficients) {
                extend(&mut basis, column.clone());
            }
            let seen: Vec<(usize, DVector<f64>)> = columns
                .iter()
                .enumerate()
                .map(|(k, c)| (k, c.norm_squared(), outside(&basis, c.clone())))
                .filter(|(_, all, rest)| rest.norm_squared() > ALIASED * all)
                .map(|(k, _, rest)| (k, rest))
                .collect();
            if seen.is_empty() {
                continue;
            }
            let mut rows = Rows::new(seen.len());
            let n = columns[0].len();
            for i in 0..n {
                rows.push(&seen.iter().map(|(_, c)| c[i]).collect::<Vec<f64>>());
            }
            if let Some(inverse) = Inverse::of_all(&rows) {
                for (at, (k, _)) in seen.iter().enumerate() {
                    information[*k] += 1.0 / inverse.matrix()[(at, at)];
                }
            }
        }
        information
            .into_iter()
            .map(|i: f64| i.sqrt().recip())
            .collect()
    }
}

/// Share of a column (squared) outside of others below which it is one of their sums.
const ALIASED: f64 = 1e-9;

/// Part of `column` outside an orthonormal basis. Projected twice: the first projection leaves rounding.
fn outside(basis: &[DVector<f64>], mut column: DVector<f64>) -> DVector<f64> {
    for _ in 0..2 {
        for unit in basis {
            column -= unit * unit.dot(&column);
        }
    }
    column
}

/// Adds the direction of `column` to an orthonormal basis, if it is a new one.
fn extend(basis: &mut Vec<DVector<f64>>, column: DVector<f64>) {
    let size = column.norm_squared();
    let rest = outside(basis, column);
    if rest.norm_squared() > ALIASED * size {
        basis.push(rest.normalize());
    }
}
