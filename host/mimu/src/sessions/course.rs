//! How parameters go from session to session: constant, along a slope, on a random walk, or by one step.
//!
//! A slope makes a step between its halves as improbable as a real one does, and so does a walk. A step is therefore named only if it explains the sessions better
//! than the others. Each course is a covariance of the values about their mean, beside that of the fits and of power-ons: all have one more variance, so their
//! restricted likelihoods, averaged over the same variances, compare.

use nalgebra::{DMatrix, DVector};

use super::contradiction::Triads;

/// How parameters go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// Alike in all sessions.
    Constant,
    /// The same change from each session to the next.
    Slope,
    /// An independent change from each session to the next.
    Walk,
    /// One value before a session, another since.
    Step,
}

/// Standard deviations of what is averaged over, in typical errors of a session.
const SIZES: [f64; 8] = [0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];

/// The course that explains `sessions` best. Without `biases` only scale factors and angles count.
pub fn best(triads: &[Triads], sessions: &[usize], biases: bool) -> Course {
    let [first, last] = [sessions[0], sessions[sessions.len() - 1]].map(|s| s as f64);
    // All change by one from the first session to the last.
    let along = |s: usize| (s as f64 - first) / (last - first);
    let of = |change: &dyn Fn(usize, usize) -> f64| evidence(triads, change, biases);
    let splits = &sessions[2..sessions.len() - 1];
    let steps = splits
        .iter()
        .map(|at| of(&|a, b| f64::from(u8::from(a >= *at && b >= *at))));
    let steps: Vec<f64> = steps.collect();
    let most = steps.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let average = steps.iter().map(|e| (e - most).exp()).sum::<f64>() / steps.len() as f64;
    let all = [
        (Course::Constant, of(&|_, _| 0.0)),
        (Course::Slope, of(&|a, b| along(a) * along(b))),
        (Course::Walk, of(&|a, b| along(a.min(b)))),
        (Course::Step, most + average.ln()),
    ];
    let best = all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or(Course::Constant, |(course, _)| course)
}

/// Logarithm of the probability of the values of all parameters, whose changes have a covariance between two sessions in proportion to `change`.
fn evidence(triads: &[Triads], change: &dyn Fn(usize, usize) -> f64, biases: bool) -> f64 {
    let mut sum = 0.0;
    for triad in triads.iter().filter(|t| t.sessions.len() > 3) {
        let numbers: Vec<usize> = triad.sessions.iter().map(|(s, _)| *s).collect();
        let n = numbers.len();
        let changes = DMatrix::from_fn(n, n, |i, j| change(numbers[i], numbers[j]));
        for i in (0..triad.bias.len()).filter(|i| biases || !triad.bias[*i]) {
            let of = triad
                .sessions
                .iter()
                .map(|(_, e)| (e.values[i], e.covariance[(i, i)]));
            let (values, fits): (Vec<f64>, Vec<f64>) = of.unzip();
            let unit = (fits.iter().sum::<f64>() / n as f64)
                .max(f64::MIN_POSITIVE)
                .sqrt();
            let values = DVector::from_fn(n, |s, _| (values[s] - values[0]) / unit);
            let of = |between: f64, size: f64| {
                let own = |s: usize| fits[s] / (unit * unit) + between * between;
                let own = DMatrix::from_diagonal(&DVector::from_fn(n, |s, _| own(s)));
                restricted(&values, &(own + &changes * (size * size)))
            };
            let grid = SIZES
                .iter()
                .flat_map(|b| SIZES.iter().map(move |s| (*b, *s)));
            let logs: Vec<f64> = grid.map(|(b, s)| of(b, s)).collect();
            let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let average = logs.iter().map(|l| (l - most).exp()).sum::<f64>() / logs.len() as f64;
            sum += most + average.ln();
        }
    }
    sum
}

/// Logarithm of the restricted likelihood of values with an unknown mean.
fn restricted(values: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let Some(factor) = covariance.clone().cholesky() else {
        return f64::NEG_INFINITY;
    };
    let ones = DVector::from_element(values.len(), 1.0);
    let [weighted, of_ones] = [values, &ones].map(|v| factor.solve(v));
    let normal = ones.dot(&of_ones);
    let determinant = 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
    -0.5 * (determinant + normal.ln() + values.dot(&weighted)
        - ones.dot(&weighted).powi(2) / normal)
}

#[cfg(test)]
mod tests {
    use super::super::between::{Estimates, Kinds};
    use super::*;

    /// How many of 60 units of nine sessions with eight parameters each have each course: constant, slope, walk, step.
    fn shares(of: impl Fn(usize, &mut dyn FnMut() -> f64) -> Vec<f64>) -> [usize; 4] {
        let mut state = 7_u64;
        let mut even = move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut normal =
            move || (-2.0 * (1.0 - even()).ln()).sqrt() * (std::f64::consts::TAU * even()).cos();
        let mut counts = [0; 4];
        for _ in 0..60 {
            let columns: Vec<Vec<f64>> = (0..8).map(|k| of(k, &mut normal)).collect();
            let mut one = |s: usize| Estimates {
                values: DVector::from_fn(8, |k, _| 300.0 + columns[k][s] + normal()),
                covariance: DMatrix::identity(8, 8),
            };
            let sessions: Vec<(usize, Estimates)> = (0..9).map(|s| (s, one(s))).collect();
            let triad = Triads {
                sessions,
                bias: vec![false; 8],
                kinds: Kinds::default(),
                priors: Vec::new(),
            };
            counts[best(&[triad], &[0, 1, 2, 3, 4, 5, 6, 7, 8], true) as usize] += 1;
        }
        counts
    }

    #[test]
    fn the_course_of_the_parameters_is_recognised() {
        let [still, ..] = shares(|_, normal| (0..9).map(|_| normal()).collect());
        let [_, slope, ..] = shares(|_, normal| {
            let each = 1.5 * normal();
            (0..9).map(|s| each * s as f64).collect()
        });
        // A walk may look like a slope, and not like a step.
        let [_, sloping, walk, stepping] = shares(|_, normal| {
            let mut at = 0.0;
            let next = |_| {
                at += 2.0 * normal();
                at
            };
            (0..9).map(next).collect()
        });
        let [.., step] = shares(|_, normal| {
            let by = 5.0 * normal();
            (0..9).map(|s| if s < 4 { 0.0 } else { by }).collect()
        });
        let all = [still, slope, sloping + walk, step];
        assert!(all.iter().all(|right| *right >= 54), "{all:?}");
        assert!(walk >= 40 && stepping <= 3, "{walk} {sloping} {stepping}");
    }
}
