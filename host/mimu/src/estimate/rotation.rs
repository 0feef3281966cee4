//! Gyro calibration without a table: from the turns between dwells, and from the dwells themselves.
//!
//! Gravity is the reference. Carried along by the integrated gyro, the direction of gravity of one
//! dwell must meet the direction measured in the next (references 19 of xu and 12 of fang); at rest the rate is zero.
//! Both are fitted together, as the bias that the turns want and the readings at rest need not agree
//! when the model lacks something. The frame is that of the accelerometer, so the full 3x3 matrix holds
//! the alignment of gyro to accelerometer.

use std::collections::BTreeMap;

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::least_squares::{Linearized, Observability, Scatter, excess_variance, minimize};
use super::{Estimated, Failure};
use crate::increment::Increment;
use crate::quantity::AXES;
use crate::triad::{Covariance, Part, Triad};

/// Number of parameters: nine of C, three of o.
pub const PARAMETERS: usize = 12;

/// One turn from dwell to dwell.
#[derive(Debug, Clone, Copy)]
pub struct Turn<'a> {
    /// Index of the dwell that it begins in.
    pub from: usize,
    /// Index of the dwell that it ends in.
    pub to: usize,
    /// The raw gyro, integrated piece by piece.
    pub increments: &'a [Increment],
    /// Specific force before and after, m/s², by the calibrated accelerometer.
    pub before: Vector3<f64>,
    /// See `before`.
    pub after: Vector3<f64>,
    /// Mean raw accelerometer readings that `before` and `after` come from.
    pub raw: [Vector3<f64>; 2],
    /// Variance of the angle between the two directions by the accelerometer's noise, rad² (one component).
    pub direction_variance: f64,
    /// The same by the Earth's rate across the vertical, where nothing says which way is north.
    pub earth_variance: f64,
    /// Variance of the integral of the gyro by its noise, raw²·s², mean of the three axes.
    pub integral_variance: f64,
    /// Length, s.
    pub duration_s: f64,
}

impl Turn<'_> {
    /// Variance of one component of the direction error by noise, rad², for a gyro with a mean square of `c2` per row of
    /// C.
    pub fn variance(&self, c2: f64) -> f64 {
        self.direction_variance + c2 * self.integral_variance
    }

    /// Size of the direction error (rad, two components) that noise alone gives; `c2` as the mean square of a row of C.
    pub fn floor(&self, c2: f64) -> f64 {
        (2.0 * self.variance(c2)).sqrt()
    }
}

/// A dwell, in which nothing but the Earth turns the gyro.
#[derive(Debug, Clone, Copy)]
pub struct Rest {
    /// Index of the dwell.
    pub dwell: usize,
    /// Mean reading, raw.
    pub raw: Vector3<f64>,
    /// Its variances by noise, raw².
    pub variance: Vector3<f64>,
    /// What is known of the rate, rad/s.
    pub rate: Vector3<f64>,
    /// Variances of the rest of it, rad²/s².
    pub rate_variance: Vector3<f64>,
}

/// Dwells that turns connect one to the next: in all of them the heading is known but for one angle, and so is the Earth's rate across
/// the vertical but for two numbers, which are estimated.
#[derive(Debug, Clone)]
pub struct Chains {
    /// Chain that each turn is a link of.
    pub of_turn: Vec<Option<usize>>,
    /// Chain of each dwell at rest.
    pub of_rest: Vec<Option<usize>>,
    /// How many there are.
    pub count: usize,
}

/// Dwells in a chain from which on its two numbers are worth their while; of fewer, the Earth's rate across is noise.
const CHAIN: usize = 6;

impl Chains {
    /// Of turns in order of time.
    pub fn of(turns: &[Turn], rest: &[Rest]) -> Self {
        let mut out = Self {
            of_turn: Vec::with_capacity(turns.len()),
            of_rest: vec![None; rest.len()],
            count: 0,
        };
        for links in turns.chunk_by(|a, b| a.to == b.from) {
            let long = links.len() + 1 >= CHAIN;
            out.of_turn
                .extend(links.iter().map(|_| long.then_some(out.count)));
            if let (true, [first, .., last]) = (long, links) {
                for (chain, rest) in out.of_rest.iter_mut().zip(rest) {
                    if (first.from..=last.to).contains(&rest.dwell) {
                        *chain = Some(out.count);
                    }
                }
                out.count += 1;
            }
        }
        out
    }

