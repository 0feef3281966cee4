//! The curves of a triad: its forward model at every temperature of the die, with its covariance.

use mimu::triad::{Angles, Covariance, Forward, Part, Triad};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::reference_error::CommonErrors;
use crate::regression::{CurveKind, Problem};
use crate::smoothness::{Smoothness, TriadFit};

/// An estimate for one lag.
#[derive(Debug, Clone)]
pub struct LagFit {
    /// The estimate.
    pub fit: TriadFit,
    /// Likelihood of the lag; those of all sum to one.
    pub likelihood: f64,
    /// Its share in the curves; those of all sum to one. It equals the likelihood, unless the curves must be those of one lag.
    pub share: f64,
}

/// Curves of one triad. Their covariance includes all lags that the data allow.
#[derive(Debug, Clone)]
pub struct TriadCurves {
    problem: Problem,
    fits: Vec<LagFit>,
    common: CommonErrors,
    /// Temperatures of the die in the recordings, °C.
    pub range_c: [f64; 2],
}

/// Twelve numbers of a forward model: P by rows, then b.
type Twelve = SVector<f64, 12>;

impl TriadCurves {
    /// From `fits`.
    pub fn new(problem: Problem, fits: Vec<LagFit>, range_c: [f64; 2]) -> Self {
        Self {
            problem,
            fits,
            common: CommonErrors::default(),
            range_c,
        }
    }

    /// The same, with errors of the reference in the covariance.
    pub(crate) fn count(&mut self, common: CommonErrors) {
        self.common = common;
    }

    /// From one estimate, for a known lag.
    pub fn of_one(problem: Problem, fit: TriadFit, range_c: [f64; 2]) -> Self {
        let (likelihood, share) = (1.0, 1.0);
        let only = LagFit {
            fit,
            likelihood,
            share,
        };
        Self::new(problem, vec![only], range_c)
    }

    /// What they were estimated from.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Whether the scale factors and cross terms are unknown.
    pub fn biases_only(&self) -> bool {
        self.problem.biases_only
    }

    /// Forward model at `temp_c` of the die, SI to raw, and its derivative by temperature, per kelvin.
    pub fn forward(&self, temp_c: f64) -> [Forward; 2] {
        let mut sum = [Twelve::zeros(); 2];
        for of in &self.fits {
            for (derivative, sum) in sum.iter_mut().enumerate() {
                *sum += self.numbers(&of.fit, temp_c, derivative == 1) * of.share;
            }
        }
        sum.map(|s| forward(&s))
    }

    /// Covariance of the forward model at `temp_c`, in the order of [`mimu::triad::vector`], from the noise, the lag and errors of the reference.
    pub fn covariance(&self, temp_c: f64) -> Covariance {
        let [model, _] = self.forward(temp_c);
        self.covariance_by_noise(temp_c) + self.common.covariance(&model)
    }

    /// The same without errors of the reference.
    fn covariance_by_noise(&self, temp_c: f64) -> Covariance {
        let numbers = |of: &LagFit| self.numbers(&of.fit, temp_c, false);
        let each: Vec<Twelve> = self.fits.iter().map(numbers).collect();
        let shares = self.fits.iter().map(|of| of.share);
        let value: Twelve = each.iter().zip(shares).map(|(n, share)| n * share).sum();
        let mut covariance = Covariance::zeros();
        for (of, numbers) in self.fits.iter().zip(&each) {
            let off = numbers - value;
            covariance += (self.within(&of.fit, temp_c) + off * off.transpose()) * of.likelihood;
        }
        covariance
    }

    /// Calibration at `temp_c` of the die, with its covariance. `None` if P is singular or not estimated.
    pub fn triad(&self, temp_c: f64) -> Option<Triad> {
        if self.biases_only() {
            return None;
        }
        let [model, _] = self.forward(temp_c);
        let part = Part::known(self.covariance(temp_c));
        Triad::from_forward(model, vec![part])
    }

