//! What a prior of the unit's kind adds to a design, as reported.

use serde::Serialize;

use super::Design;
use crate::plan::design::Problem;
use crate::plan::design::fewest::Widths;
use crate::plan::design::judgement::Judgement;
use crate::plan::design::population::Population;
use mimu_recording::RawUnit;

/// Dwells up to which half-widths are listed.
const LISTED: usize = 12;

/// The prior that a design counts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BesidePopulation {
    /// Units that it was made from.
    pub units: usize,
    /// Unit of their readings.
    pub raw_unit: RawUnit,
    /// Whether it says something of the biases.
    pub biases: bool,
    /// How well a person is assumed to take a pose, degrees about each level axis, one standard deviation. Sigmas of parameters are medians over such poses.
    pub aim_deg: f64,
    /// Fewest dwells of the same length that without the prior have at most the mean sigma of the design; `None` if more than
    /// [`crate::plan::design::fewest::MOST`].
    pub dwells_without: Option<usize>,
    /// Half-widths by number of dwells.
    pub by_dwells: Vec<ByDwells>,
    /// The half-widths that the number of dwells was sought for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub targets: Option<Sought>,
}

/// Half-widths of the best design found of so many dwells, each as long as those of the design.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ByDwells {
    /// Number of dwells; 0: the population alone.
    pub dwells: usize,
    /// With the prior.
    pub with: Widths,
    /// Without it; `None` if these dwells alone do not determine the parameters.
    pub without: Option<Widths>,
}

/// Half-widths that were sought.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sought {
    /// The targets.
    pub half_widths: Widths,
    /// Fewest dwells that meet them without the prior; `None` if more than [`crate::plan::design::fewest::MOST`].
    pub dwells_without: Option<usize>,
}

impl Design {
    /// The same, with what the population of `problem` adds: by number of dwells, searched with `seed`, and for the `targets` that it was sought for.
    pub fn beside_population(
        mut self,
        problem: &Problem,
        seed: u64,
        targets: Option<&Widths>,
    ) -> Self {
        let Some(population) = problem.population() else {
            return self;
        };
        let sigma = self.dwell_sigma.value;
        let (with, without) = (problem.at_sigma(sigma), problem.alone());
        let widths = |problem: &Problem, n: usize| -> Option<Widths> {
            let settings = match n {
                0 => Vec::new(),
                _ => problem.best(n, seed).ok()?,
            };
            Some(Widths::of(&problem.judge(&settings, sigma)))
        };
        let numbers = std::iter::once(0).chain(with.fewest()..=LISTED);
        let by_dwells = numbers.filter_map(|dwells| {
            Some(ByDwells {
                dwells,
                with: widths(&with, dwells)?,
                without: widths(&without, dwells).filter(|_| dwells > 0),
            })
        });
        let as_good = |found: &Judgement| found.mean_sigma <= self.mean_sigma;
        let Population {
            units,
            raw_unit,
            has_biases: biases,
            ..
        } = *population;
        self.prior = Some(BesidePopulation {
            units,
            raw_unit,
            biases,
            aim_deg: problem.aim().to_degrees(),
            dwells_without: without.fewest_with(sigma, seed, as_good),
            by_dwells: by_dwells.collect(),
            targets: targets.map(|targets| Sought {
                half_widths: *targets,
                dwells_without: without
                    .fewest_with(sigma, seed, |found| Widths::of(found).meet(targets)),
            }),
        });
        self
    }
}