    /// Two level directions in the body frame of each dwell of a chain, the same ones in the world; `rotations` are those of the turns.
    pub fn level(
        &self,
        turns: &[Turn],
        rotations: impl Iterator<Item = Matrix3<f64>>,
    ) -> BTreeMap<usize, [Vector3<f64>; 2]> {
        let mut level: BTreeMap<usize, [Vector3<f64>; 2]> = BTreeMap::new();
        for ((turn, rotation), chain) in turns.iter().zip(rotations).zip(&self.of_turn) {
            if chain.is_none() {
                continue;
            }
            let before = level
                .entry(turn.from)
                .or_insert_with(|| across(&turn.before.normalize()));
            let up = turn.after.normalize();
            let north = rotation * before[0];
            let north = (north - up * up.dot(&north)).normalize();
            level.insert(turn.to, [north, up.cross(&north)]);
        }
        level
    }
}

/// Mean force and turn over two neighbouring blocks in motion, for the first guess.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// Mean specific force, m/s².
    pub force: Vector3<f64>,
    /// Its change, m/s².
    pub change: Vector3<f64>,
    /// Mean raw gyro reading.
    pub raw: Vector3<f64>,
    /// Time over which it changed, s.
    pub duration_s: f64,
}

/// First guess of C, to within some ten per cent: a direction that rests in the world moves by `f × ω` in the body,
/// so `df = [f]× C (u - u0) dt` is linear in C. Takes any mounting of the gyro, and any scale.
///
/// Hands shake, and then the accelerometer shows more than gravity: a pair counts the less, the more its
/// size is off.
fn guess(motions: &[Motion], rest: &Vector3<f64>, gravity: f64) -> Option<Matrix3<f64>> {
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut right = SVector::<f64, 9>::zeros();
    for m in motions {
        let off = (m.force.norm() - gravity) / (0.1 * gravity);
        let weight = 1.0 / (1.0 + off * off);
        let turned = (m.raw - rest) * m.duration_s;
        let across = m.force.cross_matrix();
        let mut rows = SMatrix::<f64, 3, 9>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                for r in 0..3 {
                    rows[(r, 3 * i + j)] = across[(r, i)] * turned[j];
                }
            }
        }
        normal += rows.transpose() * rows * weight;
        right += rows.transpose() * m.change * weight;
    }
    // Columns of unit size, so that volts and counts are judged alike.
    let scale = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
    let scaled = SMatrix::<f64, 9, 9>::from_fn(|i, j| normal[(i, j)] / (scale[i] * scale[j]));
    let solution = scaled
        .cholesky()?
        .solve(&right.component_div(&scale))
        .component_div(&scale);
    let c = Matrix3::from_fn(|i, j| solution[3 * i + j]);
    c.iter().all(|x| x.is_finite()).then_some(c)
}

/// An increment with the reading at rest taken out.
struct Centred {
    integral: Vector3<f64>,
    coning: Vector3<f64>,
    moment: Vector3<f64>,
    duration: f64,
}

impl Centred {
    fn new(increment: &Increment, rest: &Vector3<f64>) -> Self {
        let [integral, coning, moment] =
            [increment.integral, increment.coning, increment.moment].map(Vector3::from);
        Self {
            integral: integral - rest * increment.duration_s,
            coning: coning + rest.cross(&moment),
            moment,
            duration: increment.duration_s,
        }
    }
}

impl Centred {
    /// Rotation vector under `ω = C (u - rest) + o`, rad; `half` is half the cofactor matrix of C.
    fn rotation(&self, c: &Matrix3<f64>, o: &Vector3<f64>, half: &Matrix3<f64>) -> Vector3<f64> {
        c * self.integral
            + o * self.duration
            + half * self.coning
            + (c * self.moment).cross(o) * 0.5
    }
}