    /// Condition of the design at `temp_c`, as the covariance of the model there shows it: ratio of the largest to the smallest standard
    /// deviation of a combination of the parameters of one axis, in units of their own standard deviations.
    pub fn condition(&self, temp_c: f64) -> f64 {
        let covariance = self.covariance_by_noise(temp_c);
        let of_axis = |axis: usize| {
            let places = [3 * axis, 3 * axis + 1, 3 * axis + 2, 9 + axis];
            let correlation = nalgebra::Matrix4::from_fn(|i, j| {
                let [a, b] = [places[i], places[j]];
                covariance[(a, b)] / (covariance[(a, a)] * covariance[(b, b)]).sqrt()
            });
            let values = correlation.symmetric_eigenvalues();
            (values.max() / values.min().max(f64::MIN_POSITIVE)).sqrt()
        };
        (0..3).map(of_axis).fold(1.0, f64::max)
    }

    /// Smoothness at the likeliest lag.
    pub fn smoothness(&self) -> Option<Smoothness> {
        let likelier = |a: &&LagFit, b: &&LagFit| a.likelihood.total_cmp(&b.likelihood);
        Some(self.fits.iter().max_by(likelier)?.fit.smoothness)
    }

    /// Scale factors at `temp_c`, raw per SI: norms of the rows of P; ones if only biases are estimated.
    pub fn scale(&self, temp_c: f64) -> Vector3<f64> {
        match self.triad(temp_c) {
            Some(triad) => triad.physical(Angles::Exact).scale.map(|s| s.value).into(),
            None => Vector3::repeat(1.0),
        }
    }

    /// Bias of a session in its first pose, minus that of the first session, raw.
    pub fn session_offset(&self, session: usize) -> Vector3<f64> {
        self.pose_offset(session, 0)
    }

    /// The same after this many moves of the unit.
    pub fn pose_offset(&self, session: usize, moves: usize) -> Vector3<f64> {
        let mut offset = Vector3::zeros();
        let mut rows = self.problem.rows.iter();
        let first = rows.find(|r| r.session == session).map_or(0, |r| r.offset);
        let number = first + moves;
        if number == 0 || number >= self.problem.offsets {
            return offset;
        }
        for of in &self.fits {
            for axis in 0..3 {
                let column = self.problem.columns(axis) - self.problem.offsets + number;
                offset[axis] +=
                    of.share * of.fit.axes[axis].coefficients[column] * self.problem.gain[axis];
            }
        }
        offset
    }

    /// Change of the biases between two temperatures of the die, raw, with its covariance.
    pub fn bias_change(&self, from_c: f64, to_c: f64) -> (Vector3<f64>, Matrix3<f64>) {
        let each: Vec<(&LagFit, Vector3<f64>, Vector3<f64>)> = self
            .fits
            .iter()
            .map(|of| {
                let change_of = |axis| self.bias_change_of(&of.fit, axis, [from_c, to_c]);
                let of_axes = [0, 1, 2].map(change_of);
                let [change, variance] = [0, 1].map(|k| Vector3::from(of_axes.map(|a| a[k])));
                (of, change, variance)
            })
            .collect();
        let value: Vector3<f64> = each.iter().map(|(of, change, _)| change * of.share).sum();
        let covariance = each.iter().map(|(of, change, variance)| {
            let off = change - value;
            (Matrix3::from_diagonal(variance) + off * off.transpose()) * of.likelihood
        });
        (value, covariance.sum())
    }

