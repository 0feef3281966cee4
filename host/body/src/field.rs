//! Magnetometers: the Earth's field keeps its size and its direction in space while the body turns.
//!
//! For the calibrated field `x = C u + o` in the frame of the body, soft iron in C and hard iron in o, three things hold. Its size is one constant. After a
//! turn by R, as the gyro integrates it, it is `Rᵀ x`: this gives the rotation of the magnetometer on the body, and its delay. At rest its angle to
//! gravity is one constant, the dip. An ellipsoid alone, the usual calibration, is the first of these: it leaves a rotation open, and a field that differs by place bends it
//! unnoticed, where the turns contradict it.

use mimu::triad::{Part, affine, vector};
use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use crate::carrier::Rest;
use crate::clustered::{Clusters, Solution};
use crate::errors::Errors;
use crate::pieces::{Groups, Pieces};
use crate::series::{Motion, Series};
use crate::standing::Standing;

/// Time between two readings that are compared, s: long enough to turn far, and short enough that a gyro's bias of 0.1 deg/s is a tenth of a degree.
pub(crate) const TURN_S: f64 = 1.0;
/// Least time between readings that are used, s; more of them see the same.
const APART_S: f64 = 0.04;
/// A smaller turn tells nothing, rad.
const LEAST_TURN: f64 = 0.05;
/// What is known of a delay beforehand, standard deviation, s.
const DELAY_S: f64 = 0.1;
/// Step of the derivative by the delay, s.
const DELAY_STEP_S: f64 = 1e-3;
const STEPS: usize = 30;
const SETTLED_S: f64 = 1e-6;
const LONGEST_STEP_S: f64 = 0.05;

/// Parameters: C by rows, o, delay (s), sine of the dip, and what remains of the gyro's bias (rad/s).
const DELAY: usize = 12;
const DIP: usize = 13;
const BIAS: usize = 14;
const COUNT: usize = 17;
/// Groups of residuals.
const TURNS: usize = 0;
const SIZES: usize = 1;
const DIPS: usize = 2;

/// A calibrated magnetometer.
pub(crate) struct Field {
    /// C and o, raw to the unit of `size`, in the frame of the body.
    pub calibration: Affine<f64>,
    /// Covariance of all parameters by the jackknife, and its degrees of freedom.
    pub covariance: DMatrix<f64>,
    pub dof: f64,
    /// Delay behind the gyro, s, and sine of the dip.
    pub delay_s: f64,
    pub dip_sine: f64,
    /// Share of what was known beforehand that the delay still has as its standard deviation.
    pub delay_undetermined: f64,
    /// Number of rests that show the dip.
    pub rests: usize,
    /// Errors of an axis after a turn, in the unit of the field.
    pub errors: Errors,
    /// Rms error of its size, in the same unit: what differs by place changes little during a turn, and shows here.
    pub size_rms: f64,
    pub left_out: Vec<[f64; 2]>,
    /// Share of the pieces of time that is left out.
    pub left_out_share: f64,
    /// By how much the field differs between the calibrations of the two halves of the recording, rms, rad.
    pub halves_rad: f64,
    /// Worst standard deviation of the field's direction, over all poses, rad.
    pub worst_rad: f64,
}

struct Problem<'a> {
    motion: &'a Motion,
    raw: Series,
    /// Samples that are used.
    used: Vec<usize>,
    /// Pairs of samples that a turn lies between.
    pairs: Vec<[usize; 2]>,
    /// Mean readings of rests, with up and time.
    rests: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
    pieces: Pieces,
    size: f64,
    /// Standard deviation of what remains of the gyro's bias, rad/s.
    bias: f64,
    /// Variance of a raw reading by white noise.
    noise: f64,
}

