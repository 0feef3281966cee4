//! A normal variable whose mean and variance are themselves uncertain, as a weighted sum of normal distributions.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Half of all values of a standard normal variable are nearer to zero than this.
const PROBABLE_ERROR: f64 = 0.674_489_750_196_082;

/// Components: weight, mean and variance.
#[derive(Debug, Clone, Default)]
pub struct Mixture(Vec<[f64; 3]>);

/// Student's distribution nearest to a mixture: it has the same half-widths of 50 and of 95 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// Centre.
    pub mean: f64,
    /// Square of the scale; times Student's factor for [`Self::dof`] its root is the half-width of the 95 % interval.
    pub variance: f64,
    /// Degrees of freedom.
    pub dof: f64,
    /// Half of the 95 % interval.
    pub half_width: f64,
}

impl Mixture {
    /// Of components `[weight, mean, variance]`; the weights need not add up to one.
    pub fn new(mut components: Vec<[f64; 3]>) -> Self {
        let total: f64 = components.iter().map(|c| c[0]).sum();
        components.iter_mut().for_each(|c| c[0] /= total);
        // Components without weight cost time and change nothing.
        components.retain(|c| c[0] > 1e-12);
        Self(components)
    }

    /// Of mixtures with these weights, which add up to one.
    pub fn average<'a>(all: impl Iterator<Item = (&'a Self, f64)>) -> Self {
        let each =
            all.flat_map(|(mixture, by)| mixture.0.iter().map(move |[w, m, v]| [by * w, *m, *v]));
        Self::new(each.collect())
    }

    /// Mean.
    pub fn mean(&self) -> f64 {
        self.0.iter().map(|[w, m, _]| w * m).sum()
    }

    /// The same with an independent normal error of this variance added.
    pub fn plus(&self, variance: f64) -> Self {
        Self(
            self.0
                .iter()
                .map(|[w, m, v]| [*w, *m, v + variance])
                .collect(),
        )
    }

    /// Probability of a value that is farther from `centre` than `distance`.
    pub fn beyond(&self, centre: f64, distance: f64) -> f64 {
        let normal = Normal::standard();
        let tail = |[w, m, v]: &[f64; 3]| {
            let sigma = v.max(f64::MIN_POSITIVE).sqrt();
            let [a, b] = [distance - (centre - m), distance + (centre - m)];
            w * (normal.sf(a / sigma) + normal.sf(b / sigma))
        };
        self.0.iter().map(tail).sum::<f64>().min(1.0)
    }

    /// Half of the interval about its mean that contains this share.
    pub fn half_width(&self, share: f64) -> f64 {
        let mean = self.mean();
        let largest = |v: f64, c: &[f64; 3]| v.max(c[2].sqrt() + (c[1] - mean).abs());
        let (mut low, mut high) = (0.0, self.0.iter().fold(0.0, largest));
        while self.beyond(mean, high) > 1.0 - share && high < f64::MAX / 4.0 {
            high *= 2.0;
        }
        // 60 halvings exhaust the digits.
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            match self.beyond(mean, middle) > 1.0 - share {
                true => low = middle,
                false => high = middle,
            }
        }
        high
    }

    /// The nearest Student's distribution.
    pub fn matched(&self) -> Matched {
        let [half, probable] = [0.95, 0.5].map(|share| self.half_width(share));
        let ratio = half / probable;
        let dof = degrees_of_freedom(ratio);
        Matched {
            mean: self.mean(),
            variance: (half / quantile(dof, 0.975)).powi(2),
            dof,
            half_width: half,
        }
    }
}

/// Above this many degrees of freedom Student's distribution is taken as normal.
const NORMAL_DOF: f64 = 200.0;

fn quantile(dof: f64, p: f64) -> f64 {
    match dof < NORMAL_DOF {
        true => StudentsT::new(0.0, 1.0, dof).map_or(f64::NAN, |t| t.inverse_cdf(p)),
        false if p == 0.75 => PROBABLE_ERROR,
        false => mimu_recording::NORMAL_95,
    }
}

/// Degrees of freedom of Student's distribution with this ratio of the half-widths of 95 and of 50 %.
fn degrees_of_freedom(ratio: f64) -> f64 {
    let of = |dof: f64| quantile(dof, 0.975) / quantile(dof, 0.75);
    if ratio <= of(NORMAL_DOF - 1.0) {
        return f64::INFINITY;
    }
    let (mut low, mut high) = (0.3, NORMAL_DOF - 1.0);
    for _ in 0..40 {
        let middle = f64::sqrt(low * high);
        match of(middle) > ratio {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_component_is_a_normal_distribution() {
        let one = Mixture::new(vec![[3.0, 5.0, 4.0]]);
        let matched = one.matched();
        assert!((matched.mean - 5.0).abs() < 1e-12);
        assert!((matched.half_width - 2.0 * 1.959_964).abs() < 1e-5);
        assert_eq!(matched.dof, f64::INFINITY);
        assert!((one.beyond(5.0, 2.0) - 0.317_311).abs() < 1e-5);
        assert!((one.plus(5.0).half_width(0.95) - 3.0 * 1.959_964).abs() < 1e-5);
    }

    #[test]
    fn variances_of_an_inverse_chi_square_distribution_give_students() {
        // A variance of nu / chi-square of nu degrees makes Student's distribution; factors from printed tables.
        for (dof, factor) in [(3.0, 3.1824), (8.0, 2.3060)] {
            let component = |k: i32| {
                let chi: f64 = (0.02 * f64::from(k)).exp();
                // Density of chi-square by its logarithm.
                [(0.5 * dof * chi.ln() - 0.5 * chi).exp(), 0.0, dof / chi]
            };
            let all = Mixture::new((-800..400).map(component).collect());
            let matched = all.matched();
            assert!((matched.half_width - factor).abs() < 2e-3, "{matched:?}");
            assert!((matched.dof - dof).abs() < 0.05 * dof, "{matched:?}");
            assert!((matched.variance - 1.0).abs() < 0.02, "{matched:?}");
        }
    }
}
