//! Equivalent degrees of freedom of an estimate, Greenhall and Riley 2003 ("GR" below; also NIST SP 1065, section
//! 5.4).

use super::super::Deviation;

/// Largest sum that the combined algorithm of GR evaluates term by term.
const J_MAX: usize = 100;

/// Meaning of a sample of the integral.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// The integral at an instant, such as the sum of rates.
    Instants,
    /// Its mean over a sample period, as GR assume for a measured phase (and Stable32 for rates too). Neighbours are then more correlated:
    /// for white rates and m = 1 GR give 782 degrees of freedom for 999 differences; 1000 independent rates have 666.
    Means,
}

/// How a variance was estimated from a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Estimator {
    /// Kind of the differences.
    pub kind: Deviation,
    /// Meaning of the samples.
    pub sampling: Sampling,
    /// Cluster length, samples.
    pub m: usize,
    /// Samples from one difference to the next.
    pub stride: usize,
    /// Number of differences.
    pub terms: usize,
}

/// Filter factor F of GR: differences of the integral itself at steps of 1/F clusters, of its mean over a cluster
/// (F = 1, modified), or the limit of many samples in a cluster.
#[derive(Clone, Copy)]
enum Filter {
    Samples(f64),
    Continuous,
}

impl Estimator {
    /// Equivalent degrees of freedom of the variance for noise with exponent `alpha` (2 to -2; to -4 for
    /// [`Deviation::Hadamard`]); at least 1.
    ///
    /// If every difference is used, this is the combined algorithm of GR, as in Stable32; otherwise the sum that it approximates, GR (13).
    ///
    /// # Panics
    /// If the variance does not exist for `alpha`, or the algorithm lacks such noise.
    pub fn edf(&self, alpha: i32) -> f64 {
        let d = self.kind.order();
        assert!(
            (2 - 2 * d as i32..=2).contains(&alpha),
            "{:?} variance of f^{alpha} noise",
            self.kind
        );
        let modified = self.modified();
        let inverse = if alpha == 2 && !modified {
            self.white_phase(d)
        } else if self.stride > 1 {
            let s = self.m as f64 / self.stride as f64;
            let filter = self.filter(alpha, d);
            basic_sum(self.terms, s, filter, alpha, d)
        } else {
            self.combined(alpha, d)
        };
        // One square has one degree of freedom, and more squares never have less: a smaller value is an error of the approximation.
        (1.0 / inverse).max(1.0)
    }

    /// Over one sample it equals the Allan variance, to which GR's continuous mean over the cluster does not apply.
    fn modified(&self) -> bool {
        self.kind == Deviation::Modified && self.m > 1
    }

    fn filter(&self, alpha: i32, d: usize) -> Filter {
        let many = self.sampling == Sampling::Instants || self.m * (d + 1) > J_MAX;
        if self.modified() {
            Filter::Samples(1.0)
        } else if alpha <= 0 && many {
            Filter::Continuous
        } else {
            Filter::Samples(self.m as f64)
        }
    }

    /// White phase noise, unmodified: differences are correlated where they share a sample, that is at whole
    /// clusters. GR, case 4, and for any stride.
    fn white_phase(&self, d: usize) -> f64 {
        let terms = self.terms as f64;
        let shared: f64 = (1..=d)
            .filter(|k| (k * self.m).is_multiple_of(self.stride))
            .map(|k| {
                let lag = (k * self.m / self.stride) as f64;
                let correlation = binomial(2 * d, d - k) / binomial(2 * d, d);
                (1.0 - lag / terms).max(0.0) * correlation.powi(2)
            })
            .sum();
        (1.0 + 2.0 * shared) / terms
    }