/// Cofactor matrix: `(C a) × (C b) = cof(C) (a × b)`.
fn cofactor(c: &Matrix3<f64>) -> Matrix3<f64> {
    let [x, y, z] = [0, 1, 2].map(|i| c.row(i).transpose());
    Matrix3::from_rows(&[
        y.cross(&z).transpose(),
        z.cross(&x).transpose(),
        x.cross(&y).transpose(),
    ])
}

/// `exp([φ]×)` and the right Jacobian of the rotation at φ.
fn exponential(phi: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let angle2 = phi.norm_squared();
    let k = phi.cross_matrix();
    let k2 = k * k;
    let (a, b, c) = if angle2 < 1e-4 {
        // Next terms: 1e-4³/5040 and less.
        (
            1.0 - angle2 / 6.0 + angle2 * angle2 / 120.0,
            0.5 - angle2 / 24.0 + angle2 * angle2 / 720.0,
            1.0 / 6.0 - angle2 / 120.0 + angle2 * angle2 / 5040.0,
        )
    } else {
        let angle = angle2.sqrt();
        let (sin, cos) = angle.sin_cos();
        (
            sin / angle,
            (1.0 - cos) / angle2,
            (angle - sin) / (angle2 * angle),
        )
    };
    let one = Matrix3::identity();
    (one + k * a + k2 * b, one - k * b + k2 * c)
}

/// Rotation over `pieces` under `ω = C (u - rest) + o`, as the matrix that takes a direction from the
/// body frame before into that after; with `sensitivity` also the turn (rad, in the frame after) by
/// each column of C and by o.
fn integrate(
    pieces: &[Centred],
    c: &Matrix3<f64>,
    o: &Vector3<f64>,
    sensitivity: bool,
) -> (Matrix3<f64>, [Matrix3<f64>; 4]) {
    let cofactor = cofactor(c) * 0.5;
    let mut after = Matrix3::identity();
    let mut by = [Matrix3::zeros(); 4];
    // Backwards, so that what is left of the turn carries each piece into the frame at its end.
    for piece in pieces.iter().rev() {
        let phi = piece.rotation(c, o, &cofactor);
        let (turn, right) = exponential(&phi);
        if sensitivity {
            let into = after * right;
            for (k, by) in by.iter_mut().take(3).enumerate() {
                *by += into * piece.integral[k];
            }
            by[3] += into * piece.duration;
        }
        after *= turn.transpose();
    }
    (after, by)
}

/// Angle from the direction that a calibration predicts to that measured after the turn, as a
/// rotation vector (rad) in the body frame after it.
pub fn direction_error(turn: &Turn, gyro: &Affine<f64>) -> Vector3<f64> {
    let rest = Vector3::zeros();
    let pieces: Vec<_> = turn
        .increments
        .iter()
        .map(|i| Centred::new(i, &rest))
        .collect();
    let (after, _) = integrate(&pieces, &gyro.matrix, &gyro.offset, false);
    between(&(after * turn.before.normalize()), &turn.after.normalize())
}

/// The direction error of a turn and what it owes to each piece of it.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    /// Takes a direction from the body frame before the turn into that after it.
    pub rotation: Matrix3<f64>,
    /// Directions of the two, body frame after the turn.
    pub sides: [Vector3<f64>; 2],
    /// What each of them owes to the force before and after the turn, rad/(m/s²).
    pub by_force: [[Vector3<f64>; 2]; 2],
    /// Its two components across the measured direction, rad.
    pub error: [f64; 2],
    /// Derivatives of the two by the rotation vector of each increment, rad/rad, body frame.
    pub by: Vec<[Vector3<f64>; 2]>,
}

