//! Data for the plots of a diagnosis: residuals before and after against time, and against the quantity that an effect
//! depends on, with the fitted effect. They are drawn elsewhere.

mod against;

use serde::Serialize;

pub use against::{Abscissa, Against, At, Curve, Panel};

use super::decision::{Decision, Model, part};
use super::rows::Rows;
use super::search::Search;
use crate::fit::Split;
use crate::observable::Observable;
use crate::quantity::Sensor;

/// Quantity of residuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum ResidualKind {
    /// Angle by which gravity is missed after a turn, rad.
    Angle,
    /// Input of the sensor, its SI unit.
    Input,
}

/// A row at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sample {
    /// Middle of the dwell or turn, s since the recording began.
    pub t_s: f64,
    /// Standard deviation by the known noise.
    pub sigma: f64,
    /// Residual of the affine calibration, and with the effects, in sample.
    pub residual: [f64; 2],
    /// The same held out, not a number where it could not be.
    pub held_out: [f64; 2],
}

/// Residuals of one kind in order of time.
#[derive(Debug, Clone, Serialize)]
pub struct Track {
    /// Axis, or direction across gravity.
    pub name: String,
    /// Quantity of the residuals.
    pub kind: ResidualKind,
    /// Its rows.
    pub samples: Vec<Sample>,
    #[serde(skip)]
    rows: Vec<usize>,
    #[serde(skip)]
    axis: Option<usize>,
    /// Observable, without the recording.
    #[serde(skip)]
    pub group: Observable,
}

/// Data for the plots of one sensor.
#[derive(Debug, Clone, Serialize)]
pub struct Picture {
    /// Sensor.
    #[serde(skip)]
    pub sensor: Sensor,
    /// Residuals in time.
    pub tracks: Vec<Track>,
    /// Ends of the blocks that are held out in turn, s; empty where every fourth dwell is.
    pub blocks_s: Vec<f64>,
    /// Panels of each accepted effect, in the order of acceptance.
    pub effects: Vec<Vec<Panel>>,
}

impl Picture {
    /// Of what was found on one sensor.
    pub fn of(sensor: Sensor, rows: &Rows, decision: &Decision) -> Self {
        let [first, last] = &decision.models;
        let at = |model: &Model, r: usize| model.held_out.as_ref().map_or(f64::NAN, |h| h[r]);
        let sample = |r: usize, sigma: f64| Sample {
            t_s: middle(rows, r),
            sigma,
            residual: [first.residuals[r], last.residuals[r]],
            held_out: [at(first, r), at(last, r)],
        };
        let tracks = tracks(rows, sample);
        let search = Search::new(rows, Vec::new());
        let panels = |a| against::panels(rows, &search, &last.fitted, a, &tracks);
        Self {
            sensor,
            blocks_s: match decision.split {
                Split::Blocks => blocks(rows),
                Split::Interleaved => Vec::new(),
            },
            // A model whose panels are singular was not accepted.
            effects: (decision.accepted.iter())
                .map(|a| panels(a).unwrap_or_default())
                .collect(),
            tracks,
        }
    }
}

/// Middle of a row, s since the recording began.
fn middle(rows: &Rows, row: usize) -> f64 {
    rows.mean(row, &rows.conditions(None), |at| at.t_s)
}

/// The rows by stratum; those of turns by direction.
fn tracks(rows: &Rows, sample: impl Fn(usize, f64) -> Sample) -> Vec<Track> {
    let mut all = Vec::new();
    for stratum in &rows.strata {
        let judged = stratum.rows.start < rows.judged.0;
        let directions = if judged { rows.judged.1 } else { 1 };
        for direction in 0..directions {
            let of_it: Vec<usize> = stratum
                .rows
                .clone()
                .skip(direction)
                .step_by(directions)
                .collect();
            let variances = stratum.known_variances();
            let sigma = |r: usize| variances[r - stratum.rows.start].sqrt();
            all.push(Track {
                name: match (directions, direction) {
                    (1, _) => stratum.name.to_string(),
                    (_, 0) => format!("{}, first direction", stratum.name),
                    _ => format!("{}, second direction", stratum.name),
                },
                kind: if directions > 1 {
                    ResidualKind::Angle
                } else {
                    ResidualKind::Input
                },
                samples: of_it.iter().map(|r| sample(*r, sigma(*r))).collect(),
                rows: of_it,
                axis: stratum.axis(),
                group: stratum.name.0,
            });
        }
    }
    all
}

/// Times between the blocks that are held out; empty for several recordings, whose times overlap.
fn blocks(rows: &Rows) -> Vec<f64> {
    if rows.strata.iter().any(|s| s.session > 0) {
        return Vec::new();
    }
    let mut ends: Vec<(usize, f64)> = (0..rows.y.len())
        .map(|r| {
            let block = part(Split::Blocks, rows, rows.dwells(r)[1]);
            (block, middle(rows, r))
        })
        .collect();
    ends.sort_by(|a, b| a.1.total_cmp(&b.1));
    ends.windows(2)
        .filter(|w| w[0].0 != w[1].0)
        .map(|w| 0.5 * (w[0].1 + w[1].1))
        .collect()
}