    /// The same of one axis for one lag: change and variance.
    fn bias_change_of(&self, fit: &TriadFit, axis: usize, temps: [f64; 2]) -> [f64; 2] {
        let (problem, fitted) = (&self.problem, &fit.axes[axis]);
        let basis = problem.basis(CurveKind::Bias);
        let parts = problem.parts(axis);
        let first = parts
            .iter()
            .find(|p| p.input.is_none())
            .map_or(0, |p| p.from);
        let mut terms = Vec::new();
        for (temp_c, sign) in temps.into_iter().zip([-1.0, 1.0]) {
            let (from, values) = basis.values(temp_c);
            let used = values.iter().take(basis.functions() - from).enumerate();
            terms.extend(used.map(|(k, v)| (first + from + k, sign * v)));
        }
        let change: f64 = terms.iter().map(|(k, v)| v * fitted.coefficients[*k]).sum();
        let pairs = terms.iter().flat_map(|a| terms.iter().map(move |b| (a, b)));
        let variance: f64 = pairs
            .map(|(a, b)| a.1 * b.1 * fitted.covariance[(a.0, b.0)])
            .sum();
        let gain = problem.gain[axis];
        [gain * change, gain * gain * variance.max(0.0)]
    }

    /// Standard deviation of a curve's departure from a line over the range, by the smoothness of `kind`; zero for a line.
    pub fn departure(&self, kind: CurveKind) -> f64 {
        let span = self.range_c[1] - self.range_c[0];
        let mean: f64 = self
            .fits
            .iter()
            .map(|of| of.likelihood * of.fit.smoothness[kind as usize][0])
            .sum();
        (mean * span.powi(3) / 48.0).sqrt()
    }

    fn numbers(&self, fit: &TriadFit, temp_c: f64, derivative: bool) -> Twelve {
        let problem = &self.problem;
        let mut out = Twelve::zeros();
        for axis in 0..3 {
            let gain = problem.gain[axis];
            for part in problem.parts(axis) {
                let basis = problem.basis(part.kind);
                let (from, values) = match derivative {
                    true => basis.slopes(temp_c),
                    false => basis.values(temp_c),
                };
                let coefficients = &fit.axes[axis].coefficients;
                let used = values.iter().take(basis.functions() - from).enumerate();
                let value: f64 = used
                    .map(|(k, v)| v * coefficients[part.from + from + k])
                    .sum();
                out[index(axis, part.input)] = value * gain;
            }
            if !derivative {
                out[9 + axis] += problem.null[axis];
                out[3 * axis + axis] += problem.taken_off * gain;
                if problem.biases_only {
                    out[3 * axis + axis] = 1.0;
                }
            } else if problem.biases_only {
                out[3 * axis + axis] = 0.0;
            }
        }
        out
    }

    /// Covariance from noise for one lag: the axes are independent.
    fn within(&self, fit: &TriadFit, temp_c: f64) -> Covariance {
        let problem = &self.problem;
        let mut out = Covariance::zeros();
        for axis in 0..3 {
            let gain = problem.gain[axis] * problem.gain[axis];
            let parts = problem.parts(axis);
            let values: Vec<(usize, usize, [f64; 4])> = parts
                .iter()
                .map(|p| {
                    let basis = problem.basis(p.kind);
                    let (from, v) = basis.values(temp_c);
                    (p.from + from, (basis.functions() - from).min(4), v)
                })
                .collect();
            let known = &fit.axes[axis].covariance;
            for (a, (from_a, n_a, v_a)) in parts.iter().zip(&values) {
                for (b, (from_b, n_b, v_b)) in parts.iter().zip(&values) {
                    let mut sum = 0.0;
                    for i in 0..*n_a {
                        for j in 0..*n_b {
                            sum += v_a[i] * v_b[j] * known[(from_a + i, from_b + j)];
                        }
                    }
                    out[(index(axis, a.input), index(axis, b.input))] = sum * gain;
                }
            }
        }
        out
    }
}

/// Place of a curve among the twelve numbers.
fn index(axis: usize, input: Option<usize>) -> usize {
    input.map_or(9 + axis, |i| 3 * axis + i)
}

fn forward(numbers: &Twelve) -> Forward {
    let matrix: SMatrix<f64, 3, 3> = Matrix3::from_fn(|i, j| numbers[3 * i + j]);
    Forward {
        matrix,
        bias: Vector3::from_fn(|i, _| numbers[9 + i]),
    }
}