impl Field {
    /// Of raw readings. `size`: that of the field, in the unit of the result; `bias`: standard deviation of what remains of the gyro's, rad/s. `None` if too
    /// little of it turns.
    pub fn of(raw: Series, motion: &Motion, rests: &[Rest], size: f64, bias: f64) -> Option<Self> {
        let problem = Problem::new(raw, motion, rests, size, bias)?;
        let mut at = problem.start()?;
        let mut groups = Groups::default();
        let mut used = vec![true; problem.pieces.count];
        let mut solution = None;
        for round in 0..6 {
            solution = Some(problem.settle(&mut at, &mut groups, &used)?);
            let held = &solution.as_ref()?.held_out;
            let next = problem.pieces.kept(held);
            if round == 5 || next == used {
                break;
            }
            used = next;
        }
        problem.field(&at, &solution?, &mut groups, &used)
    }

    /// Errors of a magnetometer that stands so; the rms error of the size of the field, and that size: `size`, or else the mean that it reads. `None` if nothing
    /// turns.
    pub fn errors(
        raw: Series,
        motion: &Motion,
        standing: &Standing,
        size: Option<f64>,
    ) -> Option<(Errors, [f64; 2])> {
        let raw = raw.without_repeats();
        let sizes = raw.x.iter().map(|u| standing.calibration.apply(u).norm());
        let size = size.unwrap_or(sizes.sum::<f64>() / raw.len() as f64);
        let problem = Problem::new(raw, motion, &[], size, 1e-9)?;
        let mut at = DVector::zeros(COUNT);
        let Affine { matrix, offset } = standing.calibration;
        at.fixed_rows_mut::<12>(0)
            .copy_from(&vector(&matrix, &offset));
        at[DELAY] = standing.delay_s;
        let all = vec![true; problem.pieces.count];
        let errors = problem.errors(&at, &all)?;
        Some((
            errors,
            [problem.size_rms(&standing.calibration, &all), size],
        ))
    }

    /// The part of the covariance of C and o.
    pub fn part(&self) -> Part {
        Part {
            covariance: self.covariance.fixed_view::<12, 12>(0, 0).into_owned(),
            dof: self.dof,
            known: 0.0,
        }
    }
}

/// Derivatives of `C u + o` by C (rows) and o.
fn by_calibration(u: &Vector3<f64>) -> SMatrix<f64, 3, 12> {
    let mut by = SMatrix::zeros();
    for axis in 0..3 {
        for k in 0..3 {
            by[(axis, 3 * axis + k)] = u[k];
        }
        by[(axis, 9 + axis)] = 1.0;
    }
    by
}

impl<'a> Problem<'a> {
    fn new(raw: Series, motion: &'a Motion, rests: &[Rest], size: f64, bias: f64) -> Option<Self> {
        let pieces = Pieces::over(&raw.t)?;
        let mut used: Vec<usize> = Vec::new();
        for (k, t) in raw.t.iter().enumerate() {
            if used.last().is_none_or(|last| t - raw.t[*last] >= APART_S) {
                used.push(k);
            }
        }
        let mut pairs = Vec::new();
        for (n, &from) in used.iter().enumerate() {
            let later = used[n..].partition_point(|k| raw.t[*k] - raw.t[from] < TURN_S);
            let Some(&to) = used.get(n + later) else {
                break;
            };
            let near = raw.t[to] - raw.t[from] < 1.5 * TURN_S;
            let turn = motion.turn(raw.t[from], raw.t[to]);
            if near && turn.is_some_and(|turn| turn.angle() > LEAST_TURN) {
                pairs.push([from, to]);
            }
        }
        let mean = |rest: &Rest| {
            let from = raw.t.partition_point(|t| *t < rest.from_s);
            let to = raw.t.partition_point(|t| *t <= rest.to_s);
            let own = raw.x.get(from..to).filter(|own| !own.is_empty())?;
            let mean = own.iter().sum::<Vector3<f64>>() / own.len() as f64;
            Some((mean, rest.up, 0.5 * (rest.from_s + rest.to_s)))
        };
        Some(Self {
            rests: rests.iter().filter_map(mean).collect(),
            noise: raw.noise(),
            bias,
            motion,
            used,
            pairs,
            pieces,
            size,
            raw,
        })
    }

