//! Recursive estimation of a triad's forward model while its input is known.
//!
//! Each sensor of a triad obeys `u = b + P1 x1 + P2 x2 + P3 x3 + noise` (fang (20)): four constants
//! and one scalar measurement, so three independent filters of four states (fang (26)-(28)), whose
//! state transition is the identity and whose time update (24) therefore does nothing.
//!
//! # The form of the covariance
//!
//! fang (25) as printed, `P = (I - K H) P`, subtracts nearly equal numbers, so in `f32` P may lose symmetry and positiveness. Here the
//! covariance is kept as `U W⁻¹ Uᵀ`, Bierman's (1977) `U D Uᵀ`
//! with U unit upper triangular and the diagonal inverted. It is symmetric by construction, and positive because only positive numbers are
//! added to W. Joseph's form costs twice the multiplications and needs symmetrization; a square-root information filter needs a back
//! substitution to give its state. W is stored instead of D, because Bierman's
//! `D ← D a₀/a₁` multiplies by 1 - 1/n: after 10⁷ updates in `f32` this factor is at the unit of rounding, and sigma came out 5 % too
//! large. `W ← W + f²/a` can be summed with compensation.
//!
//! The state is summed with compensation too (Kahan). With a gain of 1/n and 10⁵ samples an increment is below half a unit in the last
//! place of a 2.5 V bias in `f32` and would be lost: the filter would stop learning after about 25 000 samples while its covariance
//! continues to shrink.

use core::cmp::Ordering;

use nalgebra::{Matrix4, RealField, Vector3, Vector4};

/// Number of states of one filter: bias and three elements of a row of `P`.
pub const STATES: usize = 4;

/// Why a scalar measurement was not used; the filter is unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rejected {
    /// The measurement or the known input is infinite or not a number.
    NotFinite,
    /// The variance of the measurement is not positive.
    NoiseNotPositive,
}

impl core::fmt::Display for Rejected {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "measurement or input is not finite",
            Self::NoiseNotPositive => "measurement variance is not positive",
        })
    }
}

impl core::error::Error for Rejected {}

/// Estimate of one sensor's `[b, P1, P2, P3]`, SI to raw: mean and covariance.
///
/// Units: `b` in raw units, `P` in raw units per SI unit of input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter<T: RealField> {
    mean: [Sum<T>; STATES],
    /// Columns of U; only the entries above the diagonal are used.
    upper: [[T; STATES]; STATES],
    /// W, the inverse of the diagonal of `U W⁻¹ Uᵀ`.
    information: [Sum<T>; STATES],
}

/// Running sum with its accumulated rounding error (Kahan).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sum<T> {
    value: T,
    lost: T,
}

impl<T: RealField + Copy> Sum<T> {
    fn new(value: T) -> Self {
        Self {
            value,
            lost: T::zero(),
        }
    }

    #[inline(always)]
    fn add(&mut self, increment: T) {
        let increment = increment + self.lost;
        let sum = self.value + increment;
        self.lost = increment - (sum - self.value);
        self.value = sum;
    }
}

impl<T: RealField + Copy> Filter<T> {
    /// Filter with prior mean `mean` and independent prior `variance`s. These must be positive; otherwise the filter refuses every
    /// measurement.
    pub fn with_prior(mean: [T; STATES], variance: [T; STATES]) -> Self {
        Self {
            mean: mean.map(Sum::new),
            upper: [[T::zero(); STATES]; STATES],
            information: variance.map(|v| Sum::new(v.recip())),
        }
    }

    /// Filter with a diffuse prior: zero mean, and a variance that is infinite to rounding.
    ///
    /// `noise` is the variance R of the measurements to come and `span` the magnitude of the inputs to come (SI). The prior variance D is
    /// `R/ε` for the bias and `R/(ε span²)` for the rest, with ε the unit of rounding. A smaller D pulls the result towards zero by `R/D`.
    /// A larger D harms too: a direction that is already measured is known to ε only, and seems to keep the variance `ε² D`. At `R/ε` both
    /// errors are at rounding.
    pub fn diffuse(noise: T, span: T) -> Self {
        let bias = noise / T::default_epsilon();
        let row = bias / (span * span);
        Self::with_prior([T::zero(); STATES], [bias, row, row, row])
    }

