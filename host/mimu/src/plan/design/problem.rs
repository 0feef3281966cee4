//! A model, what it can be measured with, and the best designs of it.

use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;

use super::exchange;
use super::information::{Inverse, Rows};
use super::model::{Model, Setting};
use super::population::Population;
use super::reach::{Fixture, Rates, Reach};
use super::refinement::{Region as _, refine};
use crate::estimate::magnitude::FEWEST_WITH_PRIOR;
use crate::quantity::{Sensor, plural};
use mimu_recording::{Argument, Error, Reference, Result};

/// A model, and what it can be measured with.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Model and reach.
    pub reach: Reach,
    candidates: Vec<Setting>,
    rows: Rows,
    population: Option<Beside>,
    /// How well a person takes the poses, rad about each level axis, one standard deviation; 0: exactly.
    aim: f64,
}

/// The population beside which designs are made.
#[derive(Debug, Clone)]
struct Beside {
    population: Population,
    /// Sigma of a dwell mean, SI: it weighs the population against the dwells.
    sigma: f64,
}

/// Random starts of a search. In 17 problems (5 to 40 dwells; known input, magnitude of gravity) 200 found
/// nothing that 10 had not found.
const STARTS: usize = 20;
/// Best designs of a search that are refined between the candidates.
const REFINED: usize = 10;
/// Difference of `ln det` within which designs are equally good.
const EQUAL: f64 = 1e-6;

/// Inputs are the same below this distance, over the full input: 0.6 degrees. Only inputs farther apart show
/// what a model lacks.
const DIFFERENT: f64 = 0.01;

impl Problem {
    /// An accelerometer on `fixture`.
    ///
    /// # Errors
    /// The magnitude of gravity on six faces.
    pub fn accel(reference: Reference, fixture: Fixture) -> Result<Self> {
        if reference != Reference::Table && fixture == Fixture::Faces {
            return Err(Error::undetermined(
                Sensor::Accel,
                "on six faces the magnitude of gravity cannot distinguish C_yx, C_zx, C_zy",
                "use another table or reference",
            )
            .about(Argument::Table));
        }
        Ok(Self::new(Reach {
            model: Model::accel(reference),
            fixture,
            rates: Rates::Any,
        }))
    }

    /// A gyro triad on `fixture`, turned at `rates` up to `span`, rad/s about each axis.
    ///
    /// # Errors
    /// A fixture that holds no rates.
    pub fn gyro(span: Vector3<f64>, fixture: Fixture, rates: Rates) -> Result<Self> {
        let problem = match fixture {
            Fixture::ThreeAxis | Fixture::Faces => {
                return Ok(Self::new(Reach {
                    model: Model::gyro(span),
                    fixture,
                    rates,
                }));
            }
            Fixture::TwoAxis => "a two-axis table holds a rate about one body axis only",
            Fixture::Hand => "by hand no rate is known, only turns between dwells",
        };
        let place = format!("gyro, {}", fixture.name());
        let remedy = "design for a three-axis table, or for one that shows the faces";
        Err(Error::new(place, problem, remedy).about(Argument::Table))
    }

    fn new(reach: Reach) -> Self {
        let candidates = reach.candidates();
        Self {
            rows: reach.rows(&candidates),
            reach,
            candidates,
            population: None,
            aim: 0.0,
        }
    }

    /// The same beside what the population of the unit's kind says of its parameters, for dwells whose means have the sigma `sigma`, SI, of a person who
    /// takes poses with the standard deviation `aim`, rad, about each level axis.
    ///
    /// # Errors
    /// The sensor, the reference or the fixture is none that a fit with a prior has: poses by hand, the magnitude of gravity.
    pub fn beside(self, population: Population, sigma: f64, aim: f64) -> Result<Self> {
        let model = &self.reach.model;
        let fits = model.sensor == Sensor::Accel
            && model.reference == Reference::Gravity
            && self.reach.fixture == Fixture::Hand;
        if !fits {
            return Err(Error::new(
                format!("{}, {}", model.sensor, self.reach.fixture.name()),
                "a prior is for an accelerometer by hand, with gravity as the reference",
                "leave the prior out",
            ));
        }
        let population = Some(Beside { population, sigma });
        Ok(Self {
            population,
            aim,
            ..self
        })
    }

    /// The same for dwells whose means have another sigma; only a population makes a difference.
    pub fn at_sigma(&self, sigma: f64) -> Self {
        let mut other = self.clone();
        if let Some(beside) = &mut other.population {
            beside.sigma = sigma;
        }
        other
    }

    /// The same without the population.
    pub fn alone(&self) -> Self {
        Self {
            population: None,
            ..self.clone()
        }
    }

    /// How well a person takes the poses, rad about each level axis, one standard deviation; 0 if that is not counted.
    pub fn aim(&self) -> f64 {
        self.aim
    }