    /// The combined algorithm of GR: term by term for few terms, by a fit for many, by fewer terms in between.
    fn combined(&self, alpha: i32, d: usize) -> f64 {
        let (s, r) = (self.m as f64, self.terms as f64 / self.m as f64);
        let modified = self.modified();
        let filter = self.filter(alpha, d);
        if self.terms.min((d + 1) * self.m) <= J_MAX {
            return basic_sum(self.terms, s, filter, alpha, d);
        }
        let flicker_phase = alpha == 1 && !modified;
        // For flicker phase noise, s_z(0) still grows with the number of samples in a cluster: GR, table 3.
        let at_zero = match (flicker_phase, d) {
            (false, _) => None,
            (true, 2) => Some(15.23 + 12.0 * s.ln()),
            (true, _) => Some(47.8 + 40.0 * s.ln()),
        };
        if r >= (d + 1) as f64 {
            let (a0, a1) = many(alpha, d, modified);
            return (a0 - a1 / r) / (r * at_zero.map_or(1.0, |z| z * z));
        }
        let fewer = J_MAX as f64 / r;
        match (at_zero, modified) {
            (Some(z), _) => {
                let filter = Filter::Samples(fewer);
                basic_sum(J_MAX, fewer, filter, alpha, d) * (s_z(0.0, filter, alpha, d) / z).powi(2)
            }
            (None, true) => basic_sum(J_MAX, fewer, filter, alpha, d),
            (None, false) => basic_sum(J_MAX, fewer, Filter::Continuous, alpha, d),
        }
    }
}

/// GR, tables 1 and 2: the inverse is (a0 - a1/r)/r for r clusters.
fn many(alpha: i32, d: usize, modified: bool) -> (f64, f64) {
    match (modified, d, alpha) {
        (true, _, 2) => (7.0 / 9.0, 1.0 / 2.0),
        (true, _, 1) => (0.997, 0.616),
        (true, _, 0) => (1.033, 0.607),
        (true, _, -1) => (1.048, 0.534),
        (true, _, _) => (1.302, 0.535),
        (false, 2, 1) => (790.0, 410.0),
        (false, 2, 0) => (2.0 / 3.0, 1.0 / 3.0),
        (false, 2, -1) => (0.852, 0.375),
        (false, 2, _) => (1.079, 0.368),
        (false, _, 1) => (9950.0, 6520.0),
        (false, _, 0) => (7.0 / 9.0, 1.0 / 2.0),
        (false, _, -1) => (0.997, 0.617),
        (false, _, -2) => (1.033, 0.607),
        (false, _, -3) => (1.053, 0.553),
        (false, _, _) => (1.302, 0.535),
    }
}

/// GR (10) and (13): inverse degrees of freedom of `terms` differences, `s` of which begin within a cluster: the
/// sum of their squared correlations.
fn basic_sum(terms: usize, s: f64, filter: Filter, alpha: i32, d: usize) -> f64 {
    let n = terms as f64;
    let correlation = |j: usize| s_z(j as f64 / s, filter, alpha, d).powi(2);
    let j = terms.min(((d + 1) as f64 * s).ceil() as usize);
    let pairs: f64 = (1..j).map(|k| (1.0 - k as f64 / n) * correlation(k)).sum();
    let zero = correlation(0);
    (zero + 2.0 * pairs + (1.0 - j as f64 / n) * correlation(j)) / (zero * n)
}

/// GR (9): autocovariance of the 2d-th central difference, over t clusters.
fn s_z(t: f64, filter: Filter, alpha: i32, d: usize) -> f64 {
    (0..=2 * d)
        .map(|k| {
            let sign = if (k + d).is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * binomial(2 * d, k) * s_x(t + k as f64 - d as f64, filter, alpha)
        })
        .sum()
}

/// GR (8): generalized autocovariance of the filtered integral.
fn s_x(t: f64, filter: Filter, alpha: i32) -> f64 {
    match filter {
        Filter::Continuous => s_w(t, alpha + 2),
        Filter::Samples(f) if alpha == 1 && f > 1.0 => {
            // (8) in samples u = tf: its terms are f² times larger than their sum, which is lost at f = 1e8.
            let u = (t * f).abs();
            if u > 1e3 {
                -(2.0 * (u / f).ln() + 3.0)
            } else {
                2.0 * s_w(u, 1) - s_w(u - 1.0, 1) - s_w(u + 1.0, 1) + 2.0 * f.ln()
            }
        }
        Filter::Samples(f) => {
            f * f * (2.0 * s_w(t, alpha) - s_w(t - 1.0 / f, alpha) - s_w(t + 1.0 / f, alpha))
        }
    }
}

/// GR (7): generalized autocovariance of the integral.
fn s_w(t: f64, alpha: i32) -> f64 {
    let t = t.abs();
    let power = t.powi(3 - alpha);
    match alpha {
        2 | -2 => -power,
        0 | -4 => power,
        _ if t == 0.0 => 0.0,
        -1 => -power * t.ln(),
        _ => power * t.ln(),
    }
}

/// Binomial coefficient of small numbers.
fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |c, i| c * (n - i) as f64 / (i + 1) as f64)
}
