//! The points of a curve: mean squares of differences of the integral of the rates.

/// Terms of the Allan variance: 1/τ², 1/τ, 1, τ, τ².
pub(super) const TERMS: usize = 5;
/// 1/τ²: quantization where positive, a low-pass filter where negative.
pub(super) const PHASE: usize = 0;
/// τ²: the ramp.
pub(super) const RAMP: usize = 4;

/// Order of the differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Allan variance.
    Second,
    /// Hadamard variance, in which a ramp cancels.
    Third,
}

/// Differences of one order over one averaging factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Differences {
    pub order: Order,
    /// Averaging factor, samples.
    pub m: usize,
}

impl Differences {
    /// Weights of the integral at steps of m.
    pub fn weights(self) -> &'static [f64] {
        match self.order {
            Order::Second => &[1.0, -2.0, 1.0],
            Order::Third => &[-1.0, 3.0, -3.0, 1.0],
        }
    }

    /// Root of the variance of [`Differences::weights`] over that of the point.
    pub fn norm(self) -> f64 {
        let squares: f64 = match self.order {
            Order::Second => 2.0,
            Order::Third => 6.0,
        };
        squares.sqrt() * self.m as f64
    }

    /// Samples that one difference is taken over.
    pub fn span(self) -> usize {
        (self.weights().len() - 1) * self.m
    }

    /// How many there are in a record of `n` samples.
    pub fn count(self, n: usize) -> usize {
        (n + 1).saturating_sub(self.span())
    }

    /// Expected mean square by term of the noise, each of Allan variance 1 at τ = 1 sample (NIST SP 1065, table 6, for Hadamard).
    pub fn basis(self) -> [f64; TERMS] {
        let allan = basis(self.m as f64);
        match self.order {
            Order::Second => allan,
            Order::Third => {
                let flicker = (256f64 / 27.0).ln() / (4.0 * std::f64::consts::LN_2);
                let ratios = [10.0 / 9.0, 1.0, flicker, 0.5, 0.0];
                std::array::from_fn(|k| allan[k] * ratios[k])
            }
        }
    }

    /// Mean of the differences of a ramp of amplitude 1.
    pub fn ramp(self) -> f64 {
        match self.order {
            Order::Second => self.m as f64,
            Order::Third => 0.0,
        }
    }
}

/// Allan variance at τ = m samples of each term of amplitude 1.
pub(super) fn basis(m: f64) -> [f64; TERMS] {
    [1.0 / (m * m), 1.0 / m, 1.0, m, m * m]
}