/// [`direction_error`] in components, with its derivatives.
pub fn sensitivity(turn: &Turn, gyro: &Affine<f64>) -> Sensitivity {
    let (c, o) = (&gyro.matrix, &gyro.offset);
    let half = cofactor(c) * 0.5;
    let measured = turn.after.normalize();
    let sides = across(&measured);
    let mut after = Matrix3::identity();
    let mut by = vec![[Vector3::zeros(); 2]; turn.increments.len()];
    for (k, increment) in turn.increments.iter().enumerate().rev() {
        let piece = Centred::new(increment, &Vector3::zeros());
        let phi = piece.rotation(c, o, &half);
        let (back, right) = exponential(&phi);
        let into: Matrix3<f64> = after * right;
        by[k] = sides.map(|e| into.tr_mul(&e));
        after *= back.transpose();
    }
    let error = between(&(after * turn.before.normalize()), &measured);
    Sensitivity {
        rotation: after,
        sides,
        by_force: sides.map(|e| by_forces(turn, &after, &e)),
        error: sides.map(|e| e.dot(&error)),
        by,
    }
}

/// What the component `e` of the direction error of a turn owes to the force before and after it; `rotation` takes a direction from the
/// body frame before into that after. A direction moves by what of an error of the force lies across it.
fn by_forces(turn: &Turn, rotation: &Matrix3<f64>, e: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let side = e.cross(&turn.after.normalize());
    let ends = [(turn.before, -rotation.tr_mul(&side)), (turn.after, side)];
    ends.map(|(force, side)| {
        let up = force.normalize();
        (side - up * up.dot(&side)) / force.norm()
    })
}

/// Rotation vector that turns the unit vector `a` into `b` the shortest way.
fn between(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    let axis = a.cross(b);
    let sin = axis.norm();
    let angle = sin.atan2(a.dot(b));
    if sin > 0.0 {
        axis * (angle / sin)
    } else {
        axis
    }
}

/// Two unit vectors across `w`.
fn across(w: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let pick = w.iamin();
    let e = w.cross(&Vector3::ith(pick, 1.0)).normalize();
    [e, w.cross(&e)]
}

