//! Further gyros and accelerometers: two on one body feel the same motion.
//!
//! At every instant `ω = C₂ u₂ + o₂` for the compensated rate ω of the first gyro, and `a + ω'×r + ω×(ω×r) = C₂ u₂ + o₂` for the compensated specific force a of
//! the first accelerometer and the arm r to the second. Both are compared in integrals over windows, so that nothing is differentiated: of ω' there remains
//! the difference of two rates, and of a delay τ the difference of two readings. Both are linear in C, o and r; τ is found by steps.

use mimu::triad::affine;
use mimu_recording::TriadKind;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::carrier::Reference;
use crate::clustered::Clusters;
use crate::errors::Errors;
use crate::pieces::{Groups, Pieces};
use crate::relation::{DELAY, Equations, Relation};
use crate::series::Series;
use crate::standing::Standing;

/// Length of a window, s. Longer ones average out what a hand does in less; shorter ones cost time and gain nothing.
pub(crate) const WINDOW_S: f64 = 0.2;
/// Fewest samples in a window.
const FEWEST: usize = 4;
/// A rate above which a window is one of motion, rad/s. Its errors are those of stamps and of the carrier, and larger than at rest.
const MOVING: f64 = 0.1;
/// What is known of a delay and of an arm beforehand, standard deviations, s and m.
const DELAY_S: f64 = 0.05;
const ARM_M: f64 = 0.2;
/// The first parameter of the arm (m) of an accelerometer.
pub(crate) const ARM: usize = 13;

/// A window: samples `from..=to` of the further triad.
#[derive(Clone, Copy)]
struct Window {
    from: usize,
    to: usize,
    piece: usize,
    moves: bool,
}

struct Problem<'a> {
    reference: &'a Reference<'a>,
    raw: &'a Series,
    windows: Vec<Window>,
    /// Samples between the ends of a window.
    samples: usize,
    pieces: Pieces,
    parameters: usize,
}

/// The integral of the reference over a window that begins and ends so much earlier, and its derivatives by arm and delay.
struct Integral {
    sum: Vector3<f64>,
    by_arm: Matrix3<f64>,
    by_delay: Vector3<f64>,
}

/// The relation of a triad with these raw readings. `None` if the motion does not determine it.
pub(crate) fn relation(kind: TriadKind, raw: &Series, reference: &Reference) -> Option<Relation> {
    let problem = Problem::new(kind, raw, reference)?;
    Relation::of(&problem, problem.start()?)
}

/// Errors of a triad that stands so. `None` if nothing of it can be compared.
pub(crate) fn errors(
    kind: TriadKind,
    raw: &Series,
    reference: &Reference,
    standing: &Standing,
) -> Option<Errors> {
    let problem = Problem::new(kind, raw, reference)?;
    let mut at = standing.parameters(problem.parameters);
    if problem.parameters > ARM {
        at.fixed_rows_mut::<3>(ARM).copy_from(&standing.arm_m);
    }
    problem.errors(&at, &vec![true; problem.pieces.count])
}

impl<'a> Problem<'a> {
    fn new(kind: TriadKind, raw: &'a Series, reference: &'a Reference<'a>) -> Option<Self> {
        let samples = ((WINDOW_S / raw.period).round() as usize).max(FEWEST);
        let pieces = Pieces::over(&raw.t)?;
        let mut windows = Vec::new();
        let mut from = 0;
        while from + samples < raw.len() {
            let to = from + samples;
            if !raw.is_broken(from, to) {
                let middle = 0.5 * (raw.t[from] + raw.t[to]);
                let rate = reference.motion.and_then(|m| m.rate.at(middle));
                windows.push(Window {
                    from,
                    to,
                    piece: pieces.of(middle),
                    moves: rate.is_some_and(|rate| rate.norm() > MOVING),
                });
            }
            from = to;
        }
        let arm = kind == TriadKind::Accel && reference.motion.is_some();
        Some(Self {
            reference,
            raw,
            windows,
            samples,
            pieces,
            parameters: if arm { ARM + 3 } else { DELAY + 1 },
        })
    }

