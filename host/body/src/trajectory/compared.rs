//! Readings of a gyro or an accelerometer, compared with poses over windows of time.
//!
//! A turn between two poses is that of the integrated rates; the second difference of three positions is the specific force that was turned into the frame of the
//! reference, less gravity, weighted by a triangle over the window. Nothing is differentiated: the ends of the windows are poses as they were measured.

use mimu::triad::{affine, vector};
use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::poses::Poses;
use crate::clustered::Clusters;
use crate::errors::Errors;
use crate::pieces::{Groups, Pieces};
use crate::relation::{DELAY, Equations, Relation};
use crate::series::Series;

/// Length of a turn, s, and of each half of a window of positions. The noise of attitudes is that of two stamps, so that longer turns know a rate better.
pub(super) const TURN_S: f64 = 1.0;
const HALF_S: f64 = 0.25;
pub(super) const FORCE_S: f64 = 2.0 * HALF_S;
/// Length of the turns that the search begins with: they are about one axis.
const SHORT_S: f64 = 0.2;
/// A rate above which a window is one of motion, rad/s.
const MOVING: f64 = 0.1;

/// Parameters: C by rows, o, by how much the readings are later (s), and by how much more with each second; of an accelerometer also the tilt of the frame of the
/// reference (rad), and the arm from the point of the reference (m).
pub(super) const CLOCK: usize = 13;
pub(super) const TILT: usize = 14;
pub(super) const ARM: usize = 16;
/// What is known of them beforehand, standard deviations: the delay about what the search found.
const DELAY_S: f64 = 0.05;
const CLOCK_RATE: f64 = 3e-4;
const TILT_RAD: f64 = 0.05;
const ARM_M: f64 = 0.5;
/// Poses at the ends of a window, and in its middle for positions.
#[derive(Clone, Copy)]
struct Window {
    from: usize,
    middle: usize,
    to: usize,
    piece: usize,
    /// Number of its attitude among those that differ by [`CELL_RAD`].
    cell: usize,
    moves: bool,
}

/// Attitudes that are nearer than this share the error of the instrument, rad: 30 degrees.
const CELL_RAD: f64 = 0.52;

/// What the readings of a window give, and what changes it.
struct Reckoned {
    residual: Vector3<f64>,
    by: DMatrix<f64>,
}

/// How gravity points in the frame of the reference: up, and two directions across.
#[derive(Clone, Copy)]
pub(super) struct Up {
    pub along: Vector3<f64>,
    pub across: [Vector3<f64>; 2],
    pub gravity: f64,
}

impl Up {
    /// Along an axis of the reference, forth or back.
    pub fn axis(axis: usize, sign: f64, gravity: f64) -> Self {
        let of = |k: usize| Vector3::ith(k % 3, 1.0);
        Self {
            along: sign * of(axis),
            across: [of(axis + 1), of(axis + 2)],
            gravity,
        }
    }

    /// The acceleration of free fall, m/s², and its derivatives by the tilt.
    fn fall(&self, tilt: [f64; 2]) -> (Vector3<f64>, [Vector3<f64>; 2]) {
        let left = (1.0 - tilt[0].powi(2) - tilt[1].powi(2)).max(0.01).sqrt();
        let across = self.across[0] * tilt[0] + self.across[1] * tilt[1];
        let by = |k: usize| -self.gravity * (self.across[k] - self.along * (tilt[k] / left));
        let fall = -self.gravity * (self.along * left + across);
        (fall, [by(0), by(1)])
    }
}

/// A triad and the poses.
pub(super) struct Compared<'a> {
    pub raw: &'a Series,
    pub poses: &'a Poses,
    /// Of an accelerometer.
    pub up: Option<Up>,
    pieces: Pieces,
    windows: Vec<Window>,
    middle_s: f64,
    /// How much later the readings are than the poses before anything is estimated, s: the delay is about it.
    later_s: f64,
    /// A calibration that is judged: in the place of C there stands the rotation vector from it, in three parameters of nine.
    judged: Option<Matrix3<f64>>,
}

impl<'a> Compared<'a> {
    /// Of readings that are later than the poses by `later_s` or so.
    pub fn new(raw: &'a Series, poses: &'a Poses, up: Option<Up>, later_s: f64) -> Option<Self> {
        let pieces = Pieces::over(&poses.t)?;
        let (length, half) = match up {
            None => (TURN_S, 0.5 * TURN_S),
            Some(_) => (FORCE_S, HALF_S),
        };
        let mut all = Self {
            raw,
            poses,
            up,
            windows: Vec::new(),
            middle_s: 0.5 * (poses.t[0] + poses.t[poses.t.len() - 1]),
            pieces,
            later_s,
            judged: None,
        };
        all.windows = all.cut(length, half);
        Some(all)
    }