    /// The population beside which designs are made.
    pub fn population(&self) -> Option<&Population> {
        self.population.as_ref().map(|b| &b.population)
    }

    /// Rows of the population beside dwell means of this sigma.
    pub(super) fn given(&self, sigma: f64) -> Option<DMatrix<f64>> {
        self.population().map(|p| p.rows(sigma))
    }

    /// The same for the sigma that designs are made for.
    fn own_given(&self) -> Option<DMatrix<f64>> {
        let beside = self.population.as_ref()?;
        Some(beside.population.rows(beside.sigma))
    }

    /// Fewest dwells of a design, whatever their inputs.
    pub fn fewest(&self) -> usize {
        match self.population {
            Some(_) => FEWEST_WITH_PRIOR,
            None => self.rows.width(),
        }
    }

    /// Best design found of `n` dwells, in no particular order; determinate for a `seed`.
    ///
    /// By hand only faces, edges and corners are used: nobody holds (-0.859, 0.346, 0.377), and twelve of these 26 directions have a D-efficiency of
    /// 0.97. Of equally good designs, the one with most different inputs is taken, because only these reveal a wrong model; of those, one on faces, edges and
    /// corners.
    pub fn best(&self, n: usize, seed: u64) -> Result<Vec<Setting>> {
        if n < self.fewest() {
            return Err(self.too_few(n));
        }
        let given = self.own_given();
        let plain = self.reach.plain();
        let faces: Vec<Setting> = plain
            .iter()
            .filter(|s| Fixture::Faces.reaches(&s.up))
            .copied()
            .collect();
        let search = |from: &[Setting], rows: Rows| -> Vec<Vec<Setting>> {
            let found = exchange::search(&rows.beside(given.clone()), n, STARTS, seed);
            found
                .iter()
                .map(|f| f.points.iter().map(|&i| from[i]).collect())
                .collect()
        };
        let on_faces = search(&faces, self.reach.rows(&faces));
        let on_plain = search(&plain, self.reach.rows(&plain));
        let by_hand = self.reach.fixture == Fixture::Hand;
        let on_grid = match by_hand {
            true => Vec::new(),
            false => search(&self.candidates, self.rows.clone()),
        };
        let refined = |designs: &[Vec<Setting>]| -> Vec<Vec<Setting>> {
            let each = designs.par_iter().take(REFINED);
            each.filter_map(|d| refine(&self.reach, d.clone()))
                .map(|(points, _)| points)
                .collect()
        };
        let (refined_plain, refined_grid) = match by_hand {
            true => (Vec::new(), Vec::new()),
            false => (refined(&on_plain), refined(&on_grid)),
        };
        let all = [on_faces, on_plain, refined_plain, refined_grid].concat();
        let values: Vec<f64> = all.iter().map(|d| self.log_det(d)).collect();
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let worth = |settings: &[Setting]| self.distinct(settings).len();
        let equal = all
            .into_iter()
            .zip(values)
            .filter(|(_, value)| *value > most - EQUAL);
        let valued = equal.map(|(settings, _)| (worth(&settings), settings));
        let best = valued
            .reduce(|a, b| if b.0 > a.0 { b } else { a })
            .map(|(_, settings)| settings);
        best.ok_or_else(|| self.too_few(n))
    }

    fn too_few(&self, n: usize) -> Error {
        let p = self.rows.width();
        let beside = match self.population {
            Some(_) => " beside a prior",
            None => "",
        };
        let problem = format!(
            "{} cannot determine {p} parameters{beside}",
            plural(n as u64, "dwell")
        );
        let remedy = format!("design at least {}", self.fewest().max(n + 1).min(p));
        Error::new(self.reach.model.sensor, problem, remedy)
    }

    /// Logarithm of `det F'F` of one dwell at each of the settings, the population included; minus infinity if singular.
    pub fn log_det(&self, settings: &[Setting]) -> f64 {
        self.log_det_of(settings, self.own_given())
    }

    pub(super) fn log_det_of(&self, settings: &[Setting], given: Option<DMatrix<f64>>) -> f64 {
        let rows = self.reach.rows(settings).beside(given);
        Inverse::of_all(&rows).map_or(f64::NEG_INFINITY, |i| i.log_det())
    }

    /// The settings without repetitions of the same input to the model.
    pub(super) fn distinct(&self, settings: &[Setting]) -> Vec<Setting> {
        let mut distinct: Vec<Setting> = Vec::new();
        for s in settings {
            if !distinct.iter().any(|d| self.same(d, s)) {
                distinct.push(*s);
            }
        }
        distinct
    }

    /// Whether two settings are the same input to the model.
    fn same(&self, a: &Setting, b: &Setting) -> bool {
        let model = &self.reach.model;
        (model.input(a) - model.input(b)).norm() < DIFFERENT
    }
}