    /// C and o without delay and arm, by plain least squares.
    fn start(&self) -> Option<DVector<f64>> {
        let mut normal = DMatrix::<f64>::zeros(4, 4);
        let mut right = DMatrix::<f64>::zeros(4, 3);
        for window in &self.windows {
            let Some(integral) = self.integral(window, 0.0) else {
                continue;
            };
            let (sum, time) = self.raw_integral(window);
            let row = DVector::from_vec(vec![sum.x, sum.y, sum.z, time]);
            normal += &row * row.transpose();
            right += &row * integral.sum.transpose();
        }
        let scale = normal.diagonal().map(|d| d.sqrt());
        let scaled = DMatrix::from_fn(4, 4, |i, j| normal[(i, j)] / scale[i] / scale[j]);
        if !(scaled.clone().symmetric_eigen().eigenvalues.min() > 1e-9) {
            return None;
        }
        let found = scaled.try_inverse()? * DMatrix::from_fn(4, 3, |i, j| right[(i, j)] / scale[i]);
        let mut at = DVector::zeros(self.parameters);
        for axis in 0..3 {
            for k in 0..3 {
                at[3 * axis + k] = found[(k, axis)] / scale[k];
            }
            at[9 + axis] = found[(3, axis)] / scale[3];
        }
        Some(at)
    }

    /// Integral of the raw readings, and the time.
    fn raw_integral(&self, window: &Window) -> (Vector3<f64>, f64) {
        let mut sum = Vector3::zeros();
        for k in window.from..window.to {
            let between = self.raw.t[k + 1] - self.raw.t[k];
            sum += 0.5 * between * (self.raw.x[k] + self.raw.x[k + 1]);
        }
        (sum, self.raw.t[window.to] - self.raw.t[window.from])
    }

    fn integral(&self, window: &Window, delay: f64) -> Option<Integral> {
        let mut sum = Vector3::zeros();
        let mut turning = Matrix3::zeros();
        let mut last: Option<(f64, Vector3<f64>, Matrix3<f64>)> = None;
        let rate = |t: f64| match self.parameters > ARM {
            true => self.reference.motion?.rate.at(t),
            false => Some(Vector3::zeros()),
        };
        for k in window.from..=window.to {
            let t = self.raw.t[k] - delay;
            let x = self.reference.series.at(t)?;
            let square = {
                let cross = rate(t)?.cross_matrix();
                cross * cross
            };
            if let Some((before, x0, square0)) = last {
                sum += 0.5 * (t - before) * (x0 + x);
                turning += 0.5 * (t - before) * (square0 + square);
            }
            last = Some((t, x, square));
        }
        let [from, to] = [window.from, window.to].map(|k| self.raw.t[k] - delay);
        Some(Integral {
            sum,
            by_arm: (rate(to)? - rate(from)?).cross_matrix() + turning,
            by_delay: self.reference.series.at(to)? - self.reference.series.at(from)?,
        })
    }

    /// Residual of a window (a mean, SI) and its derivatives, an axis each.
    fn residual(&self, window: &Window, at: &DVector<f64>) -> Option<(Vector3<f64>, DMatrix<f64>)> {
        let integral = self.integral(window, at[DELAY])?;
        let (sum, time) = self.raw_integral(window);
        let calibration = affine(&at.fixed_rows::<12>(0).into_owned());
        let mut residual = integral.sum - calibration.matrix * sum - calibration.offset * time;
        let mut by = DMatrix::zeros(3, self.parameters);
        for axis in 0..3 {
            for k in 0..3 {
                by[(axis, 3 * axis + k)] = sum[k] / time;
            }
            by[(axis, 9 + axis)] = 1.0;
            by[(axis, DELAY)] = integral.by_delay[axis] / time;
        }
        if self.parameters > ARM {
            residual += integral.by_arm * at.fixed_rows::<3>(ARM);
            by.fixed_view_mut::<3, 3>(0, ARM)
                .copy_from(&(-integral.by_arm / time));
        }
        Some((residual / time, by))
    }
}

impl Equations for Problem<'_> {
    fn known(&self) -> DVector<f64> {
        let mut known = DVector::repeat(self.parameters, f64::INFINITY);
        known[DELAY] = DELAY_S;
        for k in ARM..self.parameters {
            known[k] = ARM_M;
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
        for window in &self.windows {
            let Some((residual, by)) = self.residual(window, at) else {
                continue;
            };
            let group = usize::from(window.moves);
            if used[window.piece] {
                groups.count(group, residual.norm_squared(), 3.0);
            }
            let weight = groups.weight(group);
            for axis in 0..3 {
                let row = by.row(axis).transpose();
                clusters.add(window.piece, residual[axis], &row, weight);
            }
        }
    }

    fn errors(&self, at: &DVector<f64>, used: &[bool]) -> Option<Errors> {
        let calibration = affine(&at.fixed_rows::<12>(0).into_owned());
        let own = self.raw.noise_of_means(self.samples) * calibration.matrix.norm_squared() / 3.0;
        let noise = own + self.reference.noise_of_means(WINDOW_S);
        let windows = self.windows.iter().filter(|w| used[w.piece]);
        let squares = windows.filter_map(|w| Some(self.residual(w, at)?.0.norm_squared() / 3.0));
        let squares: Vec<f64> = squares.collect();
        Errors::of(&squares, noise)
    }
}