    /// Updates the filter with the reading `raw` at the known `input` (SI); `noise` is the variance of the reading (raw units squared).
    /// This is fang (25) for one scalar, in Bierman's form.
    ///
    /// Returns the innovation, `raw` minus its prediction, with its predicted variance.
    #[inline]
    pub fn update(
        &mut self,
        input: &Vector3<T>,
        raw: T,
        noise: T,
    ) -> Result<Innovation<T>, Rejected> {
        if noise <= T::zero() {
            return Err(Rejected::NoiseNotPositive);
        }
        let h = [T::one(), input.x, input.y, input.z];
        // Column by column: b is the unscaled gain, a the predicted variance from the states so far.
        let (mut a, mut predicted) = (noise, T::zero());
        let mut upper = self.upper;
        let (mut b, mut growth) = ([T::zero(); STATES], [T::zero(); STATES]);
        for j in 0..STATES {
            let mut f = h[j];
            for i in 0..j {
                f += upper[j][i] * h[i];
            }
            let v = f / self.information[j].value;
            // Factor of the change of the column of U.
            let l = -f / a;
            a += v * f;
            growth[j] = -f * l;
            for i in 0..j {
                let u = upper[j][i];
                upper[j][i] = u + b[i] * l;
                b[i] += u * v;
            }
            b[j] = v;
            predicted += h[j] * self.mean[j].value;
        }
        let innovation = raw - predicted;
        let step = innovation / a;
        // This one test finds every NaN and infinity in raw, input, noise and state, and every overflow on the way.
        let sum = growth.iter().fold(T::zero(), |sum, growth| sum + *growth);
        if !(step + sum).is_finite() {
            return Err(Rejected::NotFinite);
        }

        self.upper = upper;
        for j in 0..STATES {
            self.information[j].add(growth[j]);
            self.mean[j].add(b[j] * step);
        }
        Ok(Innovation {
            value: innovation,
            variance: a,
        })
    }

    /// `[b, P1, P2, P3]`: raw units, raw units per SI.
    pub fn mean(&self) -> Vector4<T> {
        Vector4::from(self.mean.map(|m| m.value))
    }

    /// Covariance `U W⁻¹ Uᵀ` of [`Self::mean`], 4x4, symmetric and positive definite.
    pub fn covariance(&self) -> Matrix4<T> {
        let upper = Matrix4::from_fn(|i, j| match i.cmp(&j) {
            Ordering::Less => self.upper[j][i],
            Ordering::Equal => T::one(),
            Ordering::Greater => T::zero(),
        });
        let scaled = upper * Matrix4::from_diagonal(&self.diagonal());
        let covariance = scaled * upper.transpose();
        // The product of the factors rounds differently above and below the diagonal.
        let half = T::one() / (T::one() + T::one());
        (covariance + covariance.transpose()) * half
    }

    /// Diagonal W⁻¹ of the factored covariance; every element is positive at all times.
    pub fn diagonal(&self) -> Vector4<T> {
        Vector4::from(self.information.map(|w| w.value.recip()))
    }
}

/// Innovation of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<T> {
    /// Measurement minus prediction, raw units.
    pub value: T,
    /// Its predicted variance, raw units squared.
    pub variance: T,
}

/// Bank of three filters, one for each sensor of a triad: fang (26)-(28).
///
/// ```
/// # use mimu_core::kalman::Bank;
/// # use nalgebra::Vector3;
/// // An ideal gyro, 0.3 V per rad/s around 2.5 V, turned both ways about each axis and at rest.
/// let mut bank = Bank::<f64>::diffuse(&Vector3::repeat(1e-6), 1.0);
/// let rest = [Vector3::zeros()];
/// let turns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| [axis, -axis]);
/// for rate in turns.into_iter().flatten().chain(rest) {
///     let raw = rate * 0.3 + Vector3::repeat(2.5);
///     bank.update(&rate, &raw, &Vector3::repeat(1e-6)).unwrap();
/// }
/// let z = bank.axes[2].mean();
/// assert!((z[0] - 2.5).abs() < 1e-9 && (z[3] - 0.3).abs() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bank<T: RealField> {
    /// Filters of the sensors x, y, z.
    pub axes: [Filter<T>; 3],
}

impl<T: RealField + Copy> Bank<T> {
    /// Bank with a diffuse prior; see [`Filter::diffuse`]. `noise`: variances (raw units
    /// squared) of the three sensors; `span`: magnitude of the inputs to come (SI).
    pub fn diffuse(noise: &Vector3<T>, span: T) -> Self {
        Self {
            axes: [noise.x, noise.y, noise.z].map(|noise| Filter::diffuse(noise, span)),
        }
    }

    /// Updates the filters with one reading of the triad at a known `input` (SI), one scalar at a time.
    ///
    /// All three filters get the reading. The first refusal is returned; only filters that refuse are unchanged.
    #[inline]
    pub fn update(
        &mut self,
        input: &Vector3<T>,
        raw: &Vector3<T>,
        noise: &Vector3<T>,
    ) -> Result<(), Rejected> {
        let mut taken = Ok(());
        for (axis, filter) in self.axes.iter_mut().enumerate() {
            taken = taken.and(filter.update(input, raw[axis], noise[axis]).map(|_| ()));
        }
        taken
    }
}
