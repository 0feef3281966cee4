//! The relation of a further triad to its reference, found by least squares over pieces of time.

use mimu::triad::{Estimate, Part, affine, half_width_95};
use mimu_core::compensation::Affine;
use nalgebra::DVector;

use crate::clustered::{Clusters, Solution};
use crate::errors::Errors;
use crate::pieces::{Groups, Pieces};

/// The first parameters of every kind: C by rows, o, delay (s).
pub(crate) const DELAY: usize = 12;
/// Most steps, and the change of the delay (s) and of C, o (relative) at which they end.
const STEPS: usize = 30;
const SETTLED_S: f64 = 1e-7;
const SETTLED: f64 = 1e-9;
/// Longest step of the delay, s: beyond a fifth of a second's motion the difference of two readings says little.
const LONGEST_STEP_S: f64 = 0.03;
/// How often pieces that the rest contradicts are looked for.
const ROUNDS: usize = 6;

/// What the readings of a triad and of its reference have to fulfil.
pub(crate) trait Equations {
    /// Standard deviations of what is known of the parameters beforehand, around zero; infinite for nothing.
    fn known(&self) -> DVector<f64>;

    /// Pieces of time.
    fn pieces(&self) -> &Pieces;

    /// Adds residuals at these parameters, with their derivatives, and counts the scatter of those in pieces that are `used`.
    fn add_to(
        &self,
        clusters: &mut Clusters,
        at: &DVector<f64>,
        groups: &mut Groups,
        used: &[bool],
    );

    /// Errors in sample at these parameters, over the pieces that are `used`. `None` if there is nothing to compare.
    fn errors(&self, at: &DVector<f64>, used: &[bool]) -> Option<Errors>;

    /// Sums over the residuals, by pieces of time.
    fn clusters(&self, at: &DVector<f64>, groups: &mut Groups, used: &[bool]) -> Clusters {
        let mut clusters = Clusters::new(self.pieces().count, at, &self.known());
        groups.begin();
        self.add_to(&mut clusters, at, groups, used);
        groups.end();
        clusters
    }
}

/// A further triad against its reference.
pub(crate) struct Relation {
    /// All parameters.
    pub at: DVector<f64>,
    /// The last solution, with their covariance.
    pub solution: Solution,
    /// Scatter of the groups of residuals.
    pub groups: Groups,
    /// Pieces that the rest does not contradict.
    pub used: Vec<bool>,
    /// Errors, SI or in the unit of the field.
    pub errors: Errors,
    /// Times of the pieces that are left out, s.
    pub left_out: Vec<[f64; 2]>,
    known: DVector<f64>,
}

impl Relation {
    /// Solves `equations` from `at` on, and leaves out pieces of time that the rest contradicts. `None` if they do not determine the parameters.
    pub fn of(equations: &impl Equations, mut at: DVector<f64>) -> Option<Self> {
        let mut groups = Groups::default();
        let mut used = vec![true; equations.pieces().count];
        let mut solution = settled(equations, &mut at, &mut groups, &used)?;
        for _ in 1..ROUNDS {
            let next = equations.pieces().kept(&solution.held_out);
            if next == used {
                break;
            }
            used = next;
            solution = settled(equations, &mut at, &mut groups, &used)?;
        }
        let mut errors = equations.errors(&at, &used)?;
        errors.held_out_rms *= solution.unseen(&used);
        Some(Self {
            known: equations.known(),
            left_out: equations.pieces().spans(&used),
            errors,
            at,
            solution,
            groups,
            used,
        })
    }

    /// C and o, raw to SI or the unit of the field, in the frame of the reference.
    pub fn calibration(&self) -> Affine<f64> {
        affine(&self.at.fixed_rows::<12>(0).into_owned())
    }

    /// The part of the covariance of C and o.
    pub fn part(&self) -> Part {
        let own = self.solution.covariance.fixed_view::<12, 12>(0, 0);
        Part {
            covariance: own.into_owned(),
            dof: self.solution.dof,
            known: 0.0,
        }
    }

    /// A parameter with its interval, in units of which SI has `scale`.
    pub fn estimate(&self, parameter: usize, scale: f64) -> Estimate {
        let variance = self.solution.covariance[(parameter, parameter)];
        let variance = variance.max(0.0) * scale * scale;
        Estimate {
            value: self.at[parameter] * scale,
            sigma: variance.sqrt(),
            interval: half_width_95([(variance, self.solution.dof)].into_iter()),
        }
    }

    /// Share of what was known of a parameter beforehand that it still has as its standard deviation.
    pub fn undetermined(&self, parameter: usize) -> f64 {
        self.solution.by_weights[(parameter, parameter)].sqrt() / self.known[parameter]
    }
}

/// Steps until delay, calibration and weights stand still; returns the last solution, whose step is then nearly zero.
fn settled(
    equations: &impl Equations,
    at: &mut DVector<f64>,
    groups: &mut Groups,
    used: &[bool],
) -> Option<Solution> {
    let mut last = None;
    for _ in 0..STEPS {
        let solution = equations.clusters(at, groups, used).solve(used)?;
        let mut step = solution.step.clone();
        let longest = step[DELAY].abs() / LONGEST_STEP_S;
        if longest > 1.0 {
            step /= longest;
        }
        *at += &step;
        let change = step.fixed_rows::<12>(0).norm() / at.fixed_rows::<12>(0).norm();
        last = Some(solution);
        if step[DELAY].abs() < SETTLED_S && change < SETTLED && groups.are_settled() {
            break;
        }
    }
    last
}