    /// Windows of this length, each beginning where that before ends, or in its middle for positions.
    fn cut(&self, length: f64, half: f64) -> Vec<Window> {
        let poses = self.poses;
        let mut windows = Vec::new();
        let mut cells: Vec<UnitQuaternion<f64>> = Vec::new();
        let mut from = 0;
        while poses.t[from] + length <= poses.t[poses.t.len() - 1] {
            let [middle, to] = [half, length].map(|s| poses.near(poses.t[from] + s));
            if from < middle && middle < to && poses.is_dense(from, to) {
                let rate = poses.turn(from, to).norm() / (poses.t[to] - poses.t[from]);
                let attitude = poses.attitude[middle];
                let near = cells
                    .iter()
                    .position(|of| of.angle_to(&attitude) < CELL_RAD);
                let cell = near.unwrap_or_else(|| {
                    cells.push(attitude);
                    cells.len() - 1
                });
                windows.push(Window {
                    from,
                    middle,
                    to,
                    cell,
                    piece: self.pieces.of(poses.t[middle]),
                    moves: rate > MOVING,
                });
            }
            from = match self.up {
                None => to,
                Some(_) => middle,
            }
            .max(from + 1);
        }
        windows
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.up.map_or(TILT, |_| ARM + 3)
    }

    /// The same with the C of a calibration that is judged, turned as is nearest to what `at` has; and its parameters.
    pub fn judging(self, at: &DVector<f64>, own: &Matrix3<f64>) -> (Self, DVector<f64>) {
        let across = own
            .try_inverse()
            .map(|forward| self.model(at).matrix * forward);
        let rotation = across.map_or(Rotation3::identity(), |of| Rotation3::from_matrix(&of));
        let mut turned = at.clone();
        turned.rows_mut(0, 9).fill(0.0);
        let judged = Some(rotation.matrix() * own);
        (Self { judged, ..self }, turned)
    }

    /// C and o at these parameters.
    fn model(&self, at: &DVector<f64>) -> Affine<f64> {
        let mut model = affine(&at.fixed_rows::<12>(0).into_owned());
        if let Some(own) = &self.judged {
            let turned = Rotation3::new(at.fixed_rows::<3>(0).into_owned());
            model.matrix = turned.matrix() * own;
        }
        model
    }

    /// Derivatives by C as those by the rotation of a calibration that is judged.
    fn freed(&self, by: &mut DMatrix<f64>, model: &Affine<f64>) {
        if self.judged.is_some() {
            let turns = [0, 1, 2].map(|k| {
                let turned = Vector3::<f64>::ith(k, 1.0).cross_matrix() * model.matrix;
                by.columns(0, 9) * vector(&turned, &Vector3::zeros()).fixed_rows::<9>(0)
            });
            by.columns_mut(0, 9).fill(0.0);
            for (k, turn) in turns.iter().enumerate() {
                by.set_column(k, turn);
            }
        }
    }

    /// C and o, and the rms residual, by plain least squares over short turns.
    pub fn start_of_turns(&self) -> Option<(DVector<f64>, f64)> {
        let mut normal = DMatrix::<f64>::zeros(4, 4);
        let mut right = DMatrix::<f64>::zeros(4, 3);
        let (mut squares, mut count) = (0.0, 0.0);
        for window in self.cut(SHORT_S, 0.5 * SHORT_S) {
            let [a, b] = [window.from, window.to].map(|k| self.poses.t[k]);
            let Some(nodes) = self.raw.between(a + self.later_s, b + self.later_s) else {
                continue;
            };
            let sums = nodes
                .windows(2)
                .map(|w| 0.5 * (w[1].0 - w[0].0) * (w[0].1 + w[1].1));
            let mean = sums.sum::<Vector3<f64>>() / (b - a);
            let rate = self.poses.turn(window.from, window.to) / (b - a);
            let row = DVector::from_vec(vec![mean.x, mean.y, mean.z, 1.0]);
            normal += &row * row.transpose();
            right += &row * rate.transpose();
            squares += rate.norm_squared();
            count += 3.0;
        }
        let found = crate::clustered::inverse(&normal)? * &right;
        let mut at = DVector::zeros(self.parameters());
        for axis in 0..3 {
            for k in 0..3 {
                at[3 * axis + k] = found[(k, axis)];
            }
            at[9 + axis] = found[(3, axis)];
        }
        Some((at, ((squares - found.dot(&right)).max(0.0) / count).sqrt()))
    }