/// Fits `ω = C u + o` to the turns and to the dwells (`rest`) together.
///
/// The directions of gravity come from `accel`, whose own errors all turns share: its covariance is carried on into that
/// of the gyro. (Left out, the intervals of a quiet gyro beside a noisy accelerometer held the truth in 75 to 81 % of the
/// cases.) `motions` give the first guess unless `start` does; `gravity` in m/s².
pub fn estimate(
    turns: &[Turn],
    rest: &[Rest],
    accel: &Triad,
    motions: &[Motion],
    start: Option<&Affine<f64>>,
    gravity: f64,
) -> Result<Estimated, Failure> {
    if rest.is_empty() || 2 * turns.len() + 3 < PARAMETERS {
        return Err(Failure::Undetermined {
            parameters: "C of the gyro".into(),
            add: format!(
                "{} turns between dwells can be used, and at least 5 about different axes are needed: turn the unit about each axis, resting between",
                turns.len()
            ),
        });
    }
    let at_rest = rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / rest.len() as f64;
    let first = match start {
        Some(start) => start.matrix,
        None => guess(motions, &at_rest, gravity).ok_or_else(|| {
            Failure::NoSolution(
                "no scale factor of the gyro makes its turns fit those of gravity".into(),
            )
        })?,
    };
    // Parameters of order one: C in units of its own size, o about the reading at rest.
    let unit = first.norm() / 3f64.sqrt();
    let pieces: Vec<Vec<Centred>> = turns
        .iter()
        .map(|t| {
            t.increments
                .iter()
                .map(|i| Centred::new(i, &at_rest))
                .collect()
        })
        .collect();
    let directions: Vec<_> = turns
        .iter()
        .map(|t| (t.before.normalize(), t.after.normalize()))
        .collect();
    let unpack = |p: &DVector<f64>| {
        (
            Matrix3::from_fn(|i, j| unit * p[3 * i + j]),
            Vector3::new(p[9], p[10], p[11]),
        )
    };
    let chains = Chains::of(turns, rest);
    let all = PARAMETERS + 2 * chains.count;
    let (n_turns, n_rest) = (2 * turns.len(), 3 * rest.len());
    // Unweighted residuals and derivatives: rad, then rad/s.
    let linearize = |p: &DVector<f64>| {
        let (c, o) = unpack(p);
        let mut r = DVector::zeros(n_turns + n_rest);
        let mut j = DMatrix::zeros(n_turns + n_rest, all);
        let turned: Vec<_> = pieces.iter().map(|p| integrate(p, &c, &o, true)).collect();
        let level = chains.level(turns, turned.iter().map(|t| t.0));
        for (t, (after, by)) in turned.iter().enumerate() {
            let (before, measured) = &directions[t];
            let error = between(&(after * before), measured);
            for (k, e) in across(measured).iter().enumerate() {
                let row = 2 * t + k;
                r[row] = e.dot(&error);
                if let (Some(chain), Some(level)) = (chains.of_turn[t], level.get(&turns[t].to)) {
                    for (l, level) in level.iter().enumerate() {
                        let column = PARAMETERS + 2 * chain + l;
                        j[(row, column)] = -turns[t].duration_s * e.dot(level);
                        r[row] += j[(row, column)] * p[column];
                    }
                }
                for (column, by) in by.iter().enumerate() {
                    let slope = by.transpose() * e;
                    for i in 0..3 {
                        if column < 3 {
                            j[(row, 3 * i + column)] = unit * slope[i];
                        } else {
                            j[(row, 9 + i)] = slope[i];
                        }
                    }
                }
            }
        }
        for (s, observation) in rest.iter().enumerate() {
            let u = observation.raw - at_rest;
            let rate = c * u + o - observation.rate;
            for i in 0..3 {
                let row = n_turns + 3 * s + i;
                r[row] = rate[i];
                if let (Some(chain), Some(level)) =
                    (chains.of_rest[s], level.get(&observation.dwell))
                {
                    for (l, level) in level.iter().enumerate() {
                        let column = PARAMETERS + 2 * chain + l;
                        j[(row, column)] = -level[i];
                        r[row] -= level[i] * p[column];
                    }
                }
                for k in 0..3 {
                    j[(row, 3 * i + k)] = unit * u[k];
                }
                j[(row, 9 + i)] = 1.0;
            }
        }
        (r, j)
    };
    let known = |p: &DVector<f64>| -> Vec<f64> {
        let (c, _) = unpack(p);
        let squared = c.component_mul(&c);
        let mean = squared.sum() / 3.0;
        let turns = turns.iter().zip(&chains.of_turn).flat_map(|(t, chain)| {
            let earth = if chain.is_some() {
                0.0
            } else {
                t.earth_variance
            };
            [t.variance(mean) + earth; 2]
        });
        let rest = rest.iter().zip(&chains.of_rest).flat_map(|(o, chain)| {
            let earth = o.rate_variance * if chain.is_some() { 0.0 } else { 1.0 };
            let v = squared * o.variance + earth;
            [v.x, v.y, v.z]
        });
        turns.chain(rest).map(|v| v.max(1e-20)).collect()
    };
    // Derivatives of the turns' residuals by C and o of the accelerometer.
    let by_accelerometer = |p: &DVector<f64>| {
        let (c, o) = unpack(p);
        let mut by = DMatrix::zeros(n_turns, 12);
        for (t, (turn, pieces)) in turns.iter().zip(&pieces).enumerate() {
            let (after, _) = integrate(pieces, &c, &o, false);
            let (_, measured) = &directions[t];
            for (k, e) in across(measured).iter().enumerate() {
                for (side, raw) in by_forces(turn, &after, e).into_iter().zip(turn.raw) {
                    for i in 0..3 {
                        for j in 0..3 {
                            by[(2 * t + k, 3 * i + j)] += side[i] * raw[j];
                        }
                        by[(2 * t + k, 9 + i)] += side[i];
                    }
                }
            }
        }
        by
    };
    let accel_covariance = DMatrix::from_fn(12, 12, |i, j| accel.inverse_covariance[(i, j)]);
    let mut p = DVector::from_fn(all, |k, _| {
        if k < 9 {
            first[(k / 3, k % 3)] / unit
        } else {
            0.0
        }
    });
    let mut groups = [Scatter {
        excess: 0.0,
        chi2: 0.0,
        dof: 1.0,
    }; 2];
    // The first weights: half a degree, and what the dwells scatter by.
    let (r, _) = linearize(&p);
    groups[0].excess = 0.5f64.to_radians().powi(2);
    groups[1].excess = r.rows(n_turns, n_rest).norm_squared() / n_rest as f64;
    let lost = || Failure::NoSolution("the fit of the gyro to the turns does not converge".into());
    let mut gain = DMatrix::zeros(all, 12);
    let mut of_groups = [(); 2].map(|()| DMatrix::zeros(all, all));
    let mut condition = f64::INFINITY;
    for round in 0..30 {
        let variances = known(&p);
        let weights: Vec<f64> = variances
            .iter()
            .enumerate()
            .map(|(k, v)| {
                (v + groups[usize::from(k >= n_turns)].excess)
                    .sqrt()
                    .recip()
            })
            .collect();
        let weigh = |(mut r, mut j): (DVector<f64>, DMatrix<f64>)| {
            for (k, weight) in weights.iter().enumerate() {
                r[k] *= weight;
                let mut row = j.row_mut(k);
                row *= *weight;
            }
            Linearized {
                residuals: r,
                jacobian: j,
            }
        };
        let last;
        (p, last) = minimize(p, |p| weigh(linearize(p))).ok_or_else(lost)?;
        let turns_only = last.jacobian.rows(0, n_turns).columns(0, 9).into_owned();
        let shape = Observability::of(&turns_only);
        if !shape.is_complete() {
            let names: Vec<String> = shape
                .undetermined
                .iter()
                .map(|(k, _)| format!("C_{}{}", AXES[k / 3], AXES[k % 3]))
                .collect();
            return Err(Failure::Undetermined {
                parameters: names.join(", "),
                add: "add turns about every axis, with that axis level and slanted: gravity does not show a turn about the vertical".into(),
            });
        }
        condition = shape.condition;
        let covariance = (last.jacobian.transpose() * &last.jacobian)
            .try_inverse()
            .ok_or_else(|| Failure::NoSolution("the normal matrix is singular".into()))?;
        // What the accelerometer's calibration errs by is common to all turns: it goes into the parameters whole, and
        // into the size that residuals may have, but into no weight.
        let by = by_accelerometer(&p);
        let mut weighted = by.clone();
        for (mut row, weight) in weighted.row_iter_mut().zip(&weights) {
            row *= *weight;
        }
        gain = &covariance * last.jacobian.rows(0, n_turns).transpose() * weighted;
        of_groups = [(0, n_turns), (n_turns, n_rest)].map(|(from, rows)| {
            let j = last.jacobian.rows(from, rows);
            &covariance * (j.transpose() * j) * &covariance
        });
        let common = (&by * &accel_covariance).component_mul(&by).column_sum();
        let allowed: Vec<f64> = variances
            .iter()
            .enumerate()
            .map(|(k, v)| v + common.get(k).copied().unwrap_or(0.0))
            .collect();
        // What each group keeps of its degrees of freedom: rows less what the parameters take up there.
        let leverage = |from: usize, rows: usize| {
            let j = last.jacobian.rows(from, rows);
            // The trace of J C J' without the matrix, which for thousands of dwells would fill the memory.
            (j * &covariance).component_mul(&j).sum()
        };
        let before = groups;
        for (g, (from, rows)) in [(0, n_turns), (n_turns, n_rest)].into_iter().enumerate() {
            let residuals: Vec<f64> = (from..from + rows)
                .map(|k| last.residuals[k] / weights[k])
                .collect();
            let dof = rows as f64 - leverage(from, rows);
            groups[g] = excess_variance(&residuals, &allowed[from..from + rows], dof);
        }
        let settled =
            (0..2).all(|g| (groups[g].excess - before[g].excess).abs() <= 1e-3 * before[g].excess);
        if settled && round > 0 {
            break;
        }
    }
    let (matrix, at_zero) = unpack(&p);
    let inverse = Affine {
        matrix,
        offset: at_zero - matrix * at_rest,
    };
    let mut change = SMatrix::<f64, 12, 12>::identity();
    for i in 0..3 {
        for k in 0..3 {
            change[(3 * i + k, 3 * i + k)] = unit;
            change[(9 + i, 3 * i + k)] = -unit * at_rest[k];
        }
    }
    let in_unit = |m: &DMatrix<f64>| Covariance::from_fn(|i, j| m[(i, j)]);
    let own = of_groups.iter().zip(&groups).map(|(c, group)| Part {
        covariance: in_unit(c),
        dof: group.variance_dof(),
    });
    let gain = Covariance::from_fn(|i, j| gain[(i, j)]);
    let of_accelerometer = accel.inverse_parts();
    let shared = of_accelerometer.iter().map(|part| part.seen_by(&gain));
    let parts = own.chain(shared).map(|part| part.seen_by(&change));
    let scatter: Vec<_> = ["turns", "rest"]
        .iter()
        .zip(groups)
        .map(|(n, g)| (n.to_string(), g))
        .collect();
    let triad = Triad::from_inverse(inverse, parts.collect()).ok_or_else(|| {
        Failure::NoSolution(
            "C is singular: the gyro does not respond to turns about some axis".into(),
        )
    })?;
    Ok(Estimated {
        triad,
        scatter,
        condition,
        delays: None,
        notes: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotation by the rate `ω(t)` in ten thousand small steps: no correction needed, none taken.
    fn brute_force(rate: impl Fn(f64) -> Vector3<f64>, from: f64, to: f64) -> Matrix3<f64> {
        let steps = 10_000;
        let h = (to - from) / f64::from(steps);
        (0..steps).fold(Matrix3::identity(), |r, k| {
            let middle = from + (f64::from(k) + 0.5) * h;
            r * nalgebra::Rotation3::new(rate(middle) * h).matrix()
        })
    }

    #[test]
    fn a_direction_is_carried_along_as_by_ten_thousand_small_turns() {
        let rate = |t: f64| Vector3::new(3.0 * (5.0 * t).sin(), 4.0 * (3.0 * t).cos(), 2.0 - t);
        let c = Matrix3::new(
            0.02, 0.001, -0.002, 0.0005, -0.018, 0.001, 0.0, 0.002, 0.022,
        );
        let o = Vector3::new(-0.5, 0.3, 0.1);
        let to_raw = |w: Vector3<f64>| c.try_inverse().unwrap() * (w - o);
        // Straight between the ends, as the condenser takes it: 10 ms pieces of 1 ms samples.
        let mut increments = Vec::new();
        let sample = |k: usize| rate(1e-3 * k as f64);
        for piece in 0..100 {
            let mut open = Increment::EMPTY;
            let (mut a, mut sum, mut b) =
                (Vector3::zeros(), Vector3::zeros(), Vector3::<f64>::zeros());
            for k in 10 * piece..10 * piece + 10 {
                let (u0, u1) = (to_raw(sample(k)), to_raw(sample(k + 1)));
                let step = (u0 + u1) * 0.5e-3;
                b += a.cross(&step) + u0.cross(&u1) * (1e-6 / 6.0);
                sum += a * 1e-3 + (u0 * 2.0 + u1) * (1e-6 / 6.0);
                a += step;
            }
            open.duration_s = 0.01;
            open.integral = a.into();
            open.coning = b.into();
            open.moment = (sum * 2.0 - a * 0.01).into();
            increments.push(open);
        }
        let before = Vector3::new(0.1, -0.7, 0.7).normalize();
        let turn = Turn {
            from: 0,
            to: 1,
            increments: &increments,
            before,
            after: brute_force(rate, 0.0, 1.0).transpose() * before,
            raw: [Vector3::zeros(); 2],
            direction_variance: 0.0,
            earth_variance: 0.0,
            integral_variance: 0.0,
            duration_s: 1.0,
        };
        let error = direction_error(
            &turn,
            &Affine {
                matrix: c,
                offset: o,
            },
        )
        .norm();
        // 1 ms samples of a rate that bends by 75 rad/s³ are off by 1e-3²/12 * 75 rad in a second.
        assert!(error < 1e-5, "{error:e} rad");
    }
}