    /// C and o by the turns alone, which are linear in them but for a common factor; sizes give it. The axes are taken to be right-handed: turns and sizes
    /// hold for the opposite field too.
    fn start(&self) -> Option<DVector<f64>> {
        let count = self.used.len() as f64;
        let mean = self
            .used
            .iter()
            .map(|k| self.raw.x[*k])
            .sum::<Vector3<f64>>()
            / count;
        let squares = self
            .used
            .iter()
            .map(|k| (self.raw.x[*k] - mean).norm_squared());
        let scale = (squares.sum::<f64>() / count / 3.0).sqrt();
        if !(scale > 0.0) || self.pairs.len() < COUNT {
            return None;
        }
        let u = |k: usize| (self.raw.x[k] - mean) / scale;
        let mut normal = SMatrix::<f64, 12, 12>::zeros();
        for [from, to] in &self.pairs {
            let turn = self.motion.turn(self.raw.t[*from], self.raw.t[*to])?;
            let by = by_calibration(&u(*to))
                - turn.to_rotation_matrix().matrix() * by_calibration(&u(*from));
            normal += by.transpose() * by;
        }
        let eigen = normal.symmetric_eigen();
        let least = eigen.eigenvalues.imin();
        let found = affine(&eigen.eigenvectors.column(least).into_owned());
        let sizes = self.used.iter().map(|k| found.apply(&u(*k)).norm());
        let factor = self.size / (sizes.sum::<f64>() / count) * found.matrix.determinant().signum();
        let matrix = found.matrix * factor / scale;
        let offset = found.offset * factor - matrix * mean;
        let mut at = DVector::zeros(COUNT);
        for k in 0..9 {
            at[k] = matrix[(k / 3, k % 3)];
        }
        at.fixed_rows_mut::<3>(9).copy_from(&offset);
        let calibration = Affine { matrix, offset };
        let sines = self
            .rests
            .iter()
            .map(|(u, up, _)| -up.dot(&calibration.apply(u)) / self.size);
        at[DIP] = sines.sum::<f64>() / self.rests.len().max(1) as f64;
        at.iter().all(|x| x.is_finite()).then_some(at)
    }

    /// Residual after a turn, and its derivatives, an axis each.
    fn turn(
        &self,
        [from, to]: [usize; 2],
        at: &DVector<f64>,
    ) -> Option<(Vector3<f64>, DMatrix<f64>)> {
        let calibration = affine(&at.fixed_rows::<12>(0).into_owned());
        let between = |delay: f64| {
            let turn = self
                .motion
                .turn(self.raw.t[from] - delay, self.raw.t[to] - delay)?;
            Some(*turn.to_rotation_matrix().matrix())
        };
        let [t0, t1] = [from, to].map(|k| self.raw.t[k] - at[DELAY]);
        let whole = self.motion.turn(t0, t1)?;
        let turn: Matrix3<f64> = *whole.to_rotation_matrix().matrix();
        let later = between(at[DELAY] + DELAY_STEP_S)? - between(at[DELAY] - DELAY_STEP_S)?;
        let [x0, x1] = [from, to].map(|k| calibration.apply(&self.raw.x[k]));
        let mut by = DMatrix::zeros(3, COUNT);
        let by_own = by_calibration(&self.raw.x[to]) - turn * by_calibration(&self.raw.x[from]);
        by.fixed_view_mut::<3, 12>(0, 0).copy_from(&by_own);
        by.column_mut(DELAY)
            .copy_from(&(-(later * x0) / (2.0 * DELAY_STEP_S)));
        // A rate that reads more has turned the field back too far: by the bias, as seen from the middle of the turn.
        let seen = turn * x0;
        let middle: Matrix3<f64> = *whole.powf(0.5).to_rotation_matrix().matrix();
        let by_bias = (t1 - t0) * seen.cross_matrix() * middle;
        by.fixed_view_mut::<3, 3>(0, BIAS).copy_from(&by_bias);
        let bias = at.fixed_rows::<3>(BIAS).into_owned();
        Some((seen - by_bias * bias - x1, by))
    }

