//! Covariance of means of a bias that wanders.
//!
//! Flicker noise and a random walk have no finite variance, only their differences have one. A covariance therefore needs an origin. Here
//! that is their mean over the session: the bias of a calibration contains it, and nothing in the recording distinguishes it from the rest
//! of the bias.

use nalgebra::DMatrix;

use mimu_allan::model::FLOOR;
use mimu_allan::variance::AllanModel;

/// Slow noise of one channel, by its spectrum: `S(f) = B²/(2π f) + K²/(2π f)²`, two-sided.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Slow {
    /// Bias instability B, unit.
    pub instability: f64,
    /// Rate random walk K, unit/√s.
    pub walk: f64,
}

impl From<AllanModel> for Slow {
    fn from(model: AllanModel) -> Self {
        Self {
            instability: (model.flicker / FLOOR).sqrt(),
            walk: (3.0 * model.walk).sqrt(),
        }
    }
}

/// An interval of time: its beginning and its end, s.
pub type Span = [f64; 2];

impl Slow {
    /// Generalized covariance of the means over two spans, unit²: valid only in sums of means whose weights add to zero, and exact there.
    ///
    /// Between instants it is `-(B²/π) ln|t| - K²/2 |t|` (the transforms of the spectra), integrated twice here.
    fn between(&self, a: Span, b: Span) -> f64 {
        let twice = |second: &dyn Fn(f64) -> f64| {
            let sum = second(b[1] - a[0]) - second(b[0] - a[0]) - second(b[1] - a[1])
                + second(b[0] - a[1]);
            sum / ((a[1] - a[0]) * (b[1] - b[0]))
        };
        let flicker = twice(&|t| {
            let log = if t == 0.0 { 0.0 } else { t.abs().ln() };
            t * t * (0.5 * log - 0.75)
        });
        // Of spans that do not overlap the walk shows the distance of the middles. By differences of cubes it lost so many digits over two hours that
        // the covariance of 1000 dwells was no sum of two terms any more, and a diagnosis took a dense factor.
        let walk = match a[1] <= b[0] || b[1] <= a[0] {
            true => 0.5 * (0.5 * (b[0] + b[1] - a[0] - a[1])).abs(),
            false => twice(&|t| t.abs().powi(3)) / 12.0,
        };
        -self.instability.powi(2) / std::f64::consts::PI * flicker - self.walk.powi(2) * walk
    }

    /// Covariance of the means over `spans`, each minus the mean over the `session`, unit².
    pub fn covariance(&self, spans: &[Span], session: Span) -> DMatrix<f64> {
        let with_all: Vec<f64> = spans.iter().map(|s| self.between(*s, session)).collect();
        let all = self.between(session, session);
        DMatrix::from_fn(spans.len(), spans.len(), |i, j| {
            self.between(spans[i], spans[j]) - with_all[i] - with_all[j] + all
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: [Slow; 2] = [
        Slow {
            instability: 2.0,
            walk: 0.0,
        },
        Slow {
            instability: 0.0,
            walk: 0.3,
        },
    ];

    #[test]
    fn neighbouring_means_have_the_allan_variance_of_the_coefficients() {
        // IEEE Std 952, annex C: (2 ln 2/π) B² and K² τ/3.
        for tau in [0.5, 20.0, 300.0] {
            let known = [
                4.0 * 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI,
                0.09 * tau / 3.0,
            ];
            for (slow, known) in SLOW.iter().zip(known) {
                let spans = [[100.0, 100.0 + tau], [100.0 + tau, 100.0 + 2.0 * tau]];
                let c = slow.covariance(&spans, [0.0, 5000.0]);
                let allan = 0.5 * (c[(0, 0)] + c[(1, 1)]) - c[(0, 1)];
                assert!(
                    (allan / known - 1.0).abs() < 1e-6,
                    "{slow:?} {tau}: {allan}"
                );
            }
        }
    }

    #[test]
    fn a_random_walk_differs_from_its_mean_as_it_is_known_to() {
        // At one end of a session of length T: K² T/3; in its middle: K² T/12.
        let c = SLOW[1].covariance(&[[0.0, 1e-3], [500.0, 500.001]], [0.0, 1000.0]);
        for (i, known) in [(0, 1000.0 / 3.0), (1, 1000.0 / 12.0)] {
            assert!((c[(i, i)] / (0.09 * known) - 1.0).abs() < 1e-4, "{c}");
        }
    }

    #[test]
    fn means_that_fill_the_session_add_up_to_nothing() {
        let spans: Vec<Span> = (0..10)
            .map(|i| [20.0 * f64::from(i), 20.0 * f64::from(i + 1)])
            .collect();
        for slow in SLOW {
            let c = slow.covariance(&spans, [0.0, 200.0]);
            assert!(c.row_sum().amax() < 1e-9 * c.amax());
            assert!(c.symmetric_eigen().eigenvalues.min() > -1e-9);
        }
    }
}
