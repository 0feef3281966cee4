//! Whether the residual of an axis is a function of the axis's own reading.
//!
//! A nonlinear converter, missing codes, or an amplifier that sticks or no longer follows: each leaves a function of the reading that no
//! smooth law makes. Dwell means do not show which of these it is, so it is reported as a residual instead of an effect. The function is
//! taken as constant between places that divide the range of the readings evenly, and tested beside a smooth one. To be reported, it has
//! to be too large for chance, and has to predict held-out dwells. It also has to do better than the same function of the readings of
//! another axis, because an unrecorded quantity may look like either.

use nalgebra::{DMatrix, Vector3};

use super::hold_out::{held_out, rms};
use super::leftover::{CorrelatesWith, FALSE_LEFTOVER, Leftover};
use crate::diagnose::columns::{beside, independent_of, unit_columns};
use crate::diagnose::rows::Rows;
use crate::diagnose::search::{COEFFICIENT, Chosen, Search, without};
use crate::diagnose::variance::{Fitted, LikelihoodKind};
use crate::fit::Split;
use crate::observable::{Observable, StratumName};
use crate::signal::blocks::extent;

/// Numbers of segments that the range of the readings is divided into.
const PIECES: [usize; 3] = [4, 16, 64];
/// Order of the smooth function: that of the named effects.
const SMOOTH: i32 = 3;
/// Number of functions that are tried: axes times divisions.
const TRIED: f64 = (3 * PIECES.len()) as f64;

/// A residual of an axis that is a function of the axis's own reading.
pub(super) struct OfReading {
    /// The report about it.
    pub left: Leftover,
    /// Columns that absorb it, the smooth ones included.
    pub columns: DMatrix<f64>,
}

/// Readings of the rows without their noise.
struct Readings {
    /// See [`Rows::readings`].
    rows: Vec<Vec<[Vector3<f64>; 2]>>,
    /// Lowest reading and range of each axis, raw.
    range: [(f64, f64); 3],
}

impl Readings {
    /// Beside `model`, fitted as `fitted`.
    fn of(rows: &Rows, model: &DMatrix<f64>, fitted: &Fitted) -> Self {
        let rows = rows.readings(&(&rows.y - model * &fitted.coefficients));
        let range = |axis: usize| {
            let all = rows.iter().flatten().map(|[_, reading]| reading[axis]);
            let [low, high] = extent(all.filter(|u| u.is_finite()));
            (low, high - low)
        };
        Self {
            range: std::array::from_fn(range),
            rows,
        }
    }

    /// Columns of errors of `axis` that are functions of the reading of axis `read`, as a share of its range.
    fn columns(
        &self,
        axis: usize,
        read: usize,
        count: usize,
        value: impl Fn(f64, usize) -> f64,
    ) -> DMatrix<f64> {
        let (low, range) = self.range[read];
        DMatrix::from_fn(self.rows.len(), count, |r, k| {
            let moved = self.rows[r]
                .iter()
                .filter(|[weight, _]| weight[axis] != 0.0);
            let each = moved
                .map(|[weight, reading]| weight[axis] * value((reading[read] - low) / range, k));
            each.sum()
        })
    }

    fn smooth(&self, axis: usize) -> DMatrix<f64> {
        let power = |k: usize| i32::try_from(k).map_or(SMOOTH, |k| k + 2);
        self.columns(axis, axis, (SMOOTH - 1) as usize, |share, k| {
            (2.0 * share - 1.0).powi(power(k))
        })
    }

    fn steps(&self, axis: usize, read: usize, pieces: usize) -> DMatrix<f64> {
        self.columns(axis, read, pieces - 1, |share, k| {
            f64::from(u8::from(share * pieces as f64 > (k + 1) as f64))
        })
    }
}

/// The residuals beside `model`, whose fit is `last`, that are functions of the axis's own reading.
pub(super) fn of_readings(
    search: &Search,
    model: &DMatrix<f64>,
    last: &Fitted,
    split: Split,
) -> Vec<OfReading> {
    let readings = Readings::of(search.rows, model, last);
    (0..3)
        .filter(|axis| readings.range[*axis].1 > 0.0)
        .filter_map(|axis| of_axis(search, model, last, &readings, axis, split))
        .collect()
}

