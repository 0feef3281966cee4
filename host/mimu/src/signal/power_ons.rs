//! The power-ons within a recording: after each of them the biases are others.

use nalgebra::Vector3;

use crate::quantity::Sensor;
use crate::signal::blocks::{Condensed, quantile};
use crate::signal::dwell::{Dwell, Dwells};
use mimu_recording::Manifest;
use mimu_recording::error::Result;

/// To which power-on the dwells of a recording belong.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PowerOns {
    /// Of each dwell: so many power-ons with dwells come later. Empty if there is one.
    later: Vec<usize>,
}

impl PowerOns {
    /// A recording of one power-on.
    pub const ONE: &Self = &Self { later: Vec::new() };

    /// By the restarts in the manifest.
    pub fn of(dwells: &[Dwell], manifest: &Manifest) -> Self {
        let times = restarts(manifest);
        let of = |dwell: &Dwell| times.iter().filter(|t| **t <= dwell.start_s).count();
        let mut later = Vec::new();
        for pair in dwells.windows(2).rev() {
            let after = later.last().copied().unwrap_or(0);
            if later.is_empty() {
                later.push(0);
            }
            later.push(after + usize::from(of(&pair[0]) != of(&pair[1])));
        }
        later.reverse();
        match later.first() {
            Some(0) | None => Self::default(),
            Some(_) => Self { later },
        }
    }

    /// How many power-ons with dwells come after that of this dwell: 0 for the last one.
    pub fn later(&self, dwell: usize) -> usize {
        self.later.get(dwell).copied().unwrap_or(0)
    }

    /// Number of power-ons before the last one.
    pub fn others(&self) -> usize {
        self.later(0)
    }
}

/// Instants of the restarts in a manifest, s.
fn restarts(manifest: &Manifest) -> Vec<f64> {
    let recorded = manifest.recorded.iter().flat_map(|r| &r.restarts);
    recorded.map(|restart| restart.t_s).collect()
}

/// `condensed` with the gyro's readings before the last power-on moved by what their biases differ from the last, raw: otherwise dwells of one power-on seem
/// to turn beside those of another. `find` finds the dwells of one power-on. A few degrees an hour of the Earth's rate do not matter here: the fit
/// finds the rest.
pub(crate) fn with_one_bias(
    mut condensed: Condensed,
    manifest: &Manifest,
    find: impl Fn(&Condensed) -> Result<Dwells>,
) -> Condensed {
    let times = restarts(manifest);
    if times.is_empty() {
        return condensed;
    }
    let edges = std::iter::once(f64::NEG_INFINITY).chain(times.iter().copied());
    let spans: Vec<[f64; 2]> = edges
        .zip(times.iter().copied().chain([f64::INFINITY]))
        .map(|(from, to)| [from, to])
        .collect();
    let bias = |[from, to]: &[f64; 2]| {
        let dwells = find(&condensed.between(*from, *to)).ok()?.list;
        let middle = |c: usize| {
            let rests = dwells.iter().filter(|d| d.faults.gyro.is_none() && !d.turn);
            let mut means: Vec<f64> = rests.map(|d| d.raw[c].mean).collect();
            quantile(&mut means, 0.5)
        };
        let gyro = Sensor::Gyro.channels().start;
        let [x, y, z] = [0, 1, 2].map(|k| middle(gyro + k));
        Some(Vector3::new(x?, y?, z?))
    };
    let biases: Vec<Option<Vector3<f64>>> = spans.iter().map(bias).collect();
    if let Some(last) = biases.iter().rev().flatten().next() {
        for ([from, to], bias) in spans.iter().zip(&biases) {
            if let Some(bias) = bias {
                condensed.add_to_gyro(&(last - bias), *from, *to);
            }
        }
    }
    condensed
}