    /// C and o of an accelerometer, and the mean square of its errors, by plain least squares, with the clock of the gyro.
    pub fn start_of_forces(&self, clock: f64) -> Option<(DVector<f64>, f64)> {
        let mut at = DVector::zeros(self.parameters());
        at[CLOCK] = clock;
        let all = vec![true; self.pieces.count];
        let sums = self.clusters(&at, &mut Groups::default(), &all);
        at += &sums.solve(&all)?.step;
        (at[DELAY], at[CLOCK]) = (0.0, clock);
        let (squares, _) = self.squares(&at, &all);
        Some((at, squares.iter().sum::<f64>() / squares.len() as f64))
    }

    /// How much later the readings are than the poses at a time of these.
    fn lag(&self, at: &DVector<f64>, t: f64) -> f64 {
        self.later_s + at[DELAY] + at[CLOCK] * (t - self.middle_s)
    }

    fn reckoned(&self, window: &Window, at: &DVector<f64>) -> Option<Reckoned> {
        let model = self.model(at);
        let mut reckoned = match self.up {
            None => self.turn(window, at, &model)?,
            Some(up) => self.force(window, at, &model, &up)?,
        };
        self.freed(&mut reckoned.by, &model);
        Some(reckoned)
    }

    fn turn(&self, window: &Window, at: &DVector<f64>, model: &Affine<f64>) -> Option<Reckoned> {
        let [a, b] = [window.from, window.to].map(|k| self.poses.t[k]);
        let nodes = self.raw.between(a + self.lag(at, a), b + self.lag(at, b))?;
        // From the end back: what turns after a step takes its error to the end.
        let mut after = UnitQuaternion::identity();
        let mut by_reading = [Matrix3::<f64>::zeros(); 4];
        for pair in nodes.windows(2).rev() {
            let time = pair[1].0 - pair[0].0;
            let u = 0.5 * (pair[0].1 + pair[1].1);
            let half = UnitQuaternion::from_scaled_axis(0.5 * time * model.apply(&u));
            let to_end = (half * after).inverse().to_rotation_matrix().into_inner();
            for (sum, reading) in by_reading.iter_mut().zip([u.x, u.y, u.z, 1.0]) {
                *sum += to_end * (reading * time);
            }
            after = half * half * after;
        }
        let seen = self.poses.attitude[window.from].inverse() * self.poses.attitude[window.to];
        let time = b - a;
        let mut by = DMatrix::zeros(3, self.parameters());
        fill(&mut by, &by_reading.map(|sum| sum / time));
        let ends = [nodes[0].1, nodes[nodes.len() - 1].1].map(|u| model.apply(&u) / time);
        let (first, last) = (after.inverse() * ends[0], ends[1]);
        by.set_column(DELAY, &(last - first));
        by.set_column(
            CLOCK,
            &(last * (b - self.middle_s) - first * (a - self.middle_s)),
        );
        Some(Reckoned {
            residual: (after.inverse() * seen).scaled_axis() / time,
            by,
        })
    }

    /// Mean of the specific force in the frame of the reference, weighted by a triangle: its derivatives by reading and by one.
    fn weighted(&self, window: &Window, lag: f64) -> Option<[Matrix3<f64>; 4]> {
        let [a, m, b] = [window.from, window.middle, window.to].map(|k| self.poses.t[k]);
        let mut sums = [Matrix3::<f64>::zeros(); 4];
        for (from, to, rises) in [(a, m, true), (m, b, false)] {
            let nodes = self.raw.between(from + lag, to + lag)?;
            let mut last: Option<(f64, [Matrix3<f64>; 4])> = None;
            for (t, u) in nodes {
                // Rounding may lead out of the window by a bit.
                let t = (t - lag).clamp(from, to);
                let share = (t - from) / (to - from);
                let weight = if rises { share } else { 1.0 - share };
                let turned = self.poses.attitude_at(t)?.to_rotation_matrix().into_inner();
                let now = [u.x, u.y, u.z, 1.0].map(|reading| turned * (weight * reading));
                if let Some((before, values)) = last {
                    for k in 0..4 {
                        sums[k] += (values[k] + now[k]) * (0.5 * (t - before));
                    }
                }
                last = Some((t, now));
            }
        }
        Some(sums.map(|sum| sum / (0.5 * (b - a))))
    }