fn of_axis(
    search: &Search,
    model: &DMatrix<f64>,
    last: &Fitted,
    readings: &Readings,
    axis: usize,
    split: Split,
) -> Option<OfReading> {
    let rows = search.rows;
    let fit = |m: &DMatrix<f64>| {
        search
            .variance
            .fit(m, &last.components, LikelihoodKind::Likelihood)
    };
    let smooth = independent_of(&readings.smooth(axis), model);
    let null = beside(model, &smooth);
    let without = fit(&null)?;
    let with_steps = |read: usize, pieces: usize| {
        let steps = readings.steps(axis, read, pieces);
        if steps.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let steps = independent_of(&steps, &null);
        if steps.ncols() == 0 {
            return None;
        }
        let fitted = fit(&beside(&null, &steps))?;
        let drop = without.deviance - fitted.deviance;
        let p = search.exceeds_by_chance(drop, steps.ncols(), null.ncols());
        Some((p * TRIED, steps, fitted))
    };
    let found = PIECES
        .into_iter()
        .filter_map(|pieces| Some((pieces, with_steps(axis, pieces)?)));
    let (pieces, (p, steps, fitted)) = found.min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    if p > FALSE_LEFTOVER {
        return None;
    }
    let all = beside(&null, &steps);
    let held = |m: &DMatrix<f64>, f: &Fitted| {
        let f = f.clone().with_prior(last.prior.clone());
        Some(rms(rows, &held_out(search, m, &f, split)?))
    };
    if !(held(&all, &fitted)? < held(&null, &without)?) {
        return None;
    }
    let others = (0..3).filter(|other| *other != axis && readings.range[*other].1 > 0.0);
    if others
        .filter_map(|other| with_steps(other, pieces))
        .any(|other| other.0 <= p)
    {
        return None;
    }
    let of_axis = rows.strata.iter().find(|s| s.axis() == Some(axis));
    let stratum = of_axis.or(rows.strata.first())?;
    let squares = |m: &DMatrix<f64>, f: &Fitted| {
        let left = &rows.y - m * &f.coefficients;
        left.rows(stratum.rows.start, stratum.rows.len())
            .norm_squared()
    };
    let explained = squares(&null, &without) - squares(&all, &fitted);
    let columns = beside(&smooth, &steps);
    Some(OfReading {
        left: Leftover {
            sensor: rows.sensor,
            stratum: of_axis.map_or(StratumName(Observable::Axis(axis), None), |s| s.name),
            axis: Some(axis),
            against: CorrelatesWith::Reading,
            strength: (explained.max(0.0) / stratum.rows.len() as f64).sqrt(),
            usual: false,
        },
        columns: unit_columns(&columns),
    })
}

/// How much lower the score is with steps at some readings in place of a smooth nonlinearity, `one` of the chosen; negative if it is higher. Missing
/// codes, and bits of a converter that weigh more or less than their nominal value, are such steps. With few different inputs they look like
/// a smooth nonlinearity.
pub(super) fn worse_with_steps(search: &Search, chosen: &[Chosen], one: usize) -> Option<f64> {
    const PLACES: usize = PIECES[2];
    let rest = without(chosen, one);
    let columns = chosen[one].columns.ncols();
    let (null, now) = (search.fit(&rest)?, search.fit(chosen)?);
    let model = search.model(&rest);
    let readings = Readings::of(search.rows, &model, &null);
    let axes = (0..3).filter(|axis| readings.range[*axis].1 > 0.0);
    let all: Vec<DMatrix<f64>> = axes
        .map(|axis| readings.steps(axis, axis, PLACES))
        .collect();
    let steps = all.into_iter().reduce(|a, b| beside(&a, &b))?;
    let whitener = search.variance.whitener(&null.components)?;
    let q = whitener.whiten(&model).qr().q();
    let (y, white) = (whitener.vector(&search.rows.y), whitener.whiten(&steps));
    let sizes: Vec<f64> = white.column_iter().map(|c| c.norm()).collect();
    let mut left = &y - &q * q.tr_mul(&y);
    let mut white = &white - &q * q.tr_mul(&white);
    // The place of a step is searched too, like the nonlinear parameter of an effect, but among so many places.
    let price = COEFFICIENT + 2.0 * (PLACES as f64).ln();
    let mut taken: Vec<usize> = Vec::new();
    while taken.len() < columns {
        let explained = |k: usize| {
            let column = white.column(k);
            let own = column.norm() > 1e-3 * sizes[k];
            own.then(|| column.dot(&left).powi(2) / column.norm_squared())
        };
        let each = (0..white.ncols()).filter_map(|k| Some((k, explained(k)?)));
        let Some((best, _)) = each.max_by(|a, b| a.1.total_cmp(&b.1)) else {
            break;
        };
        let unit = white.column(best).normalize();
        left -= &unit * unit.dot(&left);
        white -= &unit * (unit.tr_mul(&white));
        taken.push(best);
    }
    let cost = |count: usize| price * count as f64;
    let scores = (1..=taken.len()).filter_map(|count| {
        let with = beside(
            &model,
            &unit_columns(&steps.select_columns(&taken[..count])),
        );
        let fitted = search
            .variance
            .fit(&with, &null.components, LikelihoodKind::Likelihood)?;
        Some(null.deviance - fitted.deviance - cost(count))
    });
    let best = scores.max_by(f64::total_cmp)?;
    Some(null.deviance - now.deviance - COEFFICIENT * columns as f64 - best)
}