    fn settle(
        &self,
        at: &mut DVector<f64>,
        groups: &mut Groups,
        used: &[bool],
    ) -> Option<Solution> {
        let mut last = None;
        for _ in 0..STEPS {
            let solution = self.clusters(at, groups, used).solve(used)?;
            let mut step = solution.step.clone();
            let longest = step[DELAY].abs() / LONGEST_STEP_S;
            if longest > 1.0 {
                step /= longest;
            }
            *at += &step;
            let change = step.fixed_rows::<12>(0).norm() / at.fixed_rows::<12>(0).norm();
            last = Some(solution);
            if step[DELAY].abs() < SETTLED_S && change < 1e-9 && groups.are_settled() {
                break;
            }
        }
        last
    }

    /// Residuals of turns, sizes and dips at these parameters. Readings stand on both sides of a turn, and their noise makes C smaller than it is, by the square
    /// of noise over field; what it adds to the gradient is known and taken out again.
    fn clusters(&self, at: &DVector<f64>, groups: &mut Groups, used: &[bool]) -> Clusters {
        let mut known = DVector::repeat(COUNT, f64::INFINITY);
        known[DELAY] = DELAY_S;
        known[DIP] = 1.0;
        known.fixed_rows_mut::<3>(BIAS).fill(self.bias);
        let mut clusters = Clusters::new(self.pieces.count, at, &DVector::zeros(COUNT), &known);
        let calibration = affine(&at.fixed_rows::<12>(0).into_owned());
        groups.begin();
        for pair in &self.pairs {
            let Some((residual, by)) = self.turn(*pair, at) else {
                continue;
            };
            let piece = self.pieces.of(self.raw.t[pair[0]]);
            if used[piece] {
                groups.count(TURNS, residual.norm_squared(), 3.0);
            }
            let weight = groups.weight(TURNS);
            for axis in 0..3 {
                clusters.add(piece, residual[axis], &by.row(axis).transpose(), weight);
            }
            clusters.correct(
                piece,
                &of_matrix(&(2.0 * weight * self.noise * calibration.matrix)),
            );
        }
        let shift = self.noise * calibration.matrix.norm_squared() / 3.0 / self.size;
        for &k in &self.used {
            let x = calibration.apply(&self.raw.x[k]);
            let along = x.normalize();
            let mut by = DVector::zeros(COUNT);
            by.fixed_rows_mut::<12>(0)
                .copy_from(&(by_calibration(&self.raw.x[k]).transpose() * along));
            let residual = self.size + shift - x.norm();
            let piece = self.pieces.of(self.raw.t[k]);
            if used[piece] {
                groups.count(SIZES, residual * residual, 1.0);
            }
            let weight = groups.weight(SIZES);
            clusters.add(piece, residual, &by, weight);
            let own = weight * self.noise * along * along.transpose() * calibration.matrix;
            clusters.correct(piece, &of_matrix(&own));
        }
        for (u, up, t) in &self.rests {
            let mut by = DVector::zeros(COUNT);
            by.fixed_rows_mut::<12>(0)
                .copy_from(&(by_calibration(u).transpose() * up));
            by[DIP] = self.size;
            let residual = -self.size * at[DIP] - up.dot(&calibration.apply(u));
            let piece = self.pieces.of(*t);
            if used[piece] {
                groups.count(DIPS, residual * residual, 1.0);
            }
            clusters.add(piece, residual, &by, groups.weight(DIPS));
        }
        groups.end();
        clusters
    }