    fn force(
        &self,
        window: &Window,
        at: &DVector<f64>,
        model: &Affine<f64>,
        up: &Up,
    ) -> Option<Reckoned> {
        let poses = [window.from, window.middle, window.to];
        let [a, m, b] = poses.map(|k| self.poses.t[k]);
        let lag = self.lag(at, m);
        let by_reading = self.weighted(window, lag)?;
        let position = self.poses.position.as_ref()?;
        let second = |of: [Matrix3<f64>; 3]| {
            ((of[2] - of[1]) / (b - m) - (of[1] - of[0]) / (m - a)) / (0.5 * (b - a))
        };
        let moved =
            second(poses.map(|k| {
                Matrix3::from_columns(&[position[k], Vector3::zeros(), Vector3::zeros()])
            }))
            .column(0)
            .into_owned();
        let turned =
            second(poses.map(|k| self.poses.attitude[k].to_rotation_matrix().into_inner()));
        let (fall, by_tilt) = up.fall([at[TILT], at[TILT + 1]]);
        let mut by = DMatrix::zeros(3, self.parameters());
        fill(&mut by, &by_reading);
        let model = vector(&model.matrix, &model.offset);
        let arm: Vector3<f64> = at.fixed_rows::<3>(ARM).into_owned();
        let reckoned = by.columns(0, 12) * model + fall - turned * arm;
        // Readings half a sample later and earlier.
        let step = 0.5 * self.raw.period;
        let mut moves = [Vector3::zeros(); 2];
        for (moved, step) in moves.iter_mut().zip([step, -step]) {
            let mut other = DMatrix::zeros(3, 12);
            fill(&mut other, &self.weighted(window, lag + step)?);
            *moved = Vector3::from_column_slice((other * model).as_slice());
        }
        let by_delay = (moves[0] - moves[1]) / (2.0 * step);
        by.set_column(DELAY, &by_delay);
        by.set_column(CLOCK, &(by_delay * (m - self.middle_s)));
        by.set_column(TILT, &by_tilt[0]);
        by.set_column(TILT + 1, &by_tilt[1]);
        by.fixed_view_mut::<3, 3>(0, ARM).copy_from(&-turned);
        Some(Reckoned {
            residual: moved - reckoned,
            by,
        })
    }

    /// The relation of the readings to the poses from `at` on, with the delay as a whole, and the noise of a pose. Its covariance is that by leaving out pieces of time or, if that is
    /// larger, attitudes: an instrument errs by where it sees its markers, alike whenever the body is turned so.
    pub fn solved(&self, at: DVector<f64>) -> Option<(Relation, f64)> {
        let mut relation = Relation::of(self, at)?;
        let Relation {
            at, groups, used, ..
        } = &mut relation;
        let cells = self.windows.iter().map(|w| w.cell).max()? + 1;
        let mut sums = Clusters::new(cells, at, &self.known());
        let in_use = |w: &Window| used[w.piece].then_some(w.cell);
        self.add_windows(&mut sums, at, groups, |w| Some((in_use(w)?, true)));
        let by_time = &relation.solution;
        let size = |of: &DMatrix<f64>| {
            let each = (0..of.nrows()).map(|k| of[(k, k)] / by_time.by_weights[(k, k)]);
            each.sum::<f64>()
        };
        let by_attitude = sums.solve(&vec![true; cells]).map(|of| of.covariance);
        let by_attitude = by_attitude.filter(|of| size(of) > size(&by_time.covariance));
        let (_, pose_noise) = self.squares(&relation.at, &relation.used);
        let spans = relation.left_out.iter();
        let lag = |t: f64| t + self.lag(&relation.at, t);
        relation.left_out = spans.map(|span| span.map(lag)).collect();
        relation.solution.covariance = by_attitude.unwrap_or(relation.solution.covariance);
        relation.at[DELAY] += self.later_s;
        Some((relation, pose_noise))
    }

    /// Adds the windows for which `cluster` gives a number, and whether their residuals count for the scatter.
    fn add_windows(
        &self,
        sums: &mut Clusters,
        at: &DVector<f64>,
        groups: &mut Groups,
        cluster: impl Fn(&Window) -> Option<(usize, bool)>,
    ) {
        for window in &self.windows {
            let Some((cluster, counts)) = cluster(window) else {
                continue;
            };
            let Some(Reckoned { residual, by }) = self.reckoned(window, at) else {
                continue;
            };
            let group = usize::from(window.moves);
            if counts {
                groups.count(group, residual.norm_squared(), 3.0);
            }
            let weight = groups.weight(group);
            for axis in 0..3 {
                sums.add(cluster, residual[axis], &by.row(axis).transpose(), weight);
            }
        }
    }

