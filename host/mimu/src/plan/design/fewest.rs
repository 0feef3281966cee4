//! Half-widths that a design predicts, and the fewest dwells that suffice.

use serde::Serialize;

use super::judgement::{Determined, Judgement};
use super::problem::Problem;
use crate::observation::{LOWER, place};
use mimu_recording::NORMAL_95;

/// Largest half-widths of 95 % intervals, if the noise is known, by kind of parameter. Infinite, null in JSON, if one is not determined.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Widths {
    /// Biases, m/s².
    #[serde(rename = "bias_mps2")]
    pub bias: f64,
    /// Scale factors, relative.
    pub scale: f64,
    /// Angles between the axes, rad.
    #[serde(rename = "angle_rad")]
    pub angle: f64,
}

impl Widths {
    /// Of the accelerometer of a design by the magnitude of gravity, affine terms only.
    pub fn of(judgement: &Judgement) -> Self {
        let mut widths = Self {
            bias: 0.0,
            scale: 0.0,
            angle: 0.0,
        };
        for (
            k,
            Determined {
                parameter, sigma, ..
            },
        ) in LOWER.iter().zip(&judgement.parameters)
        {
            let kind = match place(*k) {
                (_, None) => &mut widths.bias,
                (i, Some(j)) if i == j => &mut widths.scale,
                _ => &mut widths.angle,
            };
            *kind = kind.max(NORMAL_95 * sigma * parameter.si);
        }
        widths
    }

    /// Whether each is at most that of `targets`.
    pub fn meet(&self, targets: &Self) -> bool {
        self.bias <= targets.bias && self.scale <= targets.scale && self.angle <= targets.angle
    }
}

/// Most dwells that a search for the fewest tries: the wizard makes no more either.
pub const MOST: usize = 60;

impl Problem {
    /// Fewest dwells, at most [`MOST`], whose best design found fulfils `enough`. `None` if none does.
    pub fn fewest_with(
        &self,
        sigma: f64,
        seed: u64,
        enough: impl Fn(&Judgement) -> bool,
    ) -> Option<usize> {
        let problem = self.at_sigma(sigma);
        (problem.fewest()..=MOST).find(|n| {
            let best = problem.best(*n, seed);
            best.is_ok_and(|settings| enough(&problem.judge(&settings, sigma)))
        })
    }
}