    /// Errors in sample at these parameters, over the pieces of time that are `used`. `None` without a turn.
    fn errors(&self, at: &DVector<f64>, used: &[bool]) -> Option<Errors> {
        let calibration = affine(&at.fixed_rows::<12>(0).into_owned());
        let per_axis = self.noise * calibration.matrix.norm_squared() / 3.0;
        let own = |pair: &&[usize; 2]| used[self.pieces.of(self.raw.t[pair[0]])];
        let squares = self.pairs.iter().filter(own);
        let squares = squares.filter_map(|p| Some(self.turn(*p, at)?.0.norm_squared() / 3.0));
        let squares: Vec<f64> = squares.collect();
        Errors::of(&squares, 2.0 * per_axis)
    }

    fn size_rms(&self, calibration: &Affine<f64>, used: &[bool]) -> f64 {
        let own = self
            .used
            .iter()
            .filter(|k| used[self.pieces.of(self.raw.t[**k])]);
        let errors = own.map(|k| calibration.apply(&self.raw.x[*k]).norm() - self.size);
        mimu_recording::statistics::root_mean_square(errors)
    }

    fn field(
        &self,
        at: &DVector<f64>,
        solution: &Solution,
        groups: &mut Groups,
        used: &[bool],
    ) -> Option<Field> {
        let calibration = affine(&at.fixed_rows::<12>(0).into_owned());
        let clusters = self.clusters(at, groups, used);
        let half = self.pieces.count / 2;
        let halves = [true, false].map(|first| clusters.moved(|g| used[g] && (g < half) == first));
        let halves_rad = match halves {
            [Some(a), Some(b)] => {
                let apart = (a - b).fixed_rows::<12>(0).into_owned();
                let each = self.used.iter();
                let each = each.map(|k| (by_calibration(&self.raw.x[*k]) * apart).norm_squared());
                (each.sum::<f64>() / self.used.len() as f64).sqrt() / self.size
            }
            _ => f64::INFINITY,
        };
        let mut errors = self.errors(at, used)?;
        errors.held_out_rms *= solution.unseen(used);
        let left = used.iter().filter(|used| !**used).count();
        Some(Field {
            worst_rad: self.worst(&calibration, &solution.covariance)?,
            covariance: solution.covariance.clone(),
            dof: solution.dof,
            delay_s: at[DELAY],
            dip_sine: at[DIP],
            delay_undetermined: solution.by_weights[(DELAY, DELAY)].sqrt() / DELAY_S,
            rests: self.rests.len(),
            errors,
            size_rms: self.size_rms(&calibration, used),
            left_out: self.pieces.spans(used),
            left_out_share: left as f64 / used.len() as f64,
            halves_rad,
            calibration,
        })
    }

    /// Worst standard deviation of the field's direction, over fields along the axes and the corners of the body, rad.
    fn worst(&self, calibration: &Affine<f64>, covariance: &DMatrix<f64>) -> Option<f64> {
        let forward = calibration.matrix.try_inverse()?;
        let own = covariance.fixed_view::<12, 12>(0, 0);
        let mut worst = 0.0;
        for code in 0..27 {
            let to = Vector3::new(code % 3, code / 3 % 3, code / 9).map(|c| f64::from(c) - 1.0);
            let Some(to) = to.try_normalize(0.5) else {
                continue;
            };
            let by = by_calibration(&(forward * (to * self.size - calibration.offset)));
            let across = Matrix3::identity() - to * to.transpose();
            let error = across * by * own * by.transpose() * across;
            worst = f64::max(worst, error.trace());
        }
        Some(worst.sqrt() / self.size)
    }
}

/// A matrix in the place of C among the parameters.
fn of_matrix(matrix: &Matrix3<f64>) -> DVector<f64> {
    let mut all = DVector::zeros(COUNT);
    let rows: SVector<f64, 9> = SVector::from_fn(|k, _| matrix[(k / 3, k % 3)]);
    all.fixed_rows_mut::<9>(0).copy_from(&rows);
    all
}
