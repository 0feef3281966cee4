//! What a set of settings determines, and how well.

use super::aim;
use super::information::Inverse;
use super::model::{Parameter, Setting};
use super::problem::Problem;
use super::refinement::Region as _;
use crate::estimate::least_squares::Observability;

/// A parameter as a design determines it.
#[derive(Debug, Clone, PartialEq)]
pub struct Determined {
    /// The parameter.
    pub parameter: Parameter,
    /// Its sigma, normalised: times [`Parameter::si`] in SI, times [`Parameter::shown`] in the unit for
    /// display. Infinite if undetermined.
    pub sigma: f64,
    /// Sigma over that with all other parameters known: 1 if the parameter is orthogonal to them. Its square is the
    /// variance inflation factor.
    pub inflation: f64,
}

/// Inflation above which a parameter is hardly observable: the others explain 99 % of its regressor.
pub const WEAK: f64 = 10.0;

/// A design, judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// The settings, one a dwell, in the order given.
    pub settings: Vec<Setting>,
    /// `det(F'F/n)`, fang (22), of one sensor where all three have the same regressors. Not a number beside a population, whose part does not grow with n.
    pub determinant: f64,
    /// D-efficiency against the continuous optimum over the reach: 1 is the best possible, 0 is singular. Not a number beside a population: the
    /// optimum then depends on the number of dwells and their noise.
    pub d_efficiency: f64,
    /// Sigma of a dwell mean, SI, from which the sigmas of the parameters follow.
    pub sigma: f64,
    /// All parameters of the triad. If a person takes the poses with a stated error ([`Problem::aim`]), a sigma is the median over such poses, and all else
    /// is that of the poses as planned.
    pub parameters: Vec<Determined>,
    /// Geometric mean of the semi-axes of the parameters' one-sigma ellipsoid, normalised: what the criterion
    /// minimises. Infinite if singular.
    pub mean_sigma: f64,
    /// Largest over smallest singular value of F, the rows of the population included; infinite if singular.
    pub condition: f64,
    /// Residual degrees of freedom of a regression from different inputs and the population: these reveal a wrong model, or a unit that is none of
    /// the population.
    pub lack_of_fit_dof: usize,
    /// Residual degrees of freedom of a regression from repeated inputs: these show the noise, whatever the
    /// model.
    pub repetition_dof: usize,
}

impl Problem {
    /// [`Judgement::mean_sigma`] of these settings.
    pub(super) fn mean_sigma(&self, settings: &[Setting], sigma: f64) -> f64 {
        self.mean_sigma_by(self.log_det_of(settings, self.given(sigma)), sigma)
    }

    fn mean_sigma_by(&self, log_det: f64, sigma: f64) -> f64 {
        sigma * (-log_det / (2.0 * self.reach.model.width() as f64)).exp()
    }

    /// Puts the medians over a person's poses in place of the sigmas of `parameters`, which are those of a single regression.
    fn as_taken(&self, settings: &[Setting], sigma: f64, parameters: &mut [Determined]) {
        let given = self.given(sigma);
        let mut found = vec![Vec::new(); parameters.len()];
        for poses in aim::taken(settings, self.aim()) {
            let rows = self.reach.rows(&poses).beside(given.clone());
            let inverse = Inverse::of_all(&rows);
            let width = rows.width();
            for (k, found) in found.iter_mut().enumerate() {
                let variance = inverse.as_ref().map(|i| i.matrix()[(k % width, k % width)]);
                found.push(sigma * variance.map_or(f64::INFINITY, f64::sqrt));
            }
        }
        for (parameter, found) in parameters.iter_mut().zip(found) {
            // What the poses as planned do not determine, chance errors of a person must not.
            if parameter.sigma.is_finite() {
                parameter.sigma = aim::median(found);
            }
        }
    }

    /// Judges `settings`, one dwell each, whose means have the sigma `sigma` (SI unit of the sensor).
    ///
    /// They need not be within reach; the efficiency is against the optimum within reach. Without settings, the population alone is judged.
    pub fn judge(&self, settings: &[Setting], sigma: f64) -> Judgement {
        let n = settings.len();
        let given = self.given(sigma);
        let rows = self.reach.rows(settings).beside(given.clone());
        let (f, width) = (rows.matrix(), rows.width());
        let observability = Observability::of(&f);
        let inverse = Inverse::of_all(&rows);
        let log_det = inverse.as_ref().map_or(f64::NEG_INFINITY, Inverse::log_det);
        let distinct = self.distinct(settings).len();
        let list = self.reach.model.parameters().into_iter().enumerate();
        let determined = list.map(|(place, parameter)| {
            // The sensors of a triad have the same regressors.
            let k = place % width;
            let alone = f.column(k).norm();
            let unseen = observability.undetermined.iter().any(|(u, _)| *u == k);
            let variance = match &inverse {
                Some(inverse) => inverse.matrix()[(k, k)],
                // Some parameters of a singular design are determined all the same.
                None if unseen || alone == 0.0 => f64::INFINITY,
                None => pseudo_variance(&f, k),
            };
            Determined {
                parameter,
                sigma: sigma * variance.sqrt(),
                inflation: variance.sqrt() * alone,
            }
        });
        let mut parameters: Vec<Determined> = determined.collect();
        if self.aim() > 0.0 && n > 0 {
            self.as_taken(settings, sigma, &mut parameters);
        }
        // Of a dwell, on average.
        let mean = log_det - width as f64 * (n as f64).ln();
        let (determinant, d_efficiency) = match &given {
            Some(_) => (f64::NAN, f64::NAN),
            None => {
                let over = (mean - self.reach.optimum()) / width as f64;
                (mean.exp(), over.exp())
            }
        };
        Judgement {
            settings: settings.to_vec(),
            determinant,
            d_efficiency,
            sigma,
            parameters,
            mean_sigma: self.mean_sigma_by(log_det, sigma),
            condition: observability.condition,
            lack_of_fit_dof: (distinct + given.as_ref().map_or(0, |g| g.nrows()))
                .saturating_sub(width),
            repetition_dof: n - distinct,
        }
    }
}

/// Variance of a parameter that a singular design determines, from the directions that it does determine.
fn pseudo_variance(f: &nalgebra::DMatrix<f64>, k: usize) -> f64 {
    let normal = (f.transpose() * f).pseudo_inverse(1e-8);
    normal.map_or(f64::INFINITY, |inverse| inverse[(k, k)])
}

impl Judgement {
    /// Names of the parameters that it does not determine.
    pub fn undetermined(&self) -> Vec<String> {
        let none = self.parameters.iter().filter(|p| p.sigma.is_infinite());
        none.map(|p| p.parameter.name.clone()).collect()
    }
}
