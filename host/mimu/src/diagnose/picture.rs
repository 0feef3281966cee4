//! Data for the plots of a diagnosis: residuals before and after against time, and against the quantity that an effect
//! depends on, with the fitted effect; and the remaining residuals compared with noise. They are drawn elsewhere.

mod abscissa;
mod against;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{Beta, ChiSquared, ContinuousCDF, Normal};

pub use abscissa::Abscissa;
pub use against::{Against, At, Curve, Panel};

use super::decision::{Decision, Model, part, rms};
use super::rows::Rows;
use super::search::{Chosen, Search};
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

/// Error figures of a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// What the model adds to the one before.
    pub adds: String,
    /// Root mean square in sample.
    pub rms: f64,
    /// Held out, not a number where it could not be.
    pub held_out_rms: f64,
}

/// Residuals in units of the known noise, in ascending order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantile {
    /// Expected value if there is only noise.
    pub normal: f64,
    /// 95 % interval of that, for each separately.
    pub band: [f64; 2],
    /// Residuals before and after.
    pub found: [f64; 2],
}

/// Chi-square test of the residuals by the known noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Omnibus {
    /// Chi-square.
    pub chi2: f64,
    /// Degrees of freedom.
    pub dof: usize,
    /// Probability by chance.
    pub p: f64,
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
    /// Affine calibration, then each effect beside the ones before.
    pub steps: Vec<Step>,
    /// Residuals against the normal distribution.
    pub quantiles: Vec<Quantile>,
    /// Chi-square by the known noise, before and after.
    pub omnibus: [Omnibus; 2],
}

/// Residuals of a model in sigmas of the known noise, their chi-square and its chance.
fn by_known_noise(search: &Search, columns: &DMatrix<f64>) -> Option<(DVector<f64>, Omnibus)> {
    let (rows, variance) = (search.rows, &search.variance);
    let none = variance.none();
    let fit = variance.fit_at(columns, &none)?;
    let left = &rows.y - columns * &fit.coefficients;
    let left = DMatrix::from_column_slice(left.len(), 1, left.as_slice());
    let white = variance
        .whitener(&none)?
        .whiten(&left)
        .column(0)
        .into_owned();
    let dof = rows.y.len().saturating_sub(columns.ncols());
    let p = ChiSquared::new(dof as f64).map_or(1.0, |d| d.sf(fit.chi2));
    let omnibus = Omnibus {
        chi2: fit.chi2,
        dof,
        p,
    };
    Some((white, omnibus))
}

impl Picture {
    /// Of what was found on one sensor. `None` where a model of it is singular, which the decision would have refused.
    pub fn of(sensor: Sensor, rows: &Rows, decision: &Decision) -> Option<Self> {
        let search = Search::new(rows, Vec::new());
        let kept: Vec<Chosen> = decision.accepted.iter().map(|a| a.chosen.clone()).collect();
        let [first, last] = &decision.models;
        let step = |adds: String, model: &Model| Step {
            adds,
            rms: rms(rows, &model.residuals),
            held_out_rms: model.held_out.as_ref().map_or(f64::NAN, |h| rms(rows, h)),
        };
        // The first and the last model have the figures of the decision, which are those of a fit of them.
        let decided = |adds: String, k: usize| Step {
            adds,
            rms: decision.rms[k],
            held_out_rms: decision.held_out_rms[k],
        };
        let mut steps = vec![decided("affine calibration".into(), 0)];
        for n in 1..=kept.len() {
            let adds = kept[n - 1].candidate.id();
            steps.push(match n == kept.len() {
                true => decided(adds, 1),
                // The decision is on all effects together. For the table, the first ones are also fitted alone.
                false => {
                    let tested = search.fit(&kept[..n])?;
                    step(
                        adds,
                        &Model::of(&search, &kept[..n], &tested, decision.split)?,
                    )
                }
            });
        }
        let at = |model: &Model, r: usize| model.held_out.as_ref().map_or(f64::NAN, |h| h[r]);
        let sample = |r: usize, sigma: f64| Sample {
            t_s: middle(rows, r),
            sigma,
            residual: [first.residuals[r], last.residuals[r]],
            held_out: [at(first, r), at(last, r)],
        };
        let tracks = tracks(rows, sample);
        let effects = decision
            .accepted
            .iter()
            .map(|a| against::panels(rows, &search, &last.fitted, a, &tracks))
            .collect::<Option<_>>()?;
        let (before, omnibus_before) = by_known_noise(&search, &first.columns)?;
        let (after, omnibus_after) = by_known_noise(&search, &last.columns)?;
        Some(Self {
            sensor,
            blocks_s: match decision.split {
                Split::Blocks => blocks(rows),
                Split::Interleaved => Vec::new(),
            },
            tracks,
            effects,
            steps,
            quantiles: quantiles([&before, &after]),
            omnibus: [omnibus_before, omnibus_after],
        })
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

fn quantiles(found: [&DVector<f64>; 2]) -> Vec<Quantile> {
    let sorted = found.map(|f| {
        let mut f: Vec<f64> = f.iter().copied().collect();
        f.sort_by(f64::total_cmp);
        f
    });
    let n = sorted[0].len();
    let normal = Normal::standard();
    (0..n)
        .map(|i| {
            // Blom's plotting position; the i-th of n is distributed as Beta(i, n + 1 - i).
            let p = (i as f64 + 0.625) / (n as f64 + 0.25);
            let ends = Beta::new((i + 1) as f64, (n - i) as f64)
                .map_or([p; 2], |b| [0.025, 0.975].map(|q| b.inverse_cdf(q)));
            Quantile {
                normal: normal.inverse_cdf(p),
                band: ends.map(|e| normal.inverse_cdf(e.clamp(1e-12, 1.0 - 1e-12))),
                found: [sorted[0][i], sorted[1][i]],
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_normal_order_statistics_are_those_of_the_tables() {
        // Expected largest of ten standard normals: 1.5388 (Harter 1961); Blom's position comes within 0.01. The largest of
        // ten is below its 97.5 % point with probability p^10 = 0.975: p = 0.997471, 2.8028 sigmas.
        let ten = DVector::from_fn(10, |i, _| i as f64);
        let found = quantiles([&ten, &ten]);
        assert!(
            (found[9].normal - 1.5388).abs() < 0.01,
            "{}",
            found[9].normal
        );
        assert!(
            (found[9].band[1] - 2.8028).abs() < 1e-3,
            "{}",
            found[9].band[1]
        );
        assert!((found[0].normal + found[9].normal).abs() < 1e-9);
    }
}