    /// Mean squares of the residuals of each window, SI², and the white noise of a pose: attitude, rad, or position, m, standard deviation of an axis.
    ///
    /// The noise is how much more the residual of a window has in common with itself than with that of the next: errors that last cancel. The noise of a pose is in two turns with opposite
    /// signs, and in three second differences as 1, -2, 1. That of the readings counts as if it were of the poses: it is small beside theirs, and is not known from motion.
    fn squares(&self, at: &DVector<f64>, used: &[bool]) -> (Vec<f64>, f64) {
        let mut squares = Vec::new();
        let (mut next, mut pairs) = (0.0, 0.0);
        let mut last: Option<(usize, Vector3<f64>)> = None;
        for window in self.windows.iter().filter(|w| used[w.piece]) {
            let Some(Reckoned { residual, .. }) = self.reckoned(window, at) else {
                continue;
            };
            // A turn's error at its begin is that at the end of the turn before; second differences are all in the frame of the reference.
            let (shared, at_begin, kept) = match self.up {
                None => {
                    let poses = &self.poses.attitude;
                    let turn = poses[window.from].inverse() * poses[window.to];
                    (window.to, turn * residual, residual)
                }
                Some(_) => (window.middle, residual, residual),
            };
            if let Some((pose, before)) = last
                && pose == window.from
            {
                next += before.dot(&at_begin) / 3.0;
                pairs += 1.0;
            }
            last = Some((shared, kept));
            squares.push(residual.norm_squared() / 3.0);
        }
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        let more = (mean - next / f64::max(pairs, 1.0)).max(0.0);
        let (parts, scale) = match self.up {
            None => (3.0, TURN_S),
            Some(_) => (10.0, HALF_S.powi(2)),
        };
        (squares, (more / parts).sqrt() * scale)
    }

    /// Rms of what is compared, of an axis, SI: the rate of turns, or the specific force.
    pub fn signal(&self) -> f64 {
        match self.up {
            Some(up) => up.gravity / 3f64.sqrt(),
            None => {
                let rate = |w: &Window| {
                    self.poses.turn(w.from, w.to).norm_squared()
                        / (self.poses.t[w.to] - self.poses.t[w.from]).powi(2)
                };
                (self.windows.iter().map(rate).sum::<f64>() / self.windows.len() as f64 / 3.0)
                    .sqrt()
            }
        }
    }
}

impl Equations for Compared<'_> {
    fn known(&self) -> DVector<f64> {
        let mut known = DVector::repeat(self.parameters(), f64::INFINITY);
        if self.judged.is_some() {
            known.rows_mut(3, 6).fill(1.0);
        }
        (known[DELAY], known[CLOCK]) = (DELAY_S, CLOCK_RATE);
        for k in TILT..self.parameters() {
            known[k] = if k < ARM { TILT_RAD } else { ARM_M };
        }
        known
    }

    fn pieces(&self) -> &Pieces {
        &self.pieces
    }

    fn add_to(
        &self,
        clusters: &mut Clusters,
        at: &DVector<f64>,
        groups: &mut Groups,
        used: &[bool],
    ) {
        let piece = |w: &Window| Some((w.piece, used[w.piece]));
        self.add_windows(clusters, at, groups, piece);
    }

    fn errors(&self, at: &DVector<f64>, used: &[bool]) -> Option<Errors> {
        let (squares, pose) = self.squares(at, used);
        let (kept, scale) = match self.up {
            None => (2.0, TURN_S),
            Some(_) => (6.0, HALF_S.powi(2)),
        };
        Errors::of(&squares, kept * (pose / scale).powi(2))
    }
}

/// Derivatives by C and o from those by each reading, and by one.
fn fill(by: &mut DMatrix<f64>, by_reading: &[Matrix3<f64>; 4]) {
    for i in 0..3 {
        for j in 0..3 {
            by.fixed_view_mut::<3, 1>(0, 3 * i + j)
                .copy_from(&by_reading[j].column(i));
        }
        by.fixed_view_mut::<3, 1>(0, 9 + i)
            .copy_from(&by_reading[3].column(i));
    }
}
